"""Names that say nothing are left out: effects of no strength, and such as do not pay on the select frames."""

from dataclasses import replace

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.decision.idle import idle_names, needless_on_select, weak_names, without_idle
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}
OFFSET = make("range_offset", {"offset_m": 0.12})


@pytest.fixture(scope="module")
def bench() -> SearchData:
    measured = frames(model(OFFSET), 4, **FINE)
    simulator, select = Simulator(measured[:2], model(), 3), Simulator(measured[2:], model(), 4)
    return SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))


def last_fit(bench: SearchData, *strengths: tuple[str, dict[str, float]]) -> Polished:
    """Effects where a fit has ended, in the lab around their model."""
    probes = [replace(fixed_probes([name])[0], settings=settings) for name, settings in strengths]
    x = [probe.start() for probe in probes]
    there = fit(bench.simulator, probes, x, rounds=0)
    simulator = Simulator(bench.simulator.frames, there.model(model()), 7)
    return Polished(there, simulator, fit(simulator, probes, x, rounds=0), {})


def test_a_footprint_of_no_width_gets_no_name(bench: SearchData) -> None:
    """1e-7 degrees: it moves no echo, and would widen the interval of whatever is beside it."""
    nothing = {"vertical_deg": 1e-7, "horizontal_deg": 1e-7}
    last = last_fit(bench, ("range_offset", {"offset_m": 0.12}), ("beam_divergence", nothing))
    assert weak_names(bench, last) == [1]
    assert idle_names(bench, last.fit, last)[1] == "it is too weak to be told from no effect"


def test_what_has_a_strength_keeps_its_name(bench: SearchData) -> None:
    wide = {"vertical_deg": 0.15, "horizontal_deg": 0.3}
    assert weak_names(bench, last_fit(bench, ("range_offset", {"offset_m": 0.12}), ("beam_divergence", wide))) == []


def test_a_second_name_must_pay_on_the_select_frames(bench: SearchData) -> None:
    """Frames of the fit that are darker by half, as the select frames are not: a gain explains these alone."""
    dim = frames(model(OFFSET, make("signal_gain", {"gain": 0.5})), 2, **FINE)
    simulator = Simulator(dim, model(), 3)
    given = replace(bench, simulator=simulator, start=simulator.distance(np.zeros((1, len(simulator.measured)))))
    both = _fitted(simulator, "range_offset", "signal_gain")
    assert needless_on_select(given, both) == [1]
    assert without_idle(given, both, [1]).names() == ("range_offset",)


def test_a_second_name_that_pays_stays() -> None:
    dim = frames(model(OFFSET, make("signal_gain", {"gain": 0.5})), 4, **FINE)
    simulator, select = Simulator(dim[:2], model(), 3), Simulator(dim[2:], model(), 4)
    given = SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))
    assert needless_on_select(given, _fitted(simulator, "range_offset", "signal_gain")) == []


def _fitted(simulator: Simulator, *names: str) -> Fit:
    probes = [fixed_probes([name])[0] for name in names]
    return fit(simulator, probes, [probe.start() for probe in probes], rounds=4)
