"""Blooming: light of a bright target on the beams beside it, over the offset from the target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.lattice import lattice_of
from lidarcheck.kpi.pairing import nearest_on_line
from lidarcheck.sensor import Beams, Sensor, SpadArray

__all__ = ["Axis", "BloomingProfile", "blooming_profile", "offset_step", "target_offset"]

Axis = Literal["vertical", "horizontal"]

_STEP = {"vertical": 3.0, "horizontal": 2.5}


def offset_step(axis: Axis, sensor: Sensor | None = None) -> float:
    """Per layer (`vertical`) or point, in the units in which blooming tables count offsets.

    Of a SPAD array, SPAD rows and columns of 0.05°; of any other sensor layers and points. None: a SPAD array.
    """
    return _STEP[axis] if sensor is None or isinstance(sensor, SpadArray) else 1.0


@dataclass(frozen=True)
class BloomingProfile:
    """Mean AREA, or what else tells an echo's strength, over the offset from the target, measured and simulated.

    Shapes: (k,). `offset`: the distinct offsets (or the lower edges of the bins); the means are NaN where there is no
    echo. `rms_log10`: RMS of log10(measured/simulated) over the offsets that have echoes on both sides, NaN where
    none has; `measured_only`, `simulated_only`: offsets that have echoes on one side alone and so cannot enter it.
    """

    offset: FloatArray
    measured_area: FloatArray
    simulated_area: FloatArray
    n_measured: IndexArray
    n_simulated: IndexArray
    rms_log10: float
    measured_only: int
    simulated_only: int


def blooming_profile(
    measured_offset: npt.ArrayLike,
    measured_area: npt.ArrayLike,
    simulated_offset: npt.ArrayLike,
    simulated_area: npt.ArrayLike,
    *,
    edges: npt.ArrayLike | None = None,
) -> BloomingProfile:
    """RMS of log10(measured/simulated) mean AREA over the offset from the target.

    Offsets and areas of the echoes at the target's range, shapes (n,) and (m,); offsets as `target_offset` counts them
    times `offset_step`, NaN = leave out. `edges`: ascending bin edges over the offset, shape (k + 1,); default: each
    offset that occurs is its own bin. 0.3 is a factor of two.
    """
    m_off, m_area = _echoes(measured_offset, measured_area)
    s_off, s_area = _echoes(simulated_offset, simulated_area)
    if edges is None:
        start = np.unique(np.concatenate([m_off, s_off]))
        stop = np.inf
    else:
        borders = np.asarray(edges, dtype=np.float64)
        start, stop = borders[:-1], float(borders[-1])
    m_n, m_mean = _profile(m_off, m_area, start, stop)
    s_n, s_mean = _profile(s_off, s_area, start, stop)
    both = (m_mean > 0.0) & (s_mean > 0.0)
    log_ratio = elementary.log10(m_mean[both] / s_mean[both])
    rms = float(np.sqrt(np.mean(log_ratio**2))) if log_ratio.size else float("nan")
    only_m, only_s = int(np.sum((m_n > 0) & (s_n == 0))), int(np.sum((s_n > 0) & (m_n == 0)))
    return BloomingProfile(start, m_mean, s_mean, m_n, s_n, rms, only_m, only_s)


def target_offset(
    layer: IntArray, point: IntArray, target_layer: IntArray, target_point: IntArray, axis: Axis, beams: Beams
) -> tuple[FloatArray, IndexArray]:
    """Signed offset of beams from the target's nearest beam along an axis, and the index of that; NaN and -1 for none.

    Vertical: within the target's columns of the image, in layers, positive upward. Horizontal: within its layers, in
    points, positive to the left. 0 on the target. None of beams without a lattice. Beams have shapes (n,), the target's
    (m,).
    """
    lattice = lattice_of(beams)
    if lattice is None or not len(target_layer):
        return np.full(len(layer), np.nan), np.full(len(layer), -1, dtype=np.int64)
    if axis == "vertical":
        line, place = lattice.column(layer, point), lattice.row(layer)
        t_line, t_place = lattice.column(target_layer, target_point), lattice.row(target_layer)
    else:
        line, place, t_line, t_place = layer, point, target_layer, target_point
    order = np.lexsort((t_place, t_line))
    found = nearest_on_line(
        t_line[order].astype(np.int64),
        t_place[order].astype(np.float64),
        line.astype(np.int64),
        place.astype(np.float64),
    )
    index = np.where(found >= 0, order[found], -1)
    to = 1.0 if axis == "vertical" else float(lattice.to_left)
    return np.where(index >= 0, (place - t_place[index]) * to, np.nan), index


def _echoes(offset: npt.ArrayLike, area: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    where, amplitude = np.asarray(offset, dtype=np.float64), np.asarray(area, dtype=np.float64)
    if where.shape != amplitude.shape:
        raise UsageError(f"{where.size} offsets and {amplitude.size} areas", fix="give one of each an echo")
    usable = np.isfinite(where) & np.isfinite(amplitude)
    return where[usable], amplitude[usable]


def _profile(offset: FloatArray, area: FloatArray, start: FloatArray, stop: float) -> tuple[IndexArray, FloatArray]:
    """Number of echoes and mean AREA in each bin that begins at `start`."""
    where = np.searchsorted(start, offset, "right") - 1
    inside = (where >= 0) & (offset < stop)
    n = np.bincount(where[inside], minlength=start.size).astype(np.int64)
    total = np.bincount(where[inside], weights=area[inside], minlength=start.size)
    return n, np.where(n > 0, total / np.maximum(n, 1), np.nan)
