"""Effects around a program that is not ours: each does to its echoes what it says."""

import re
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli.core.entry import main
from lidarcheck.effects import make
from lidarcheck.effects.finding import catalogue
from lidarcheck.errors import ConfigError, ExternalModelError, UsageError
from lidarcheck.formats import load_scan, save_ideal
from lidarcheck.harness.goldens.provenance import parameters_hash
from lidarcheck.model import load_model, simulate
from lidarcheck.model.external.around import seed_of_frame
from lidarcheck.model.files.write import write_model
from waveform_kit import EVERYTHING, PROGRAM, model_text, wall_scan, write_program

pytestmark = pytest.mark.usefixtures("trusting")

READS = 'reads = ["Share", "Reflectance", "Background", "Time", "Frame", "Seed"]\n'
IDEAL = wall_scan()
TURNED = """[external.parameters.threshold]
value = 0.05
low = 0.01
high = 0.5
unit = "V"
effect = "threshold"
scale = 0.01
"""


@pytest.fixture
def around(tmp_path: Path):
    """The model around the kit's program, which says what it reads; with effects by name."""
    write_program(tmp_path)

    def made(effects=(), more: str = "", **how):
        (tmp_path / "model.toml").write_text(model_text(READS + more, **how))
        model = load_model(tmp_path / "model.toml")
        for effect in effects:
            model = model.with_(effect)
        return model

    return made


def median_area(scan) -> float:
    return float(np.median(scan.area[scan.echo_number == 1]))


def test_the_program_alone_is_what_it_was(around, tmp_path):
    """Beside `variant` and `[materials]` it writes what it wrote without them."""
    full = simulate(IDEAL, around(), seed=3)
    table = (tmp_path / "model.toml").read_text().split("[external]")[1].split("[materials")[0]
    (tmp_path / "alone.toml").write_text("[external]" + table.replace(READS, ""))
    alone = simulate(IDEAL, load_model(tmp_path / "alone.toml"), seed=3)
    for name in ("x_m", "y_m", "z_m", "layer", "point", "area", "peak", "width_ns"):
        assert np.array_equal(getattr(full, name), getattr(alone, name))


def test_light_dims_and_ghosts_stand_behind(around):
    plain = simulate(IDEAL, around(), seed=3)
    dimmed = simulate(IDEAL, around([make("signal_gain", {"gain": 0.5})]), seed=3)
    assert median_area(dimmed) / median_area(plain) == pytest.approx(0.5, abs=0.02)
    ghost = {"strength": 0.05, "exponent": 0.0, "extra_m": 0.0, "retro_only": 0, "min_signal": 0.0}
    doubled = simulate(IDEAL, around([make("retro_ghost", ghost)]), seed=3)
    behind = doubled.range_m[doubled.echo_number == 2]
    near = np.abs(behind / 2.0 - 20.16) < 0.3
    assert near.sum() > 0.9 * len(IDEAL)


def test_background_makes_the_false_echoes_of_its_factor(around):
    wide = wall_scan(layers=40)
    plain, noisy = (
        simulate(wide, around(effects), seed=3) for effects in ((), [make("dark_counts", {"rate_per_ns": 9.0})])
    )
    others = [np.count_nonzero(np.abs(scan.range_m - 20.2) > 1.0) for scan in (plain, noisy)]
    assert others[1] / others[0] == pytest.approx(10.0, rel=0.5)


def test_a_shift_is_exact_on_the_lattice(around):
    plain = simulate(IDEAL, around(), seed=3)
    moved = simulate(IDEAL, around([make("range_offset", {"offset_m": 1.2})]), seed=3)
    found = [(scan.range_m[scan.area > 50.0], scan.area[scan.area > 50.0]) for scan in (plain, moved)]
    assert [len(range_m) for range_m, _ in found] == [len(IDEAL)] * 2
    assert found[1][0].mean() - found[0][0].mean() == pytest.approx(1.2, abs=0.004)
    assert found[1][1].mean() / found[0][1].mean() == pytest.approx(1.0, abs=0.01)


def test_a_frame_that_the_program_does_not_know_has_a_seed_of_its_own(around, tmp_path):
    model = around()
    assert seed_of_frame(model, 7, 0) == seed_of_frame(model, 7, 5) == 7
    text = (tmp_path / "model.toml").read_text().replace('"Frame", ', "").replace('"{frame}"', '"0"')
    (tmp_path / "still.toml").write_text(text)
    still = load_model(tmp_path / "still.toml")
    seeds = [seed_of_frame(still, 7, frame) for frame in range(4)]
    assert seeds[0] == 7
    assert len(set(seeds)) == 4
    assert max(seeds) < 2**31


def test_a_number_of_the_program_stands_for_an_effect(around):
    far = wall_scan(150.0)
    model = around(more=TURNED, threshold="{threshold}")
    assert catalogue()["threshold"].why_not(model.sensor) == ""
    plain = simulate(far, model, seed=3)
    raised = simulate(far, model.with_(make("threshold", {"shift": 20.0})), seed=3)
    same = simulate(far, around(threshold="0.25"), seed=3)
    assert len(plain) > 0.9 * len(far) > 10 * len(raised)
    assert np.array_equal(raised.area, same.area)
    with pytest.raises(UsageError, match=r"threshold: shift = 50 makes threshold 0.55; keep it from 0.01 to 0.5"):
        simulate(far, model.with_(make("threshold", {"shift": 50.0})), seed=3)


def test_what_acts_inside_says_why_it_cannot_be_had(around):
    sensor = around().sensor
    reasons = {name: effect.why_not(sensor) for name, effect in catalogue().items()}
    inside = "it acts inside the program, and no number of [external.parameters] stands for it"
    named = {name for name, effect in catalogue().items() if effect.stage == "detector"} | {"pulse_shape"}
    assert {name for name, reason in reasons.items() if reason == inside} == named
    assert {name for name, reason in reasons.items() if "scatter_material" in reason} == {"fog", "rain"}
    assert {name for name, reason in reasons.items() if not reason} == set(catalogue()) - named - {"fog", "rain"}


def test_an_echo_of_another_beam_is_one_line(around, tmp_path):
    (tmp_path / "waveform.py").write_text(
        PROGRAM.format(reads=EVERYTHING).replace("{point} {layer} {number}", "{point + 7} {layer} {number}")
    )
    (tmp_path / "model.toml").write_text(model_text(READS, '[[effects]]\nname = "signal_gain"\n'))
    with pytest.raises(ExternalModelError) as caught:
        simulate(IDEAL, load_model(tmp_path / "model.toml"))
    [line] = caught.value.lines()
    assert line.startswith(f"error: {tmp_path / 'model.toml'}: the external model ")
    assert "wrote an echo of Layer 250, Point 500, a beam that it was not handed; let it write Layer and Point" in line


def test_the_command_simulates_with_effects(around, tmp_path, capsys):
    around()
    save_ideal(IDEAL, tmp_path / "ideal.txt")
    (tmp_path / "model.toml").write_text(model_text(READS, '[[effects]]\nname = "dropout"\nshare = 1.0\n'))
    command = ["simulate", str(tmp_path / "ideal.txt"), "--model", str(tmp_path / "model.toml"), "-q"]
    assert main([*command, "--out", str(tmp_path / "scan.pcd")]) == 0
    assert len(load_scan(tmp_path / "scan.pcd")) == 0
    (tmp_path / "model.toml").write_text(model_text(READS, '[[effects]]\nname = "crosstalk"\n'))
    assert main([*command, "--out", str(tmp_path / "other.pcd")]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.match(r"error: .*model.toml:\d+: crosstalk means nothing for SMART: it acts inside the program", line)


@pytest.mark.parametrize(
    ("more", "beside", "what"),
    [
        ("", "[sensor]\nthreshold = 12\n", "threshold is a number of the detector, which is the program's own"),
        ("", "[sensor]\nspads = 12\n", "spads is a number of the detector"),
        ('reads = ["Shares"]', "", 'reads has "Shares", which nobody hands over; did you mean Share?'),
        ("scatter_material = 7", "", "scatter_material = 7 has no entry in [materials]"),
        ("[external.parameters.a]\nvalue = 2\nlow = 0\nhigh = 1", "", "a: value = 2 does not lie between low = 0 and"),
        (TURNED.replace('"threshold"', '"treshold"'), "", "acts inside a program; did you mean threshold?"),
        (TURNED.replace('"threshold"', '"dead_time.width_ns"'), "", "no number can stand for width_ns; of dead_time"),
        ('directory = "gone"', "", 'directory = "gone" is no folder'),
    ],
)  # fmt: skip
def test_faults_of_the_table(tmp_path, more, beside, what):
    (tmp_path / "model.toml").write_text(model_text(more, beside))
    with pytest.raises(ConfigError) as caught:
        load_model(tmp_path / "model.toml")
    assert any(what in str(fault) for fault in caught.value.faults)


def test_what_may_stand_in_sensor_beside_a_program(tmp_path):
    beside = '[sensor]\nreturns = 2\nstrength = "PEAK"\n[sensor.range]\nstep_m = 0.05\nmin_separation_m = 0.4\n'
    (tmp_path / "model.toml").write_text(model_text("", beside))
    sensor = load_model(tmp_path / "model.toml").sensor
    assert (sensor.max_echoes, sensor.strength, sensor.range_resolution_m, sensor.window_m) == (2, "PEAK", 0.05, 0.4)


def test_effects_around_it_are_written_in_place(around, tmp_path):
    """Comments and all else stay; a number of the program's own is changed where it stands."""
    around(more=TURNED)
    file, out = tmp_path / "model.toml", tmp_path / "sub" / "out.toml"
    (tmp_path / "scenarios").mkdir()
    file.write_text("# ours\n" + file.read_text())
    out.parent.mkdir()
    model = load_model(file)
    turned = model.with_(make("range_offset", {"offset_m": 0.25}))
    written = write_model(file, turned, tmp_path / "beside.toml")
    assert written.rewritten == ""
    text = (tmp_path / "beside.toml").read_text()
    assert text.startswith(file.read_text().rstrip("\n"))
    assert load_model(tmp_path / "beside.toml").effects == turned.effects
    assert write_model(file, turned, out).rewritten == ""
    again = load_model(out)
    assert again.external.directory == tmp_path
    assert 'directory = ".."' in out.read_text()
    assert len(simulate(IDEAL, again, seed=1))


def test_hashes_follow_what_is_said_of_the_program(around):
    hashes = [
        parameters_hash(model)
        for model in (
            around(),
            around([make("dropout", {})]),
            around(more=TURNED),
            around(more=TURNED.replace("0.05", "0.06")),
        )
    ]
    assert len(set(hashes)) == 4
