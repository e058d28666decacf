"""docs/effects.md: written from the catalogue, and up to date."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import pytest

from lidarcheck.effects.base import LightEffect, parameter
from lidarcheck.effects.finding import catalogue

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("effects_page", ROOT / "ci" / "effects_page.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_the_catalogue_says(script):
    written = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    assert written == script.page(catalogue()), "docs/effects.md is out of date: run ci/effects_page"


@dataclass(frozen=True)
class Sample(LightEffect):
    """Light is turned <around> 2*3*4.

    With `a|b*c`:

        y = a|b * <c>

    Identity at 0.
    """

    name = "sample"
    tree = (87, 9999)

    amount: float = parameter("1/m|s", low=-1.5, high=1e6, typical=0.25, noticeable=0.05, meaning="how * much")

    def light(self, light, around):
        return light


def test_an_effect_that_is_added_has_its_section(script):
    text = script.page({"sample": Sample})
    assert "| [`sample`](#sample) | light | all | 87, 9999 | Light is turned \\<around> 2\\*3\\*4. |" in text
    assert "Effect tree: 87 extinction, 9999." in text
    assert "| `amount` | 1/m\\|s | -1.5 ... 1e+06 | 0.25 | 0.05 | how \\* much |" in text
    assert "\n    y = a|b * <c>\n" in text
    assert "With `a|b*c`:" in text
    assert '```toml\n[[effects]]\nname = "sample"\namount = 0.25\n```' in text


def test_the_stages_stand_in_the_order_of_the_light_s_way(script):
    text = script.page(catalogue())
    places = [text.index(f"\n## Stage {stage}: ") for stage in ("aim", "light", "detector", "readout")]
    assert places == sorted(places)
    for name, effect in catalogue().items():
        assert text.count(f"\n### {name}\n") == 1
        assert all(f"`{p.name}`" in text for p in effect.parameters())


def test_every_example_of_the_page_is_a_model(script, tmp_path):
    import re

    from lidarcheck.model import load_model

    examples = re.findall(r"```toml\n(.*?)```", script.page(catalogue()), re.DOTALL)
    assert len(examples) == len(catalogue()) + 1
    for example in examples:
        head = "" if example.startswith("variant") else 'variant = "SLIM"\n'
        path = tmp_path / "model.toml"
        path.write_text(head + example, encoding="utf-8")
        assert len(load_model(path).effects) == 1
