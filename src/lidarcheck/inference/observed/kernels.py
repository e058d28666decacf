"""The sums that explaining takes most often, compiled: beams' statistics, sums over bins, areas between samples.

A search takes thousands of them. Each stands alone, as numba renews a cached kernel only with its own file.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.jit import kernel

__all__ = ["add_up", "areas_between", "write_nearest", "write_residuals", "write_scatter"]


@kernel
def add_up(labels: npt.NDArray[np.int32], values: FloatArray, columns: IndexArray, total: FloatArray) -> None:
    """Add the chosen columns of `values` (n, k) to the rows of `total` (bins, columns) that each row of `labels`
    (divisions, n) says; -1 takes no part."""
    for d in range(labels.shape[0]):
        for i in range(labels.shape[1]):
            place = labels[d, i]
            if place >= 0:
                for j in range(len(columns)):
                    total[place, j] += values[i, columns[j]]


@kernel
def write_nearest(beam: IndexArray, apart: FloatArray, reach: FloatArray, nearest: IndexArray) -> None:
    """The echo of each beam that lies least apart from its surfaces, no farther than the beam's reach, into `nearest`
    (n_beams,), which is -1 before and where there is none. `beam`, `apart` (m,): of each echo."""
    for i in range(len(beam)):
        at = beam[i]
        if apart[i] <= reach[at] and (nearest[at] < 0 or apart[i] < apart[nearest[at]]):
            nearest[at] = i


@kernel
def write_residuals(
    valid: BoolArray, feature: FloatArray, mean: FloatArray, spread: FloatArray, clip: float, value: FloatArray
) -> None:
    """The features' residuals in standard deviations, at most `clip`, into the first columns of `value`; 0 where they
    are not valid. All of shape (n, 4) or (n,)."""
    for i in range(len(valid)):
        for j in range(feature.shape[1]):
            off = (feature[i, j] - mean[i, j]) / spread[i, j]
            value[i, j] = min(max(off, -clip), clip) if valid[i] else 0.0


@kernel
def write_scatter(
    valid: BoolArray,
    mine: IndexArray,
    other: IndexArray,
    feature: int,
    column: int,
    mean: float,
    spread: float,
    clip: float,
    value: FloatArray,
    weight: FloatArray,
) -> None:
    """Half the squared difference of neighbours' residuals, at most `clip`, standardised, into a column of `value`, and
    1 into that of `weight` where both are valid."""
    for k in range(len(mine)):
        i = mine[k]
        if valid[i] and valid[other[k]]:
            apart = value[i, feature] - value[other[k], feature]
            value[i, column] = (min(0.5 * apart * apart, clip) - mean) / spread
            weight[i, column] = 1.0


@kernel
def areas_between(
    value: FloatArray,
    beam: IndexArray,
    first: BoolArray,
    stratum: IndexArray,
    weight: FloatArray,
    scratch: FloatArray,
) -> None:
    """The 1-Wasserstein distances between two weighted samples in each bin: the area between distribution functions.

    `value` (m,) ascends; `beam` says whose it is, `first` of which sample. `stratum`, `weight` (n_beams,): each beam's
    bin, -1 for none, and how often it counts. `scratch` (5, bins) takes the first sample's weight in each bin in its
    row 0 and the areas, 0 where one sample is not there, in row 4.
    """
    scratch[:] = 0.0
    for i in range(len(value)):
        place = stratum[beam[i]]
        if place >= 0:
            scratch[0 if first[i] else 1, place] += weight[beam[i]]
    for i in range(len(value)):
        place = stratum[beam[i]]
        if place < 0 or scratch[0, place] <= 0.0 or scratch[1, place] <= 0.0:
            continue
        scratch[4, place] += abs(scratch[2, place]) * (value[i] - scratch[3, place])
        scratch[3, place] = value[i]
        if first[i]:
            scratch[2, place] += weight[beam[i]] / scratch[0, place]
        else:
            scratch[2, place] -= weight[beam[i]] / scratch[1, place]
