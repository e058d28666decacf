"""How far cells lie from what is expected of their light, in standard deviations; and the smoothness of a table."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.blooming.response import Responses

__all__ = ["detection_residual", "huber_cost", "huber_weight", "smoothness_rows", "weights"]

_RELATIVE = 0.03
_WIDTH_NS = 0.5
"""How well the model can be expected to hold, besides chance: PEAK and AREA to 3 %, WIDTH to half a bin."""
_HUBER = 3.0
_BEND_ROWS = 10.0


def weights(response: Responses, z: FloatArray, value: FloatArray, echoes: IndexArray) -> FloatArray:
    """One over the standard deviation of each mean feature at light z, shape (n, 3); 0 where `value` is NaN.

    The variance is that of the mean of `echoes` echoes, and of what no model does better. It is taken once for each
    known feature of the cell: they are so correlated that together they tell hardly more than one of them. Their full
    covariance would be sharper, but where a model is a little wrong it draws a fit to light outside of what PEAK and
    AREA each say (Peelle's puzzle).
    """
    mean, _ = response.features(z)
    floor = np.column_stack([_RELATIVE * mean[:, 0], _RELATIVE * mean[:, 1], np.full(len(mean), _WIDTH_NS)])
    variance = response.scatter(z) / np.maximum(echoes, 1)[:, None] + floor**2
    known = np.isfinite(value)
    return np.asarray(known / np.sqrt(variance * np.maximum(known.sum(axis=1), 1)[:, None]))


def detection_residual(
    response: Responses, z: FloatArray, echoes: IndexArray, beams: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Signed root of the binomial deviance of `echoes` among `beams`, and its slope over z; shapes (n,)."""
    p, slope = response.probability(z)
    share = echoes / beams
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = np.where(echoes > 0, echoes * np.log(share / p), 0.0)
        missed = np.where(echoes < beams, (beams - echoes) * np.log((1.0 - share) / (1.0 - p)), 0.0)
    root = np.sqrt(np.maximum(2.0 * (hit + missed), 0.0))
    residual = np.where(share >= p, root, -root)
    variance = p * (1.0 - p)
    near = root < 1e-3
    steep = np.where(near, np.sqrt(beams / variance), beams * (share - p) / (variance * np.where(near, 1.0, residual)))
    return residual, -steep * slope


def huber_cost(residual: FloatArray) -> FloatArray:
    """The loss of each residual, shape (n,)."""
    return np.where(np.abs(residual) > _HUBER, 2.0 * _HUBER * np.abs(residual) - _HUBER**2, residual**2)


def huber_weight(residual: FloatArray) -> FloatArray:
    """What each residual counts for: 1 within 3 standard deviations, less beyond; shape (n,)."""
    return np.asarray(np.minimum(1.0, _HUBER / np.maximum(np.abs(residual), 1e-9)))


def smoothness_rows(x: FloatArray) -> FloatArray:
    """Rows that give the bends of log10 Y over its ascending X, each side of 0 on its own; shape (bends, k).

    Second differences over t = asinh(x / 10), which is x near the target and its logarithm far from it, so that one
    weight fits a steep core and a wide skirt; weighted so that their squares sum to the integral of the squared bend.
    """
    t = np.arcsinh(x / _BEND_ROWS)
    rows = []
    for side in (np.flatnonzero(x < 0.0), np.flatnonzero(x > 0.0)):
        for a, b, c in zip(side[:-2], side[1:-1], side[2:], strict=True):
            before, behind = t[b] - t[a], t[c] - t[b]
            width = 0.5 * (before + behind)
            row = np.zeros(len(x))
            row[a], row[c] = 1.0 / before, 1.0 / behind
            row[b] = -row[a] - row[c]
            rows.append(row / np.sqrt(width))
    return np.array(rows).reshape(-1, len(x))
