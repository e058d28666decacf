"""Kinds of KPI of how beams resemble their neighbours: what comes in blocks or in waves, which no mean shows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.harness.kpis.base import KpiKind, share
from lidarcheck.harness.kpis.selection import KpiInput

__all__ = ["NEIGHBOUR_KINDS"]

_BELOW, _BEFORE = 1, 3
"""Columns of `FiredBeams.around`: the neighbour one layer below, and the one a point before."""
_FRAME = 1 << 32


def _lost_run(seen: KpiInput, neighbour: int) -> float:
    """How many neighbours in a row have no echo on their surface, on average; NaN where none is lost."""
    fired, meeting = seen.selection.fired, seen.selection.meeting
    lost = runs = 0
    for frame in range(seen.frames):
        missing = np.append(meeting, False)  # the last stands for the neighbour that is not there
        missing[seen.echoes.beam[seen.on[seen.echoes.frame[seen.on] == frame]]] = False
        lost += int(np.count_nonzero(missing))
        runs += int(np.count_nonzero(missing[:-1] & ~missing[fired.around[:, neighbour]]))
    return share(lost, runs)


def _point_step(seen: KpiInput, values: FloatArray) -> float:
    """Root mean square step of the columns' means between neighbouring points of a frame; NaN without such a pair."""
    column, index = np.unique(seen.echoes.frame[seen.on] * _FRAME + seen.point(seen.on), return_inverse=True)
    means = np.bincount(index, weights=values) / np.bincount(index)
    steps = np.diff(means)[np.diff(column) == 1]
    return float(np.sqrt(np.mean(steps**2))) if len(steps) else float("nan")


NEIGHBOUR_KINDS: Mapping[str, KpiKind] = {
    "lost_run_points": KpiKind(
        "mean number of neighbouring points in a row without an echo on their surface",
        "points",
        value=lambda seen: _lost_run(seen, _BEFORE),
    ),
    "lost_run_layers": KpiKind(
        "mean number of neighbouring layers in a row without an echo on their surface",
        "layers",
        value=lambda seen: _lost_run(seen, _BELOW),
    ),
    "range_residual_point_step": KpiKind(
        "root mean square step of the range residual between neighbouring point columns: slow against quick shaking",
        "m",
        value=lambda seen: _point_step(seen, seen.residual_m),
    ),
    "area_point_step": KpiKind(
        "root mean square step of AREA between neighbouring point columns: what is patchy, and how finely",
        "counts",
        value=lambda seen: _point_step(seen, seen.area),
    ),
}
"""How beams resemble their neighbours."""
