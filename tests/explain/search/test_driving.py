"""A sensor that drives lengthens ranges in a narrow view nearly as an offset does."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search.motion import driving_ahead
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.search import _or_imitation
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

FINE = {"layers": range(220, 300), "points": range(320, 640, 8)}
GAIN = make("signal_gain", {"gain": 1.5})
DRIVING = make("motion", {"forward_m_s": -20.0})
OFFSET = make("range_offset", {"offset_m": 0.3})


def bench_of(*hidden: Effect) -> SearchData:
    measured = frames(model(*hidden), 4, **FINE)
    simulator, select = Simulator(measured[:2], model(), 3), Simulator(measured[2:], model(), 4)
    return SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))


def offset_and_gain(bench: SearchData) -> Fit:
    probes = [fixed_probes([name])[0] for name in ("range_offset", "signal_gain")]
    return fit(bench.simulator, probes, [one.start() for one in probes], rounds=6)


def test_it_drives_as_fast_as_lengthens_ranges_by_the_offset() -> None:
    bench = bench_of(DRIVING)
    driving = driving_ahead(SimulatorEvidence(bench.simulator), 0.3)
    assert driving is not None
    # The middle of these columns is fired 15 ms after the frame's start.
    assert driving.settings["forward_m_s"] == pytest.approx(-0.3 / 0.015, rel=0.1)
    assert driving.settings["yaw_deg_s"] == 0.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "passes", "names"),
    [
        ((GAIN, DRIVING), True, ("motion", "signal_gain")),
        ((GAIN, DRIVING), False, ("range_offset", "signal_gain")),
        ((GAIN, OFFSET), True, ("range_offset", "signal_gain")),
    ],
    ids=["drives", "no motion was near", "an offset"],
)
def test_it_takes_an_offset_s_place_beside_others_where_it_comes_nearer(
    hidden: tuple[Effect, ...], passes: bool, names: tuple[str, ...]
) -> None:
    bench = bench_of(*hidden)
    now = offset_and_gain(bench)
    probe = fixed_probes(["motion"])[0]
    gain = 500.0 if passes else 0.5
    moved = Fit((probe,), (probe.start(),), 1000.0, np.zeros((1, 3)))
    trial = FittedCandidate("motion", 1, moved, gain, 1.0, 1000.0, 1000.0 - gain)
    found = _or_imitation(bench, now, [trial])
    assert found.names() == names
    if "motion" in names:
        assert found.distance < bench.simulator.floor_distance < now.distance - 250.0
