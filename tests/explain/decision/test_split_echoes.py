"""Echoes that an edge splits speak for a footprint, wherever the edge lies to a part of a beam."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from explain_core_kit import PANEL, at_ranges, frames, model, together
from lidarcheck.effects import make
from lidarcheck.explain.decision.model_check import Open, carries_over
from lidarcheck.explain.decision.split_echoes import only_edges_stay
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.wasserstein import PARTS, Scale
from lidarcheck.scan import IdealScan, Scan

FINE = {"layers": range(230, 290), "points": range(360, 520, 2)}
FOOTPRINT = make("beam_divergence", {"vertical_deg": 0.01, "horizontal_deg": 0.04})
BEFORE = 0.1


def past_the_panel(ideal: IdealScan) -> tuple[np.ndarray, np.ndarray]:
    """The rows of the panel's leftmost column, and the range of the wall there."""
    left = ideal.point[ideal.material_id == PANEL].max()
    at = np.flatnonzero((ideal.material_id == PANEL) & (ideal.point == left))
    beside = {int(a): d for a, p, d in zip(ideal.layer, ideal.point, ideal.distance_m, strict=True) if p == left + 2}
    return at, np.array([beside[int(a)] for a in ideal.layer[at]])


def split(ideal: IdealScan, scan: Scan) -> Scan:
    """The scan, and of the panel's leftmost column the wall besides."""
    at, wall_m = past_the_panel(ideal)
    some = {"width_ns": 4.0, "area": 60.0, "peak": 15.0, "echo_number": 2}
    more = {name: np.full(len(at), value) for name, value in some.items()}
    return together(scan, Scan.from_beams(ideal.layer[at], ideal.point[at], wall_m, **more))


def missed(ideal: IdealScan, scan: Scan) -> Scan:
    """The scan, and in the panel's leftmost column the wall in the panel's place."""
    at, wall_m = past_the_panel(ideal)
    instead = dict(zip(zip(ideal.layer[at].tolist(), ideal.point[at].tolist(), strict=True), wall_m, strict=True))
    pairs = zip(scan.layer.tolist(), scan.point.tolist(), scan.range_m, strict=True)
    return at_ranges(scan, np.array([instead.get((a, p), r) for a, p, r in pairs]))


def seen(change: Callable[[IdealScan, Scan], Scan]) -> Scale:
    """Frames whose scans are changed by hand."""
    found = [dataclasses.replace(f, measured=change(f.ideal, f.measured)) for f in frames(model(), 3, **FINE)]
    return Scale.of(found, model(), 5)


def test_split_echoes_at_one_edge_may_stay() -> None:
    assert only_edges_stay(seen(split), model(FOOTPRINT), BEFORE)


def test_without_a_footprint_there_is_none_to_split_them() -> None:
    assert not only_edges_stay(seen(split), model(make("boresight", {"yaw_deg": 0.1})), BEFORE)


def test_beams_that_look_past_an_edge_are_no_split_echoes() -> None:
    assert not only_edges_stay(seen(missed), model(FOOTPRINT), BEFORE)


def test_what_is_open_elsewhere_may_not_stay() -> None:
    shifted = seen(lambda ideal, scan: at_ranges(split(ideal, scan), split(ideal, scan).range_m + 0.1))
    assert not only_edges_stay(shifted, model(FOOTPRINT), BEFORE)


@pytest.mark.parametrize(
    ("names", "edges", "carries"),
    [
        (("beam_divergence",), True, True),
        (("beam_divergence",), False, False),
        (("beam_divergence", "walk_error"), True, False),
    ],
)
def test_a_footprint_alone_need_not_close_what_is_at_edges(names: tuple[str, ...], edges: bool, carries: bool) -> None:
    parts, noise = np.full(len(PARTS), 0.2), np.random.default_rng(1).normal(0.0, 1e-3, (6, len(PARTS)))
    assert carries_over(Open(parts, 0.95 * parts, noise, noise, edges=edges), names) == carries


@pytest.mark.parametrize(
    ("better", "change", "passes"), [(2.0, 80.0, True), (-25.0, 90.0, True), (-40.0, 90.0, False), (2.0, 120.0, False)]
)
def test_select_frames_of_few_edges_must_only_not_speak_against_a_footprint(
    better: float, change: float, passes: bool
) -> None:
    probe = fixed_probes(["beam_divergence"])[0]
    fitted = Fit((probe,), (probe.start(),), 2000.0, np.zeros((1, 1)))
    along_edges = better, change
    trial = FittedCandidate("beam_divergence", 1, fitted, 318.0, 85.0, 1074.0, 1182.0, 400.0, along_edges)
    assert trial.passes == passes
