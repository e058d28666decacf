"""Adding it: the model file's text with the effects put in, and what that changes."""

import dataclasses
import logging
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.effects import Effect, catalogue, empirical_terms, make
from lidarcheck.errors import InputError, UsageError
from lidarcheck.explain.report.model_diff import model_diff, write_model
from lidarcheck.model import Model, load_model
from lidarcheck.sensor import Sensor

TEXT = """\
# The sensor on the roof, measured in May.
variant = "SMART"   # reference

[sensor]
signal_at_1m = 6180.0       # a bit brighter

[materials.1]
name = "asphalt"
reflectance = 0.12

# a dirty window
[[effects]]
name = "signal_gain"
gain = 0.9   # 10 % dirt

# read-out: "every # second" row
[[effects]]
name = 'layer_gain'
"gain" = 0.8
first_layer = 100

[[effects]]
# fitted by hand
name = "empirical_range"
covariate = "range_m"
knots = [
    10,  # near
    60,
]
values = [0.0, 0.1]

# jitter follows
[[effects]]
  name = "timing_jitter"
  sigma_ns = 0.7
# uniform_ns = 0.3

# the end
"""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "case" / "model.toml"
    path.parent.mkdir()
    path.write_text(TEXT, encoding="utf-8")
    return path


def written(source: Path, model: Model, out: Path | None = None) -> str:
    """The text that was written, once it has been seen to read as the model."""
    out = out or source.parent / "out.toml"
    result = write_model(source, model, out)
    assert result.rewritten == ""
    assert result.path == out
    assert dataclasses.replace(load_model(out), file=None) == dataclasses.replace(model, file=None)
    return out.read_bytes().decode("utf-8")


def test_an_untouched_model_is_written_byte_for_byte(source: Path) -> None:
    assert written(source, load_model(source)) == TEXT


def test_a_new_effect_stands_in_its_place_and_all_else_stays(source: Path) -> None:
    model = load_model(source).with_(make("fog", {"mor_m": 80.0})).with_(make("boresight", {"yaw_deg": 0.25}))
    text = written(source, model)
    aim = text.index('name = "boresight"')
    assert text.index('name = "asphalt"') < aim < text.index("# a dirty window")
    assert text.index('"gain" = 0.8') < text.index('name = "fog"') < text.index("# fitted by hand")
    assert "mor_m = 80.0\n" in text
    new = [line for line in text.splitlines() if line not in TEXT.splitlines()]
    left = iter(text.splitlines())
    assert all(line in left for line in TEXT.splitlines()), "the old lines do not stand in their old order"
    assert len(new) == len([*make("fog", {}).settings(), *make("boresight", {}).settings()]) + 2


def test_an_effect_behind_the_last_goes_behind_what_is_said_of_that(source: Path) -> None:
    text = written(source, load_model(source).with_(make("walk_error", {})))
    before, after = text.split('[[effects]]\nname = "walk_error"\n')
    assert before.endswith("# uniform_ns = 0.3\n\n")
    assert after.endswith("\n\n# the end\n")


def test_a_changed_parameter_is_replaced_and_its_comment_stays(source: Path) -> None:
    model = load_model(source)
    for effect in (
        make("signal_gain", {"gain": 0.8250000000000001}),
        make("layer_gain", {"gain": 0.75, "first_layer": 100, "every": 2}),
        make("timing_jitter", {"sigma_ns": 0.7, "uniform_ns": 0.5}),
    ):
        model = dataclasses.replace(
            model, effects=tuple(effect if effect.name == old.name else old for old in model.effects)
        )
    text = written(source, model)
    expected = TEXT.replace("gain = 0.9   # 10", "gain = 0.8250000000000001   # 10").replace(
        '"gain" = 0.8', '"gain" = 0.75'
    )
    expected = expected.replace("first_layer = 100\n", "first_layer = 100\nevery = 2\n")
    expected = expected.replace("  sigma_ns = 0.7\n", "  sigma_ns = 0.7\n  uniform_ns = 0.5\n")
    assert text == expected


def test_a_list_over_several_lines_is_replaced_as_a_whole(source: Path) -> None:
    model = load_model(source)
    term = make("empirical_range", {"covariate": "range_m", "knots": (10, 30, 60), "values": (0.0, 0.0, 0.1)})
    effects = tuple(term if effect.name == term.name else effect for effect in model.effects)
    text = written(source, dataclasses.replace(model, effects=effects))
    assert "knots = [10.0, 30.0, 60.0]\nvalues = [0.0, 0.0, 0.1]\n\n# jitter follows\n" in text
    assert "# fitted by hand" in text


def test_an_effect_can_be_taken_out(source: Path) -> None:
    text = written(source, load_model(source).without("layer_gain"))
    block = "[[effects]]\nname = 'layer_gain'\n\"gain\" = 0.8\nfirst_layer = 100\n\n"
    assert text == TEXT.replace(block, "")


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("last", [True, False])
def test_a_model_without_effects_gets_its_first_one(ending: str, mark: str, last: bool, tmp_path: Path) -> None:
    source = tmp_path / "model.toml"
    text = mark + f'variant = "SLIM"{ending}# Straße{ending if last else ""}'
    source.write_bytes(text.encode())
    found = written(source, load_model(source).with_(make("dropout", {"share": 0.125})))
    lines = ["", "[[effects]]", 'name = "dropout"', "share = 0.125", "block_points = 1", "block_layers = 1", ""]
    assert found == text + ("" if last else ending) + ending.join(lines)


def test_a_lut_is_found_from_the_new_place(source: Path) -> None:
    (source.parent.parent / ".git").mkdir()  # one project
    lut = source.parent / "tables" / "lut.ini"
    lut.parent.mkdir()
    lut.write_text("PostPro.LUT_blooming_X = -10, 0, 10\nPostPro.LUT_blooming_Y = 0.001, 0.1, 0.001\n")
    source.write_text('variant = "SMART"\n[[effects]]\nname = "blooming_vertical"\nlut = "tables/lut.ini"  # May\n')
    out = source.parent.parent / "results" / "model.toml"
    out.parent.mkdir()
    model = load_model(source).with_(make("dropout", {}))
    assert write_model(source, model, out).rewritten == ""
    assert 'lut = "../case/tables/lut.ini"  # May\n' in out.read_text()
    (bloom, _) = load_model(out).effects
    assert bloom.lut.y == (0.001, 0.1, 0.001)  # type: ignore[attr-defined]
    assert model_diff(load_model(source), load_model(out)) == [
        "+ [[effects]]",
        '+ name = "dropout"',
        "+ share = 0.02",
        "+ block_points = 1",
        "+ block_layers = 1",
    ]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('variant = "SMART"\neffects = [{name = "dropout", share = 0.5}]\n', "its effects are not [[effects]] tables"),
        ('variant = "SMART"\nsensor = {threshold = 12}\n', "'sensor = {threshold = 12}' is no plain key with a number"),
    ],
)
def test_what_cannot_be_edited_is_written_anew_and_that_is_said(
    text: str, why: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source, out = tmp_path / "model.toml", tmp_path / "new.toml"
    source.write_text(text)
    model = load_model(source).with_(make("range_offset", {"offset_m": 0.5})).with_sensor(threshold=9)
    with caplog.at_level(logging.WARNING):
        result = write_model(source, model, out)
    assert result.rewritten == why
    assert why in caplog.text
    assert dataclasses.replace(load_model(out), file=None) == dataclasses.replace(model, file=None)


def test_nothing_is_written_where_it_cannot_be(source: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        write_model(source, load_model(source), source.parent / "nowhere" / "model.toml")
    external = source.parent / "external.toml"
    program = source.parent / "run"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    external.write_text('[external]\ncommand = ["./run", "{ideal}", "{scan}"]\n')
    write_model(external, load_model(external), source.parent.parent / "model.toml")
    assert f'directory = "{source.parent.name}"' in (source.parent.parent / "model.toml").read_text()


def test_the_model_s_own_file_can_be_the_one_that_is_written(source: Path) -> None:
    model = load_model(source).with_(make("dropout", {}))
    written(source, model, source)
    assert 'name = "dropout"' in source.read_text()


@st.composite
def chosen(draw: st.DrawFn) -> tuple[Effect, ...]:
    """Effects and empirical terms in the light's order, each with numbers of its own."""
    known = catalogue() | empirical_terms()
    names = draw(st.lists(st.sampled_from(sorted(known)), max_size=5, unique=True))
    found = Model(Sensor.of("SLIM"))
    for name in names:
        kind = known[name]
        numbers = {
            p.name: draw(st.sampled_from([p.typical, p.low, p.high]))
            for p in kind.parameters()
            if draw(st.booleans()) and not name.startswith(("dead", "blooming"))
        }
        try:
            effect = make(name, kind.example() | numbers)
            effect.check(found.sensor)  # the highest beam of a parameter may lie beyond this sensor's
        except UsageError:
            effect = make(name, kind.example())
        found = found.with_(effect)
    return found.effects


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=chosen(), second=chosen(), ending=st.sampled_from(["\n", "\r\n"]))
def test_any_effects_become_any_others_and_the_comments_stay(
    first: tuple[Effect, ...], second: tuple[Effect, ...], ending: str, tmp_path: Path
) -> None:
    source = tmp_path / "model.toml"
    source.write_bytes(f'# head{ending}variant = "SLIM" # kind{ending}'.encode())
    start = load_model(source)
    model = dataclasses.replace(start, effects=first)
    source.write_bytes(written(source, model).encode())
    text = written(source, dataclasses.replace(start, effects=second))
    assert text.startswith(f'# head{ending}variant = "SLIM" # kind{ending}')
    assert text.count("\n") == text.count(ending)
    assert (model_diff(model, dataclasses.replace(start, effects=second)) == []) == (first == second)


def test_the_difference_says_what_changed_in_the_order_of_the_light_s_way(source: Path) -> None:
    before = load_model(source)
    after = before.with_(make("fog", {"mor_m": 80.0})).without("timing_jitter").with_sensor(threshold=10)
    dirty = make("signal_gain", {"gain": 0.8})
    after = dataclasses.replace(after, effects=(dirty, *after.effects[1:]))
    fog = [f"+ {key} = {value!r}" for key, value in make("fog", {"mor_m": 80.0}).settings().items()]
    jitter = [f"- {key} = {value!r}" for key, value in make("timing_jitter", {}).settings().items()]
    assert model_diff(before, after) == [
        "  [sensor]",
        "+ threshold = 10",
        "  [[effects]]",
        '  name = "signal_gain"',
        "- gain = 0.9",
        "+ gain = 0.8",
        "+ [[effects]]",
        '+ name = "fog"',
        *fog,
        "- [[effects]]",
        '- name = "timing_jitter"',
        *jitter,
    ]
    assert model_diff(before, before) == []
