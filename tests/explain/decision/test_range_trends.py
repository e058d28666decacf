"""Errors of range: what stays of the ranges must not follow a quantity of the beams."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain.decision.model_check import Open, carries_over
from lidarcheck.explain.decision.range_trends import ranges_follow, ranges_off
from lidarcheck.explain.search.refine import Judged, judged
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import PARTS, Scale

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}
TRUE = {
    "range_offset": make("range_offset", {"offset_m": 0.08}),
    "range_scale": make("range_scale", {"fraction": 0.004}),
    "walk_error": make("walk_error", {"per_decade_m": 0.15}),
}


def named(true: Effect, name: str) -> Judged:
    """The fit of one effect to what a sensor with another one, or the same, measured."""
    measured, probe = frames(model(true), 3, **FINE), fixed_probes([name])[0]
    found = fit(Simulator(measured, model(), 3), [probe], [probe.start()], rounds=4)
    return judged(Scale.of(measured, model(), 5), model(), found, 7)


@pytest.mark.long
@pytest.mark.parametrize("name", TRUE)
def test_the_true_name_leaves_nothing_that_follows(name: str) -> None:
    own = named(TRUE[name], name)
    assert ranges_off(own.simulator, own.last) < 1.4
    assert not ranges_follow(own.simulator, own.last)


@pytest.mark.long
@pytest.mark.parametrize(("true", "name"), [("walk_error", "range_scale"), ("range_scale", "range_offset")])
def test_a_wrong_name_does(true: str, name: str) -> None:
    own = named(TRUE[true], name)
    assert ranges_follow(own.simulator, own.last)


def test_beside_other_effects_it_is_not_asked() -> None:
    own = named(TRUE["walk_error"], "signal_gain")
    assert ranges_off(own.simulator, own.last) > 1.6
    assert not ranges_follow(own.simulator, own.last)


@pytest.mark.parametrize(
    ("names", "left", "following", "carries"),
    [
        (("range_scale",), 0.09, False, True),
        (("range_scale",), 0.09, True, False),
        (("walk_error",), 0.09, True, False),
        (("walk_error",), 0.06, False, True),
        (("range_offset",), 0.03, True, True),
    ],
)
def test_then_no_more_than_a_little_may_stay(
    names: tuple[str, ...], left: float, following: bool, carries: bool
) -> None:
    """Of a range error of one standard deviation of a beam."""
    before, after = (np.where([part == "range" for part in PARTS], x, 0.0) for x in (1.0, left))
    noise = np.random.default_rng(1).normal(0.0, 1e-4, (6, len(PARTS)))
    assert carries_over(Open(before, after, noise, noise, following=following), names) == carries
