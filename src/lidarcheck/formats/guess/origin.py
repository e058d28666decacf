"""Where beams start: forward along the column and up, by how a ring's elevation changes with the range."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray

__all__ = ["fitted_origin", "sharpest_origin"]

_ROUNDS = 8
_BETTER = 0.5
"""An origin is said where it takes the rings' spread down to this part."""
_LEAST_M = 0.002
_FARTHEST_M = 1.0
_SOUGHT_M = (np.arange(0.0, 0.061, 0.01), np.arange(-0.2, 0.201, 0.004))
"""Forward and up: where the beams of heads that are sold start."""
_LOOKED_AT = 20_000
_BIN_DEG = 0.05


def fitted_origin(level_m: FloatArray, z_m: FloatArray, ring: IntArray, rings: int) -> tuple[float, float]:
    """How far beams start forward and up [m], of rows' distance from the axis and height, shape (n,); (0, 0) for none.

    On a ring z - up = tan(elevation) (level - forward), whatever the range.
    """
    forward = up = 0.0
    slope = _slopes(level_m, z_m, ring, rings)
    before = _spread(level_m, z_m, slope, ring)
    for _ in range(_ROUNDS):
        tan = slope[ring]
        off = (z_m - up - tan * (level_m - forward)) / level_m
        near = np.abs(off) <= 5.0 * np.median(np.abs(off)) + 1e-9
        # z = tan level + (up - forward tan); the slope of every ring is fitted with the two, by its own mean.
        a = np.stack([np.ones(len(tan)), -tan], axis=-1) / level_m[:, None]
        b = (z_m - tan * level_m) / level_m
        a, b = (_less_mean(values[near], ring[near], rings) for values in (a, b[:, None]))
        forward_up = np.linalg.lstsq(a, b[:, 0], rcond=1e-8)[0]
        up, forward = float(forward_up[0]), float(forward_up[1])
        if max(abs(up), abs(forward)) > _FARTHEST_M:
            return 0.0, 0.0
        slope = _slopes(level_m - forward, z_m - up, ring, rings)
    after = _spread(level_m - forward, z_m - up, slope, ring)
    if after > _BETTER * before or max(abs(up), abs(forward)) < _LEAST_M:
        return 0.0, 0.0
    return forward, up


def sharpest_origin(level_m: FloatArray, z_m: FloatArray) -> tuple[float, float]:
    """How far beams start forward and up [m], where nobody tells the rings: where elevations stand densest.

    `level_m`, `z_m` (n,): distance from the axis and height.
    """
    every = max(1, len(level_m) // _LOOKED_AT)
    level, z = level_m[::every], z_m[::every]
    forwards, ups = _SOUGHT_M
    best = max((_density(level, z, f, u, _BIN_DEG), f, u) for f in forwards for u in ups)
    forward, up = float(best[1]), float(best[2])
    by = 0.002
    while by >= 1e-5:
        tries = [(forward + i * by, up + j * by) for i in (-2, -1, 0, 1, 2) for j in (-2, -1, 0, 1, 2)]
        # A finer step sees a finer ring: bins of what it moves a point at 5 m.
        width = max(float(np.rad2deg(by / 5.0)), 1e-3)
        forward, up = max(tries, key=lambda one: _density(level, z, one[0], one[1], width))
        by *= 0.5
    return forward, up


def _density(level_m: FloatArray, z_m: FloatArray, forward: float, up: float, width_deg: float) -> float:
    """How densely elevations stand in bins of that width: the sum of the squares."""
    elevation = np.rad2deg(np.arctan2(z_m - up, level_m - forward))
    counts = np.bincount(((elevation + 90.0) / width_deg).astype(np.int64))
    return float(np.sum(counts.astype(np.float64) ** 2))


def _less_mean(values: FloatArray, ring: IntArray, rings: int) -> FloatArray:
    count = np.maximum(np.bincount(ring, minlength=rings), 1)
    means = [np.bincount(ring, weights=column, minlength=rings) / count for column in values.T]
    return np.asarray(values - np.stack(means, axis=-1)[ring])


def _slopes(level_m: FloatArray, z_m: FloatArray, ring: IntArray, rings: int) -> FloatArray:
    """The median tangent of each ring."""
    order = np.lexsort((z_m / level_m, ring))
    counts = np.bincount(ring, minlength=rings)
    start = np.r_[0, np.cumsum(counts)[:-1]]
    ordered = (z_m / level_m)[order]
    last = len(ordered) - 1
    low, high = np.minimum(start + (counts - 1) // 2, last), np.minimum(start + counts // 2, last)
    return np.asarray(0.5 * (ordered[low] + ordered[high]))


def _spread(level_m: FloatArray, z_m: FloatArray, slope: FloatArray, ring: IntArray) -> float:
    return float(np.median(np.abs(z_m / level_m - slope[ring])))
