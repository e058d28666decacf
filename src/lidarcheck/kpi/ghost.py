"""Ghosts: a retro-reflector that appears again on the same beams at twice its range, fainter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.kpi.overlap import positions
from lidarcheck.kpi.pairing import beam_keys, nearest_on_line, paths
from lidarcheck.kpi.validation import mean
from lidarcheck.scan import Scan

__all__ = ["GHOST_RATIO", "GHOST_WITHIN_M", "Ghost", "ghost", "ghost_partners"]

GHOST_RATIO = 2.0
GHOST_WITHIN_M = 0.5
"""How far a ghost may lie from twice its target's range, of a pulse of 5 ns."""


@dataclass(frozen=True)
class Ghost:
    """A ghost beside its target.

    `targets`, `ghosts`: numbers of echoes; `count_ratio`, `area_ratio`, `peak_ratio`: ghost over target, of the
    counts, of the mean AREA (or of what else tells an echo's strength) and of the mean PEAK; `range_ratio`: median,
    over the ghost's echoes, of their range over that of the target on the same beam; `size_ratio`: of the RMS distances
    [m] from the own centroid, for which one echo is not enough. NaN where it is undefined; without a ghost the count
    ratio is 0 and the others are NaN.
    """

    targets: int
    ghosts: int
    count_ratio: float
    area_ratio: float
    peak_ratio: float
    range_ratio: float
    size_ratio: float


def ghost(
    target_xyz_m: npt.ArrayLike,
    target_area: npt.ArrayLike,
    target_peak: npt.ArrayLike,
    ghost_xyz_m: npt.ArrayLike,
    ghost_area: npt.ArrayLike,
    ghost_peak: npt.ArrayLike,
    partner: npt.ArrayLike | None = None,
    *,
    paths_m: tuple[FloatArray, FloatArray] | None = None,
) -> Ghost:
    """Ratios of a ghost's echoes to its target's.

    Positions in the sensor frame, shapes (n, 3) and (m, 3); areas and peaks (n,) and (m,). `partner`: for each of the
    ghost's echoes the index of the target's echo on its beam, shape (m,); without it the range ratio is that of the
    median ranges. `paths_m`: the target's and the ghost's ways from their beams' origins, where beams do not begin at
    0. A ghost sensor – sign – own car – sign – sensor lies on the target's beams at twice the range and is twice the
    size.
    """
    t_xyz, g_xyz = positions(target_xyz_m), positions(ghost_xyz_m)
    return Ghost(
        targets=len(t_xyz),
        ghosts=len(g_xyz),
        count_ratio=_ratio(float(len(g_xyz)), float(len(t_xyz))),
        area_ratio=_ratio(mean(ghost_area), mean(target_area)),
        peak_ratio=_ratio(mean(ghost_peak), mean(target_peak)),
        range_ratio=_range_ratio(*_ways(t_xyz, g_xyz, paths_m), partner),
        size_ratio=_ratio(_size(g_xyz), _size(t_xyz)),
    )


def ghost_partners(scan: Scan, target: BoolArray, *, tolerance_m: float = GHOST_WITHIN_M) -> IndexArray:
    """For each echo the row of the target's echo on its beam at half its range, -1 where it is no ghost; shape (n,).

    `target`: mask of the target's echoes, shape (n,). The tolerance is on the ghost's range: ghosts of signs were
    measured at 2R + 0.15 … 0.33 m. An echo of the target itself is never a ghost.
    """
    partner = np.full(len(scan), -1, dtype=np.int64)
    keys, range_m = beam_keys(scan.layer, scan.point), paths(scan)
    rows, others = np.flatnonzero(target), np.flatnonzero(~np.asarray(target, dtype=np.bool_))
    order = rows[np.lexsort((range_m[rows], keys[rows]))]
    _, line = np.unique(keys, return_inverse=True)
    near = nearest_on_line(line[order], GHOST_RATIO * range_m[order], line[others], range_m[others])
    some = near >= 0
    candidate = order[near[some]]
    close = np.abs(range_m[others[some]] - GHOST_RATIO * range_m[candidate]) <= tolerance_m
    partner[others[some][close]] = candidate[close]
    return partner


def _ways(
    target_m: FloatArray, ghost_m: FloatArray, paths_m: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    return (np.linalg.norm(target_m, axis=1), np.linalg.norm(ghost_m, axis=1)) if paths_m is None else paths_m


def _range_ratio(near: FloatArray, far: FloatArray, partner: npt.ArrayLike | None) -> float:
    if not len(far) or not len(near):
        return float("nan")
    if partner is None:
        return _ratio(float(np.median(far)), float(np.median(near)))
    return float(np.median(far / near[np.asarray(partner, dtype=np.int64)]))


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0.0 else float("nan")


def _size(xyz_m: FloatArray) -> float:
    if len(xyz_m) < 2:
        return float("nan")
    return float(np.sqrt(np.mean(np.sum((xyz_m - xyz_m.mean(axis=0)) ** 2, axis=1))))
