"""Beams that are lost in blocks: how large these are, and how many of them other frames lose."""

from dataclasses import replace

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.decision.closure import _as_struck as as_struck
from lidarcheck.explain.decision.closure import intervals
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.simulator import Simulator

WINDOW = {"layers": range(200, 250), "points": range(400, 520)}
BLOCKS = 2 * 50 * 120
"""Beams of two frames; in so many parts of a block's size they fall apart."""


def lab_of(share: float, points: int, layers: int, *others: object) -> Simulator:
    """Two frames with losses, and a model without."""
    lost = make("dropout", {"share": share, "block_points": points, "block_layers": layers})
    return Simulator(frames(model(lost, *others), 2, **WINDOW), model(), 5)  # type: ignore[arg-type]


def starts_of(simulator: Simulator) -> list[Probe]:
    """Where a search begins, as read off the data."""
    starts = search_spec("dropout").starts
    assert starts is not None
    return starts(SimulatorEvidence(simulator))


def share_spread(simulator: Simulator, now: Fit) -> float:
    """By what part of itself the share of a fit is off by chance."""
    chance = search_spec("dropout").chance_errors
    assert chance is not None
    return chance(SimulatorEvidence(simulator), now.probes[0], now.effects()[0])["share"]


def fit_of(share: float, points: int, layers: int) -> Fit:
    """A fit of such losses."""
    probe = Probe(
        "dropout",
        {"share": share},
        search_spec("dropout").free,
        {"block_points": points, "block_layers": layers},
        "blocks",
    )
    return Fit((probe,), (probe.start(),), 0.0, np.zeros((1, 1)))


@pytest.mark.long
@pytest.mark.parametrize(("points", "layers"), [(4, 2), (8, 8), (1, 6), (1, 12), (3, 5), (16, 1)])
def test_the_size_of_lost_blocks_is_read_off_the_data(points: int, layers: int) -> None:
    [found] = starts_of(lab_of(0.08, points, layers))
    assert found.fixed == {"block_points": points, "block_layers": layers}
    chance = np.sqrt(0.08 / (BLOCKS / (points * layers)))
    assert found.settings["share"] == pytest.approx(0.08, abs=3.0 * chance)


def test_beams_that_other_causes_lose_and_lines_along_edges_leave_the_size_as_it_is() -> None:
    others = make("dark_counts", {"rate_per_ns": 1e-3}), make("boresight", {"yaw_deg": 0.125, "pitch_deg": 0.0})
    [found] = starts_of(lab_of(0.05, 4, 8, *others))
    assert found.fixed == {"block_points": 4, "block_layers": 8}
    assert found.settings["share"] == pytest.approx(0.05, abs=0.03)


@pytest.mark.long
@pytest.mark.parametrize("others", [(), (make("dark_counts", {"rate_per_ns": 1e-3}),)])
def test_beams_that_are_lost_one_by_one_make_no_blocks(others: tuple[object, ...]) -> None:
    assert not starts_of(lab_of(0.08, 1, 1, *others))
    assert not starts_of(lab_of(0.0, 1, 1, *others))


def test_where_all_is_lost_no_size_is_read_off() -> None:
    assert not starts_of(lab_of(1.0, 4, 8))


def test_other_frames_lose_as_many_blocks_as_they_do() -> None:
    simulator = lab_of(0.03, 8, 8)
    [read] = starts_of(simulator)
    struck = as_struck(simulator, fit_of(0.08, 8, 8))
    assert struck.effects()[0].settings()["share"] == pytest.approx(read.settings["share"], rel=0.02)
    far = fit_of(0.5, 8, 8)
    assert as_struck(simulator, far) == far, "chance does not make nine tenths of the blocks come back"


def test_single_beams_are_so_many_that_their_share_is_known() -> None:
    simulator = lab_of(0.03, 8, 8)
    single = fit_of(0.08, 1, 1)
    assert as_struck(simulator, single) == single
    fog = Probe("fog", {"mor_m": 100.0}, search_spec("fog").free)
    other = replace(single, probes=(fog,), x=(fog.start(),))
    assert as_struck(simulator, other) == other


def test_of_few_blocks_the_share_is_known_as_well_as_their_number() -> None:
    simulator = lab_of(0.08, 8, 8)
    found = fit_of(0.08, 8, 8)
    lost = 0.08 * len(
        {(k, layer // 8, point // 8) for k in range(2) for layer in range(200, 250) for point in range(400, 520)}
    )
    spread = share_spread(simulator, found)
    assert spread == pytest.approx(np.sqrt(2.0 / lost), rel=0.02)
    assert share_spread(simulator, fit_of(0.08, 1, 1)) == 0.0
    fits = [fit_of(0.08, 8, 8), fit_of(0.08, 1, 1)]
    shown = [replace(one, shown=simulator.shows(one.model(simulator.model))) for one in fits]
    [blocks], [single] = (intervals(simulator, one, 1.5) for one in shown)
    assert blocks["share"].high / 0.08 > np.exp(1.645 * spread)
    assert single["share"].high < blocks["share"].high
