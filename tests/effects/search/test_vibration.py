"""Where a vibration starts: its frequency, sizes and phases, read off the ranges of sloping surfaces."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.effects.search import Probe
from lidarcheck.explain.search.starts import located_probes
from lidarcheck.inference.simulator import Simulator

FINE = {"layers": range(230, 280, 2), "points": range(320, 640, 4)}
SWEEP_S = 30e-3
LENGTH_S = SWEEP_S * 316 / 959
"""From the first to the last of the points."""
ROAD = {"layers": range(230, 262)}
"""Layers that see the road, which slopes along elevation."""


def shaken(**settings: float) -> Effect:
    return make("vibration", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.0, **settings})


def starts(effect: Effect, **how: object) -> dict[str, Probe]:
    """The start of each kind, by its name."""
    simulator = Simulator(frames(model(effect), 3, **{**FINE, **how}), model(), 5)
    return {p.variant: p for p in located_probes(simulator, ["vibration"])}


@pytest.mark.long
@pytest.mark.parametrize("frequency_hz", [170.0, 741.0, 2300.0])
def test_the_frequency_is_found_to_a_part_of_what_a_sweep_resolves(frequency_hz: float) -> None:
    found = starts(shaken(yaw_deg=0.06, frequency_hz=frequency_hz, phase_deg=50.0))[""].settings
    assert found["frequency_hz"] == pytest.approx(frequency_hz, abs=0.3 / LENGTH_S)
    assert found["yaw_deg"] == pytest.approx(0.06, rel=0.3)
    middle = 2.0 * np.pi * (found["frequency_hz"] - frequency_hz) * SWEEP_S * (320 + 158) / 959
    off = np.deg2rad(found["phase_deg"] - 50.0) + middle
    assert np.abs(np.angle(np.exp(1j * off))) < np.deg2rad(30.0)


def test_either_axis_has_its_own_size() -> None:
    found = starts(shaken(yaw_deg=0.04, pitch_deg=0.08, frequency_hz=500.0, phase_deg=-70.0), **ROAD)[""].settings
    assert found["pitch_deg"] == pytest.approx(0.08, rel=0.4)
    assert found["yaw_deg"] == pytest.approx(0.04, rel=0.4)
    assert found["yaw_phase_deg"] == 0.0


def test_where_nothing_slopes_along_an_axis_it_begins_as_large_as_the_other() -> None:
    found = starts(shaken(yaw_deg=0.06, frequency_hz=500.0))[""].settings
    assert found["pitch_deg"] == found["yaw_deg"]


def test_axes_that_swing_against_each_other_have_phases_of_their_own() -> None:
    effect = shaken(yaw_deg=0.08, pitch_deg=0.08, frequency_hz=500.0, phase_deg=20.0, yaw_phase_deg=150.0)
    found = starts(effect, **ROAD)[""].settings
    assert found["yaw_phase_deg"] == pytest.approx(150.0, abs=25.0)


def test_frames_with_phases_of_their_own_agree_on_the_frequency() -> None:
    effect = shaken(yaw_deg=0.08, pitch_deg=0.03, frequency_hz=620.0, new_phase=1)
    found = starts(effect)
    assert found["free phase"].settings["frequency_hz"] == pytest.approx(620.0, abs=0.3 / LENGTH_S)
    assert found["free phase"].settings["yaw_deg"] == pytest.approx(0.08, rel=0.4)
    assert found[""].settings["yaw_deg"] < 0.7 * found["free phase"].settings["yaw_deg"]


def test_a_step_of_the_frequency_shifts_the_end_of_the_sweep_by_a_part_of_a_cycle() -> None:
    probe = starts(shaken(yaw_deg=0.06, frequency_hz=741.0))[""]
    free = {one.name: one.step for one in probe.free}
    assert free["frequency_hz"] * probe.settings["frequency_hz"] * LENGTH_S < 0.1


def test_too_few_columns_say_nothing_of_a_rhythm() -> None:
    assert starts(shaken(yaw_deg=0.06, frequency_hz=200.0), points=range(320, 640, 32)) == {}
