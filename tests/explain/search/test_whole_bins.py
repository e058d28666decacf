"""Numbers that act in whole bins are fitted bin by bin."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.whole_bins import at_whole_steps
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

BRIGHT = {"layers": range(254, 284), "points": range(520, 600, 2), "sign": True}


def fitted(simulator: Simulator, name: str, variant: str, x: list[float]) -> Fit:
    """An effect where a fit has left it."""
    probe = next(one for one in fixed_probes([name]) if one.variant == variant)
    return fit(simulator, [probe], [np.array(x)], rounds=0)


@pytest.fixture(scope="module")
def varying() -> Simulator:
    return Simulator(frames(model(make("dead_time", {"shift_ns": 2.0, "spread_ns": 3.0})), 2, **BRIGHT), model(), 3)


@pytest.mark.long
@pytest.mark.parametrize("shift_ns", [0.3, 1.4, 2.6, 3.4])
def test_the_dead_time_comes_as_near_as_the_truth_from_a_wrong_bin(varying: Simulator, shift_ns: float) -> None:
    """A bin more or less with another spread is nearly the same here."""
    now, true = (fitted(varying, "dead_time", "varying", x) for x in ([shift_ns, 4.0], [2.0, 6.0]))
    found = at_whole_steps(varying, now)
    assert found.distance < true.distance + 60.0
    assert found.distance < now.distance
    assert float(found.effects()[0].settings()["shift_ns"]).is_integer()
    assert found.probes == now.probes
    assert varying.distance(varying.shows(found.model(model()))) == pytest.approx(found.distance)


def test_the_threshold_is_found_from_one_that_is_off() -> None:
    simulator = Simulator(frames(model(make("threshold", {"shift": 3})), 2, **BRIGHT), model(), 3)
    found = at_whole_steps(simulator, fitted(simulator, "threshold", "", [0.6]))
    assert found.effects()[0].settings()["shift"] == 3


@pytest.mark.long
def test_a_step_that_no_sensor_can_take_is_left_alone(varying: Simulator) -> None:
    """The dead time is never shorter than the ON time, 3 ns below."""
    now = fitted(varying, "dead_time", "varying", [-3.0, 4.0])
    assert np.isfinite(at_whole_steps(varying, now).distance)


def test_other_effects_stay_as_they_are(varying: Simulator) -> None:
    now = fitted(varying, "range_offset", "", [4.0])
    assert at_whole_steps(varying, now) is now
