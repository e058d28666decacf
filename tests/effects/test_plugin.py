"""An effect from another package takes part everywhere, as docs/new-effect.md says: its own files run here."""

import os
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```(?:python|toml)\n# (?P<path>\S+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
FILES = {m["path"]: m["text"] for m in BLOCK.finditer((ROOT / "docs/new-effect.md").read_text(encoding="utf-8"))}
LAW, SEARCH = "src/lidarcheck/effects/window_film.py", "src/lidarcheck/effects/search/window_film.py"
SCENARIO = "scenarios/effect_window_film_SMART.toml"

EVERYWHERE = """
import json
from pathlib import Path
from lidarcheck.calibration.parameters.parameters import known_names
from lidarcheck.cli import main
from lidarcheck.effects import catalogue, make
from lidarcheck.explain.search.related import are_related
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.harness.propose.candidates import search_spec
from lidarcheck.model import Model
from lidarcheck.sensor import Sensor
from lidarcheck.tui.jobs.scenes import Effects, offers_of
import effects_page

assert "window_film" in catalogue()
assert "### window_film" in effects_page.page(catalogue())
model = Model(Sensor.of("SMART")).with_(make("window_film", {}))
assert "effects.window_film.transmission" in known_names(model), known_names(model)
assert "window_film" in [offer.name for offer in offers_of(Model(Sensor.of("SMART")), Effects())]
if SEARCHED:
    starts = fixed_probes(list(catalogue()))
    assert [p.settings["transmission"] for p in starts if p.name == "window_film"] == [0.9, 0.6]
    assert are_related("window_film", "signal_gain")
    assert search_spec("window_film").watched_by
else:
    assert not fixed_probes(["window_film"])
    assert not any(are_related("window_film", name) for name in catalogue())
assert main(["effects"]) == 0
assert main(["simulate", "ideal.txt", "--model", "model.toml", "--out", "out.txt"]) == 0
"""


def installed(place: Path, *, searched: bool = True) -> Path:
    """The plugin as an installer leaves it in a directory of packages."""
    package = place / "window_film"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "law.py").write_text(FILES[LAW], encoding="utf-8")
    (package / "search.py").write_text(FILES[SEARCH], encoding="utf-8")
    project = tomllib.loads(FILES["pyproject.toml"])["project"]
    points = project["entry-points"]["lidarcheck.effects"]
    named = [f"{name} = {value}" for name, value in points.items() if searched or "search" not in name]
    info = place / "window_film-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    (info / "entry_points.txt").write_text("[lidarcheck.effects]\n" + "\n".join(named) + "\n")
    return place


def run(place: Path, packages: Path, code: str) -> subprocess.CompletedProcess[str]:
    (place / "ideal.txt").write_text("Layer Point Distance MaterialID IncidenceAngle\n250 470 30.0 1 0.0\n")
    effect = '[[effects]]\nname = "window_film"\n'
    (place / "model.toml").write_text(
        f'variant = "SMART"\n[materials.1]\nname = "panel"\nreflectance = 0.5\n{effect}', encoding="utf-8"
    )
    paths = [str(packages), str(ROOT / "src"), str(ROOT / "ci")]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-c", textwrap.dedent(code)]
    return subprocess.run(command, cwd=place, env=env, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("searched", [True, False], ids=["with what a search must know", "with its law alone"])
def test_an_effect_of_a_plugin_is_everywhere(tmp_path: Path, searched: bool) -> None:
    packages = installed(tmp_path / "packages", searched=searched)
    ended = run(tmp_path, packages, f"SEARCHED = {searched}\n{EVERYWHERE}")
    assert ended.returncode == 0, ended.stderr
    assert "window_film" in ended.stdout
    assert "the more the more obliquely" in ended.stdout
    assert (tmp_path / "out.txt").is_file()


def test_the_scenario_of_the_page_is_measured(tmp_path: Path) -> None:
    packages = installed(tmp_path / "packages")
    (tmp_path / "scenarios").mkdir()
    (tmp_path / SCENARIO).write_text(FILES[SCENARIO], encoding="utf-8")
    code = "from lidarcheck.cli import main\nraise SystemExit(main(['check', 'effect_window_film_SMART']))"
    ended = run(tmp_path, packages, code)
    assert "area_mean.side" in ended.stdout, ended.stderr
    assert "no golden" in ended.stdout + ended.stderr
    assert [*(tmp_path / ".lidarcheck/proposals").iterdir()]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("broken = window_film.nowhere", "the plugin broken (window_film.nowhere) does not load"),
        ("again = lidarcheck.effects.fog:Fog", "a plugin has an effect 'fog', as lidarcheck itself has"),
    ],
)
def test_a_plugin_that_cannot_be_taken_is_named(tmp_path: Path, text: str, said: str) -> None:
    packages = installed(tmp_path / "packages")
    (packages / "window_film-1.0.dist-info/entry_points.txt").write_text(f"[lidarcheck.effects]\n{text}\n")
    ended = run(tmp_path, packages, "from lidarcheck.cli import main\nraise SystemExit(main(['effects']))")
    assert ended.returncode == 2
    assert said in ended.stderr
