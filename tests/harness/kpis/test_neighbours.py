"""Kinds of KPI of neighbouring beams, on frames made by hand."""

import numpy as np
import pytest

from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.selection import KpiInput, KpiSelection, SelectedEchoes
from lidarcheck.sensor import Sensor

LAYERS, POINTS = 3, 6
BEAMS = Sensor.of("SLIM").beams


def seen(found: np.ndarray, residual_m: np.ndarray | None = None, area: np.ndarray | None = None) -> KpiInput:
    """What is seen where beams have echoes: `found` (frames, layers, points), the others' shape alike."""
    frames = len(found)
    layer, point = (column.ravel().astype(np.int32) for column in np.mgrid[:LAYERS, :POINTS])
    n = len(layer)
    fired = FiredBeams(layer, point, np.arange(n), np.full(n, 20.0), np.zeros(n), np.zeros((n, 3)), BEAMS)
    frame, beam = np.nonzero(found.reshape(frames, n))
    columns = {name: np.zeros(len(beam)) for name in SelectedEchoes.__dataclass_fields__}
    columns |= {
        "features": {},
        "histograms": None,
        "beam": beam,
        "frame": frame,
        "surface": beam,
        "range_m": np.full(len(beam), 20.0),
    }
    if residual_m is not None:
        columns["residual_m"] = residual_m.reshape(frames, n)[frame, beam]
    if area is not None:
        columns["area"] = area.reshape(frames, n)[frame, beam]
    selection = KpiSelection(fired, np.ones(n, dtype=bool), 0.749)
    return KpiInput(selection, SelectedEchoes(**columns), frames)


def value(kind: str, of: KpiInput) -> float:
    return KINDS[kind].value(of)


def test_runs_of_lost_beams_are_counted_along_points_and_along_layers() -> None:
    found = np.ones((2, LAYERS, POINTS), dtype=bool)
    found[0, 0, 1:4] = False  # three in a row of points, each alone in its column
    found[1, :, 5] = False  # a column of three, each alone in its layer
    assert value("lost_run_points", seen(found)) == pytest.approx(6 / 4)
    assert value("lost_run_layers", seen(found)) == pytest.approx(6 / 4)


def test_without_a_lost_beam_there_is_no_run() -> None:
    assert np.isnan(value("lost_run_points", seen(np.ones((1, LAYERS, POINTS), dtype=bool))))


def test_steps_are_those_of_the_columns_means_within_a_frame() -> None:
    found = np.ones((2, LAYERS, POINTS), dtype=bool)
    found[:, :, 3] = False  # no step across a column that is not there
    residual = np.zeros((2, LAYERS, POINTS))
    residual[0] += [0.0, 0.1, 0.1, 9.0, 0.3, 0.5]
    residual[1] += 0.2  # another frame is no neighbour
    assert value("range_residual_point_step", seen(found, residual)) == pytest.approx(np.sqrt((0.01 + 0.04) / 6))
    assert value("area_point_step", seen(found, area=100.0 * residual)) == pytest.approx(np.sqrt(500.0 / 6))
    alone = np.zeros((1, LAYERS, POINTS), dtype=bool)
    alone[0, :, 2] = True
    assert np.isnan(value("range_residual_point_step", seen(alone)))
