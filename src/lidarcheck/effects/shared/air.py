"""What the air along the beams scatters back: one profile over range, ended by what each beam meets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.geometry.beam_rows import BeamRows
from lidarcheck.effects.geometry.own_rays import shares_that_end
from lidarcheck.scan import Haze, IdealScan, Light

__all__ = ["STEP_M", "ends_of", "with_haze"]

STEP_M = 0.05
"""Cells of a profile: a third of the range that a bin of 1 ns spans, a fifteenth of a 5 ns pulse."""


def ends_of(rows: BeamRows, ideal: IdealScan, nothing_m: float) -> FloatArray:
    """How far each row's beam goes through the air, `nothing_m` where it meets nothing; shape (n_rows,)."""
    distance_m = rows.of_each(ideal.distance_m)
    return np.where(distance_m > 0.0, distance_m, nothing_m)


def with_haze(light: Light, ideal: IdealScan, density_per_m: FloatArray) -> Light:
    """The light and further backscatter: S per metre of the cells [i, i + 1) `STEP_M`, shape (m,).

    Where there is a profile already the two add up, and what dimmed the earlier one since (a layer's gain, a dirty
    window) dims both: it lies between the air and the SPADs.
    """
    if len(density_per_m) == 0:
        return light
    rows = BeamRows.of(light, ideal, shares_that_end(ideal))
    share, earlier = rows.share, light.haze
    if earlier is not None:
        before_per_m = _in_cells(earlier)
        both = np.zeros(max(len(density_per_m), len(before_per_m)))
        both[: len(density_per_m)] += density_per_m
        both[: len(before_per_m)] += before_per_m
        density_per_m, share = both, earlier.row_share
    end_m = ends_of(rows, ideal, len(density_per_m) * STEP_M)
    return replace(light, haze=Haze(STEP_M, density_per_m, rows.first, end_m, share))


def _in_cells(haze: Haze) -> FloatArray:
    """The profile in cells of `STEP_M`, with the same light in all."""
    if haze.step_m == STEP_M:
        return haze.density_per_m
    edge_m = np.arange(len(haze.density_per_m) + 1) * haze.step_m
    up_to = np.concatenate([[0.0], np.cumsum(haze.density_per_m)]) * haze.step_m
    cells = int(np.ceil(edge_m[-1] / STEP_M))
    return np.asarray(np.diff(np.interp(np.arange(cells + 1) * STEP_M, edge_m, up_to)) / STEP_M)
