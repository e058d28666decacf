"""`lidarcheck effects`: the catalogue for people and for machines, and the curve that shows an effect."""

import json
import os
import pty
import re
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from lidarcheck import effects
from lidarcheck.cli import main
from lidarcheck.effects.base import DetectorEffect, ReadoutEffect, parameter
from lidarcheck.errors import UsageError
from lidarcheck.model.showcase import show
from lidarcheck.model.showcase.scene import ideal_scan, scene
from lidarcheck.rays import Rays
from lidarcheck.sensor import shipped_names
from reference_grid import beam_directions

NAMES = list(effects.catalogue())


def output(capsys, *arguments):
    assert main(["effects", *arguments]) == 0
    out, err = capsys.readouterr()
    assert "error" not in err
    return out


def test_the_table_has_every_effect_once_in_the_order_of_the_light_s_way(capsys):
    lines = output(capsys).split("\n\n")[0].splitlines()
    assert lines[0].split()[:2] == ["effect", "stage"]
    assert [line.split()[:2] for line in lines[1:]] == [[e.name, e.stage] for e in effects.catalogue().values()]


def test_json_of_all_effects(capsys):
    found = json.loads(output(capsys, "--json"))
    assert [effect["name"] for effect in found] == NAMES
    for effect in found:
        facts = {"name", "stage", "summary", "description", "tree", "parameters", "files", "detectors", "unfit"}
        assert set(effect) == facts | {"around_program"}
        assert {*effect["detectors"], *effect["unfit"]} == {"spad_array", "linear", "photon_histogram"}
        assert effect["stage"] in ("aim", "light", "detector", "readout")
        assert effect["description"].startswith(effect["summary"])
        assert all(isinstance(node, int) for node in effect["tree"])
        declared = effects.find(effect["name"])
        assert list(effect["parameters"]) == [p.name for p in declared.parameters()]
        assert list(effect["files"]) == [f.name for f in declared.files()]
        for p in effect["parameters"].values():
            assert p["low"] <= p["typical"] <= p["high"]
            assert isinstance(p["unit"], str)
            assert p["meaning"]
        for f in effect["files"].values():
            assert set(f) == {"kind", "noticeable", "meaning"}


@pytest.mark.parametrize("name", NAMES[::7])
def test_json_of_one_effect_has_its_curve(name, capsys):
    found = json.loads(output(capsys, name, "--json"))
    shown = found["shown"]
    assert len(shown["x"]) == len(shown["before"]) == len(shown["after"]) > 0
    assert None not in shown["x"] + shown["before"] + shown["after"]
    assert shown["x"] == sorted(shown["x"])
    assert shown["label"]
    assert "[" in shown["y_label"]
    assert shown["parameters"] == effects.make(name, {}).settings()
    assert (shown["variant"], shown["seed"]) == ("SMART", 0)


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_shows_at_its_typical_values_on_one_sensor_at_least(name):
    assert any(show(effects.make(name, {}), variant=variant).significant for variant in ("SMART", "SLIM"))


def test_without_a_plot_there_is_no_curve(capsys, monkeypatch):
    monkeypatch.setattr("lidarcheck.cli.simulation.effects._show", lambda *_: pytest.fail("simulated for nothing"))
    assert "shown" not in json.loads(output(capsys, "dropout", "--json", "--no-plot"))
    text = output(capsys, "dropout", "--no-plot")
    assert "without   # with" not in text
    assert text.endswith("share = 0.02\n  block_points = 1\n  block_layers = 1\n")


def test_an_explanation_has_all_there_is_to_say(capsys):
    text = output(capsys, "layer_gain")
    assert text.startswith("layer_gain (light)\n\nSome layers are more or less sensitive than others.\n")
    assert "Identity" in text
    assert "it has no node for this" in text
    assert "· without   # with" in text
    assert re.search(r"^gain +0 +10 +0\.8", text, re.MULTILINE)
    assert "\x1b" not in text
    plot = text[text.index("Shown on a small") : text.index("In a model file:")].splitlines()
    assert max(map(len, plot)) <= 80
    assert len(plot) < 22


def test_the_tree_is_named(capsys):
    named = [name for name, effect in effects.catalogue().items() if effect.tree]
    assert named
    for name in named:
        text = output(capsys, name, "--no-plot")
        assert re.search(r"^Effect tree \(PerCollECT/LidarLimbs\): \d+ [a-z]", text, re.MULTILINE), name


def test_set_changes_what_is_shown(capsys):
    typical, strong = (
        json.loads(output(capsys, "range_offset", "--json", *more))["shown"]
        for more in ((), ("--set", "offset_m=-0.75", "--seed", "4", "--variant", "SLIM"))
    )
    assert strong["parameters"] == {"offset_m": -0.75}
    assert (strong["variant"], strong["seed"]) == ("SLIM", 4)
    change = np.subtract(strong["after"], strong["before"])
    assert change == pytest.approx(np.full(len(change), -0.75), abs=1e-9)
    assert np.abs(np.subtract(typical["after"], typical["before"])).max() < 0.2


def test_several_parameters_can_be_set(capsys):
    arguments = ("--set", "gain=0", "--set", "first_layer=240", "--set=last_layer=249")
    assert "gain = 0, first_layer = 240, last_layer = 249" in output(capsys, "layer_gain", *arguments)


def test_nothing_that_changes_is_said_in_words(capsys):
    text = output(capsys, "signal_gain", "--set", "gain=1")
    assert "nothing changes there by more than chance" in text
    assert "# with" not in text
    assert json.loads(output(capsys, "signal_gain", "--set", "gain=1", "--json"))["shown"]["significant"] is False


REFUSED = {
    "layer_gian": "there is no effect 'layer_gian'; did you mean layer_gain?",
    "layer_gain --set gian=1": "layer_gain has no parameter 'gian'; did you mean gain?",
    "layer_gain --set gain=11": "layer_gain: gain = 11 is out of range; use a number from 0 to 10",
    "layer_gain --set gain=nan": "layer_gain: gain = nan is out of range; use a number from 0 to 10",
    "layer_gain --set gain=big": "layer_gain: gain = 'big' is no number; use a number from 0 to 10",
    "layer_gain --set first_layer=1.5": (
        "layer_gain: first_layer = 1.5 is out of range; use a whole number from 0 to the last layer"
    ),
    "layer_gain --set gain": "--set gain is no setting; use --set PARAMETER=VALUE, as --set gain=0.5",
    "layer_gain --set gain=": "--set gain= is no setting; use --set PARAMETER=VALUE, as --set gain=0.5",
    "layer_gain --set gain=1 --set gain=2": "--set gain is given more than once; give it once",
    "layer_gain --variant FAT": "there is no sensor variant 'FAT'; "
    f"use one of {', '.join(shipped_names())}, or the path of a sensor file (*.toml)",
    "--set gain=1": "--set needs an effect; name it: lidarcheck effects NAME --set PARAMETER=VALUE",
}


@pytest.mark.parametrize(("line", "says"), REFUSED.items())
def test_what_cannot_be_shown_is_refused_in_one_line(line, says, capsys):
    assert main(["effects", *line.split()]) == 2
    assert capsys.readouterr() == ("", f"error: {says}\n")


def test_a_file_is_not_set_on_the_command_line(capsys):
    name, file = next((name, f.name) for name, effect in effects.catalogue().items() for f in effect.files())
    assert main(["effects", name, "--set", f"{file}=x.ini"]) == 2
    assert capsys.readouterr().err.startswith(f"error: --set {file} names a file; ")


SHOWS = (
    ("signal_gain", {"gain": 0.8}, {"AREA"}, None),
    ("range_offset", {"offset_m": 0.1}, {"range_residual"}, None),
    ("range_scale", {"fraction": 0.01}, {"range_residual"}, {"range"}),
    ("dropout", {"share": 0.1}, {"detection"}, None),
    ("dark_counts", {"rate_per_ns": 0.004}, {"strays"}, None),
    ("layer_gain", {"gain": 0.5}, {"AREA", "PEAK"}, {"layer"}),
    ("threshold", {}, {"WIDTH"}, {"signal"}),
)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize(("name", "settings", "quantities", "over"), SHOWS)
def test_the_curve_that_an_effect_changes_is_the_one_shown(name, settings, quantities, over, variant):
    shown = show(effects.make(name, settings), variant=variant, seed=1)
    assert shown.significant
    assert shown.quantity in quantities
    assert over is None or shown.over in over


def test_the_curve_is_right():
    block = show(effects.make("layer_gain", {"gain": 0.5}))
    inside = (block.x > 251) & (block.x < 268)
    assert block.before == pytest.approx(np.ones(len(block.x)))
    assert np.all(block.after[inside] < 0.95)
    assert block.after[(block.x < 246) | (block.x > 274)] == pytest.approx(1.0)
    lost = show(effects.make("dropout", {"share": 0.25}))
    assert np.mean(lost.after - lost.before) == pytest.approx(-25.0, abs=3.0)


@dataclass(frozen=True)
class Added(ReadoutEffect):
    """An effect that nobody has heard of: it makes echoes of the left half twice as wide."""

    name = "added"
    factor: float = parameter("", low=1.0, high=9.0, typical=2.0, meaning="how much wider")

    def readout(self, scan, around):
        import dataclasses

        width = np.where(scan.point >= 480, self.factor, 1.0) * scan.width_ns
        return dataclasses.replace(scan, width_ns=width)


@dataclass(frozen=True)
class Blind(DetectorEffect):
    """A sensor that sees nothing."""

    name = "blind"

    def detector(self, sensor):
        import dataclasses

        return dataclasses.replace(sensor, threshold=100_000)


def test_an_effect_that_is_added_has_its_curve_for_free():
    shown = show(Added())
    assert (shown.quantity, shown.over) == ("WIDTH", "point")
    assert shown.after[shown.x > 490] == pytest.approx(2.0 * shown.before[shown.x > 490])
    assert shown.after[shown.x < 470] == pytest.approx(shown.before[shown.x < 470])


@dataclass(frozen=True)
class Misplaced(ReadoutEffect):
    """Every echo is reported a point farther to the left, also where no beam was fired."""

    name = "misplaced"

    def readout(self, scan, around):
        import dataclasses

        return dataclasses.replace(scan, point=scan.point + 1)


def test_echoes_of_beams_that_were_not_fired_do_no_harm():
    shown = show(Misplaced())
    assert shown.significant
    assert np.isfinite(shown.after).all()


def test_an_effect_that_leaves_nothing_is_shown_by_what_is_lost():
    shown = show(Blind())
    assert (shown.quantity, shown.significant) == ("detection", True)
    assert np.all(shown.after == 0.0)


def test_the_same_seed_shows_the_same_curve():
    one, same, other = (show(effects.make("dropout", {}), seed=seed) for seed in (2, 2, 3))
    assert one.after.tobytes() == same.after.tobytes()
    assert one.after.tobytes() != other.after.tobytes()
    with pytest.raises(UsageError, match="seed -1 is out of range"):
        show(effects.make("dropout", {}), seed=-1)


@pytest.mark.long
def test_chance_alone_is_not_shown_as_a_change():
    for seed in range(20):
        assert not show(effects.make("dropout", {"share": 1e-4}), seed=seed).significant


def test_the_demonstration_has_what_effects_act_on():
    ideal = ideal_scan()
    hit = ideal.distance_m > 0.0
    assert 3000 < len(ideal) < 15_000
    assert set(ideal.material_id[hit].tolist()) == {1, 2, 3, 4, 5}
    assert (~hit).sum() > 1000
    assert ideal.distance_m[hit].min() < 5.1
    assert ideal.distance_m[hit].max() > 79.0
    ground = hit & (ideal.material_id == 2)
    height = ideal.distance_m[ground] * beam_directions(ideal.layer[ground], ideal.point[ground])[:, 2]
    assert height == pytest.approx(-1.8)
    incidence = ideal.incidence_deg[hit & ~ground]
    assert incidence.min() < 5.0
    assert incidence.max() > 70.0


def test_the_demonstration_s_scene_moves_what_moves():
    panels = scene()
    moving = dict(panels.velocities_m_s)
    (number,) = moving
    ideal = ideal_scan()
    on = np.flatnonzero(ideal.object_id == number)
    rays = Rays(
        np.zeros((len(on), 3)), beam_directions(ideal.layer[on], ideal.point[on]), np.full(len(on), 0.01), on * 0
    )
    still, later = panels.cast(rays), panels.cast(rays, moving=moving)
    assert still.distance_m == pytest.approx(ideal.distance_m[on])
    both = later.object_id == number
    assert both.mean() > 0.8
    assert np.all(later.distance_m[both] < still.distance_m[both] - 0.05)
    assert np.all(panels.cast(rays, max_range_m=10.0).distance_m == 0.0)


def in_terminal(columns, **environment):
    """What `effects dropout` writes to a terminal of that width."""
    from fcntl import ioctl
    from struct import pack
    from termios import TIOCSWINSZ

    main_end, side = pty.openpty()
    ioctl(side, TIOCSWINSZ, pack("HHHH", 40, columns, 0, 0))
    kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "COLUMNS", "LINES")}
    command = [sys.executable, "-m", "lidarcheck", "effects", "dropout", "--set", "share=0.5"]
    process = subprocess.Popen(
        command, stdout=side, stderr=subprocess.DEVNULL, env={**kept, "TERM": "xterm-256color", **environment}
    )
    os.close(side)
    output = b""
    while True:
        try:
            part = os.read(main_end, 65536)
        except OSError:
            break
        if not part:
            break
        output += part
    os.close(main_end)
    assert process.wait() == 0
    return output.decode().replace("\r\n", "\n")


@pytest.mark.parametrize("columns", [60, 150])
def test_in_a_terminal_nothing_is_said_by_colour_alone(columns):
    bare = in_terminal(columns, NO_COLOR="1")
    plot = bare[bare.index("Shown on") : bare.index("In a model")]
    assert "\x1b[3" not in plot
    assert "· without   # with" in plot
    assert max(map(len, plot.splitlines()[3:])) <= min(columns, 80)


def test_in_a_terminal_there_is_colour():
    assert "\x1b[38" in in_terminal(80)


def test_where_the_output_is_ascii_so_is_the_plot():
    ran = subprocess.run(
        [sys.executable, "-m", "lidarcheck", "effects", "dropout"],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert b". without   # with" in ran.stdout
    assert b"\\u" not in ran.stdout
