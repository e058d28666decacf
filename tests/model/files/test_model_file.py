import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.effects import Effect, catalogue, make
from lidarcheck.errors import ConfigError, InputError, LidarcheckError, UsageError
from lidarcheck.model.files.model_file import load_model, save_model
from lidarcheck.model.spec import External, Model
from lidarcheck.sensor import Material, Sensor, SpadArray, shipped_names
from places import ROOT, shared_path


def load(tmp_path: Path, text: str) -> Model:
    path = tmp_path / "m.toml"
    path.write_text(text)
    return load_model(path)


def faults(tmp_path: Path, text: str) -> list[str]:
    with pytest.raises(LidarcheckError) as caught:
        load(tmp_path, text)
    return [line.removeprefix(f"error: {tmp_path}/m.toml") for line in caught.value.lines()]


FULL = """\
variant = "SLIM"
[sensor]
threshold = 10
signal_at_1m = 6180
background_per_ns = 3.5e-4
[materials.0]
name = "road"
reflectance = 0.12
[materials.2147483647]
name = "sign"
reflectance = 1
kind = "retro"
retro_gain = 900
[[effects]]
name = "signal_gain"
gain = 0.75
[[effects]]
name = "range_offset"
"""


def test_a_whole_model(tmp_path: Path) -> None:
    model = load(tmp_path, FULL)
    assert model.sensor == Sensor.of("SLIM", threshold=10, signal_at_1m=6180.0, background_per_ns=3.5e-4)
    assert model.materials == {0: Material("road", 0.12), 2**31 - 1: Material("sign", 1.0, "retro", 900.0)}
    assert model.effects == (make("signal_gain", {"gain": 0.75}), make("range_offset", {}))
    assert model.file == tmp_path / "m.toml"
    assert model.external is None


def test_the_reference_models_load() -> None:
    for variant in ("SMART", "SLIM"):
        model = load_model(shared_path(f"data/reference_frames/{variant}_model.toml"))
        assert model.sensor == Sensor.of(variant)
        assert model.materials[7] == Material("sign", 0.6, "retro", 900.0)
        assert len(model.materials) == 8


@pytest.mark.parametrize("name", sorted(SpadArray.bounds))
def test_every_number_of_the_sensor_can_be_replaced_within_its_bounds(tmp_path: Path, name: str) -> None:
    low, high, whole, unit, _ = SpadArray.bounds[name]
    with pytest.raises(LidarcheckError, match=f"sensor.{name} = .* is out of range; use a .*number from .* {unit}"):
        load(tmp_path, f'variant = "SMART"\n[sensor]\n{name} = {high + 1:.0f}\n')
    value = 12 if name == "dead_bins" else max(low, min(high, 1))
    model = load(tmp_path, f'variant = "SMART"\n[sensor]\n{name} = {value:.0f}\n')
    assert getattr(model.sensor, name) == value
    assert isinstance(getattr(model.sensor, name), int if whole else float)


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("[sensor]\n", [":1: variant is missing; add it: text"]),
        (
            'variant = "slim"',
            [
                ":1: there is no sensor variant 'slim'; did you mean SLIM? "
                f"use one of {', '.join(shipped_names())}, or the path of a sensor file (*.toml)"
            ],
        ),
        (
            'variant = "SLIM"\n[sensor]\ntreshold = 3',
            [":3: unknown key sensor.treshold; did you mean threshold?"],
        ),
        (
            'variant = "SLIM"\n[sensor]\nthreshold = 3.5',
            [
                ":3: sensor.threshold = 3.5 is a number with a fraction; "
                "use a whole number from 0 to 100000 detectors ON"
            ],
        ),
        (
            'variant = "SLIM"\n[sensor]\n\non_bins = 13',
            [
                ":4: dead_bins = 12 is below on_bins = 13; "
                "a SPAD cannot avalanche while its output is still ON; use dead_bins >= on_bins"
            ],
        ),
        (
            'variant = "SLIM"\n[materials.road]\nname = "x"\nreflectance = 0.5',
            [':2: the key "road" in materials is not valid; use a whole number from 0 to 2147483647'],
        ),
        (
            'variant = "SLIM"\n[materials]\n2147483648.reflectance = 0.5\n01.reflectance = 0.5\n-1.reflectance = 0.5\n',
            [
                f':{line}: the key "{key}" in materials is not valid; use a whole number from 0 to 2147483647'
                for line, key in ((3, "2147483648"), (4, "01"), (5, "-1"))
            ],
        ),
        (
            'variant = "SLIM"\n[materials.1]\nname = ""\nreflectance = 1.2\nkind = "mirror"',
            [
                ':3: materials.1.name = "" is not valid; use text, not empty',
                ":4: materials.1.reflectance = 1.2 is out of range; use a number from 0 to 1",
                ':5: materials.1.kind = "mirror" is not a valid choice; use "lambertian" or "retro"',
            ],
        ),
        (
            'variant = "SLIM"\n[materials.1]\nreflectance = 1\nkind = "retro"\n'
            "[materials.2]\nreflectance = 1\nretro_gain = 9",
            [":2: a retro-reflector has no retro_gain; add retro_gain, a number from 0 to 1e+06"],
        ),
        ('variant = "SLIM"\nmaterials = 3', [":2: materials = 3 is a whole number; use a table"]),
        (
            'variant = "SLIM"\n[[effects]]\nname = "signal_gian"\n[[effects]]\nname = "signal_gain"\n\ngain = -3\n'
            '[[effects]]\ngain = 3\n[[effects]]\nname = "signal_gain"\ngian = 1.0',
            [
                ":3: there is no effect 'signal_gian'; did you mean signal_gain?",
                ":7: signal_gain: gain = -3 is out of range; use a number from 0 to 100",
                ":8: effects[2].name is missing; add it: text",
                ":12: signal_gain has no parameter 'gian'; did you mean gain?",
            ],
        ),
        (
            'variant = "SLIM"\n[[effects]]\nname = "range_offset"\n[[effects]]\nname = "signal_gain"\n'
            '[[effects]]\nname = "range_offset"\n',
            [
                ":4: signal_gain (stage light) stands behind range_offset (stage readout); "
                "put signal_gain before it: the light's way is aim, light, detector, readout"
            ],
        ),
        (
            'variant = "SLIM"\neffects = [\n3,\n{name = "signal_gain", gain = nan},\n'
            '{name = "signal_gain", gain = [1]}]',
            [
                ":3: effects[0] = 3 is a whole number; use a table",
                ":4: signal_gain: gain = nan is out of range; use a number from 0 to 100",
                ":5: signal_gain: gain = [1] is no number; use a number from 0 to 100",
            ],
        ),
        ('variant = "SLIM"\neffects = "fog"', [':2: effects = "fog" is text; use a list, each entry a table']),
        (
            'variant = "SLIM"\nexternl = 1',
            [":2: unknown key externl; valid keys are effects, materials, sensor, variant"],
        ),
        ("[external]", [":1: external.command is missing; add it: a list of at least 1, each entry text; or module"]),
        (
            'variant = "SLIM"\n[sensor]\nthreshold = 9\n[external]\ncommand = ["./a", "{scan}"]\n',
            [
                ":3: threshold is a number of the detector, which is the program's own beside [external]; remove it; "
                "a number of the program's own stands in [external.parameters.threshold]",
            ],
        ),
        (
            '[external]\ncommand = [\n"a",\n"{ideel}", "{",\n "{ini}", "{zzz}"]\ntimeout_s = 0\n',
            [
                ":6: external.timeout_s = 0 is out of range; use a number above 0 and at most 86400 s",
            ],
        ),
        (
            '[external]\ncommand = [\n"a",\n"{ideel}", "{",\n "{ini}", "{zzz}"]\nini = "no.ini"\n',
            [
                ":4: unknown placeholder {ideel}; did you mean {ideal}?",
                ":4: a single brace in '{'; write {{ or }} for a brace",
                ":5: unknown placeholder {zzz}; placeholders are {ideal}, {ini}, {scan}, {seed}, {frame}; "
                "write {{ for a brace",
                ':6: ini = "no.ini" is not a file; give its path from the model file\'s directory',
            ],
        ),
        (
            '[external]\nmodule = "a.b"\n',
            [':2: module = "a.b" names no function; write it as "package.module:function"'],
        ),
        (
            '[external]\nmodule = "a:b"\nserver = true\n',
            [":3: external.server stands beside module; remove server or module"],
        ),
        (
            '[external]\ncommand = ["a", "{seed}"]\nserver = true\n',
            [
                ":2: {seed} in the command of a server; take it out: each request names its files, seed and frame; "
                "write {{ for a brace"
            ],
        ),
        ('[external]\ncommand = ["a"]', [":2: command has no {scan}; add {scan}, the file that it must write"]),
    ],
)
def test_faults(tmp_path: Path, text: str, messages: list[str]) -> None:
    assert faults(tmp_path, text) == messages


def test_external_models_know_their_directory(tmp_path: Path) -> None:
    (tmp_path / "a.ini").write_text("x")
    model = load(
        tmp_path,
        '[external]\ncommand = ["./postpro", "{ideal}", "{ini}", "--o={scan}"]\nini = "a.ini"\ntimeout_s = 5\n',
    )
    assert model.external == External(
        ("./postpro", "{ideal}", "{ini}", "--o={scan}"), tmp_path, tmp_path / "a.ini", 5.0
    )
    before = (tmp_path / "m.toml").read_bytes()
    save_model(model, tmp_path / "m2.toml")
    assert load_model(tmp_path / "m2.toml") == replace(model, file=tmp_path / "m2.toml")
    (tmp_path / "sub").mkdir()
    save_model(model, tmp_path / "sub" / "m.toml")
    with pytest.raises(LidarcheckError, match=r"leads out of the project"):
        load_model(tmp_path / "sub" / "m.toml")
    (tmp_path / "case.toml").touch()
    moved = load_model(tmp_path / "sub" / "m.toml")
    assert moved.external == model.external
    assert (tmp_path / "m.toml").read_bytes() == before


def test_what_no_file_may_hold_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    bad = Model(Sensor.of("SLIM"), {-2: Material("x", 0.5), -1: Material("y", 0.5)})
    with pytest.raises(ConfigError) as caught:
        save_model(bad, path)
    assert len(caught.value.faults) == 2
    assert not path.exists()
    with pytest.raises(InputError, match="cannot write"):
        save_model(Model(Sensor.of("SLIM")), tmp_path / "none" / "m.toml")


def _sensor_values() -> st.SearchStrategy[dict[str, float]]:
    def one(name: str) -> st.SearchStrategy[float]:
        low, high, whole, *_ = SpadArray.bounds[name]
        return st.integers(int(low), int(high)) if whole else st.floats(low, high)

    return st.fixed_dictionaries({}, optional={name: one(name) for name in SpadArray.bounds}).filter(
        lambda values: values.get("dead_bins", 12) >= values.get("on_bins", 9)
    )


TEXT = st.text(st.characters(codec="utf-8"), min_size=1, max_size=10)
MATERIALS = st.builds(Material, TEXT, st.floats(0, 1)) | st.builds(
    Material, TEXT, st.floats(0, 1), st.just("retro"), st.floats(0, 1e6)
)


@st.composite
def effects_of_the_catalogue(draw: st.DrawFn) -> tuple[Effect, ...]:
    """Effects in the light's order, each with numbers from its own ranges."""
    kinds = draw(st.sets(st.sampled_from(sorted(catalogue())), max_size=4))
    made = []
    for name in [name for name in catalogue() if name in kinds]:
        numbers = {
            p.name: draw(st.integers(int(p.low), int(p.high)) if p.whole else st.floats(p.low, p.high))
            for p in catalogue()[name].parameters()
        }
        try:
            effect = make(name, numbers)
            effect.check(Sensor.of("SMART"))
            made.append(effect)
        except UsageError:  # numbers that do not fit together, or layers that no beam has
            made.append(make(name, {}))
    return tuple(made)


@settings(max_examples=examples(100), deadline=None)
@given(
    variant=st.sampled_from(["SMART", "SLIM"]),
    overrides=_sensor_values(),
    materials=st.dictionaries(st.integers(0, 2**31 - 1), MATERIALS, max_size=4),
    effects=effects_of_the_catalogue(),
)
def test_what_is_saved_loads_as_the_same_model(
    tmp_path_factory: pytest.TempPathFactory,
    variant: str,
    overrides: dict[str, float],
    materials: dict[int, Material],
    effects: tuple[Effect, ...],
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.toml"
    model = Model(Sensor.of(variant, **overrides), materials, effects, file=path)
    # A dead time below the ON time is refused, which has a test of its own.
    assume(all(effect.name != "dead_time" for effect in effects))
    # So is a threshold that a shift takes beyond its range.
    assume("threshold" not in overrides or all(effect.name != "threshold" for effect in effects))
    save_model(model, path)
    assert load_model(path) == model


@settings(max_examples=examples(250), deadline=None)
@given(
    edits=st.lists(st.tuples(st.integers(0, len(FULL) - 1), st.integers(0, 255)), max_size=4),
    cut=st.none() | st.integers(0, len(FULL)),
    swap=st.sampled_from(
        [(b"", b""), (b"[", b"[["), (b"0", b"-1e9"), (b"=", b""), (b'"', b"'"), (b"[sensor]", b"[external]")]
    ),
)
def test_a_damaged_model_is_read_or_refused_in_single_lines(
    tmp_path_factory: pytest.TempPathFactory,
    edits: list[tuple[int, int]],
    cut: int | None,
    swap: tuple[bytes, bytes],
) -> None:
    content = bytearray(FULL.encode())
    for position, byte in edits:
        content[position] = byte
    path = tmp_path_factory.getbasetemp() / "damaged_model.toml"
    path.write_bytes(bytes(content).replace(*swap)[:cut] if swap[0] else bytes(content)[:cut])
    try:
        model = load_model(path)
    except LidarcheckError as error:
        for line in error.lines():
            assert line.startswith(f"error: {path}")
            assert "; " in line
    else:
        assert all(0 <= material.reflectance <= 1 for material in model.materials.values())


def test_the_documented_models_load_and_every_number_is_documented(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "model-files.md").read_text(encoding="utf-8")
    (tmp_path / "postpro.ini").write_text("x")
    built_in, external, around = [
        load(tmp_path, block) for block in re.findall(r"```toml\n((?!\[\[effects).*?)```", text, re.DOTALL)
    ]
    assert [effect.name for effect in built_in.effects] == ["signal_gain", "range_offset"]
    assert external.external is not None
    assert [one.name for one in around.external.parameters] == ["dead_ns"]
    assert around.sensor.stands_for("dead_time")
    for name, (low, high, *_) in SpadArray.bounds.items():
        high_text = "1e9" if high == 1e9 else f"{high:.0f}"
        assert f"| `{name}` | {low:g} to {high_text}" in text


def test_a_gain_without_effect_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "m.toml"
    path.write_text('variant = "SLIM"\n[materials.3]\nreflectance = 0.5\nretro_gain = 9.0\n')
    assert load_model(path).materials[3].retro_gain == 1.0
    assert "m.toml:4: material 3 is lambertian: retro_gain = 9 has no effect" in caplog.text


def test_a_dead_time_that_cannot_be_is_found_with_the_file_s_line(tmp_path: Path) -> None:
    path = tmp_path / "dead.toml"
    path.write_text('variant = "SMART"\n\n[[effects]]\nname = "dead_time"\nshift_ns = -20.0\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"dead\.toml:5: dead_time: shift_ns = -20.0 makes .* use a shift_ns from -3"):
        load_model(path)
