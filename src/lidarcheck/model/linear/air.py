"""What the air scatters back, as a linear detector hears it: an echo at the maximum of its amplitude.

The receiver's answer to a surface is the pulse, of height S; its answer to the air is the profile (S per metre)
convolved with that pulse. Such a detector reports where its amplitude has a maximum, so air is one soft surface: at the
maximum, and as strong. What a beam meets ends the profile, and with it moves and lowers a maximum that lies behind.
"""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.scan import Haze

__all__ = ["air_echoes"]

_REACH = 5.0
"""Standard deviations of the pulse beyond which none of its light matters."""
_PER_SIGMA = 8.0
"""Places of a standard deviation at which the amplitude is looked at; between them, a parabola."""
_AT_ONCE = 256
"""So many places are looked at in one array."""


def air_echoes(haze: Haze, sigma_m: float) -> tuple[FloatArray, FloatArray]:
    """S and range [m] of the air's echo where the profile ends at the edge of each cell: shapes (cells + 1,).

    `sigma_m`: standard deviation of the pulse along the range. The profile's rows scale S and leave the range.
    """
    cells = len(haze.density_per_m)
    signal, range_m = np.zeros(cells + 1), np.zeros(cells + 1)
    whole, its_m = _maxima(haze, np.array([cells]), sigma_m)
    signal[1:], range_m[1:] = whole, its_m
    # An end far behind the maximum leaves it as it is.
    near = np.arange(1, cells)
    near = near[near * haze.step_m <= its_m + _REACH * sigma_m]
    signal[near], range_m[near] = _maxima(haze, near, sigma_m)
    range_m[0] = range_m[1] if cells else 0.0
    return signal, range_m


def _maxima(haze: Haze, ends: IndexArray, sigma_m: float) -> tuple[FloatArray, FloatArray]:
    """Height and place of the maxima of the first so many cells convolved with a pulse of height 1; `ends` ascend."""
    pitch_m = sigma_m / _PER_SIGMA
    counts = np.ceil((ends * haze.step_m + 0.5 * sigma_m) / pitch_m).astype(np.int64)
    best = np.full((3, len(ends)), -np.inf)  # the maximum, between what is before and behind it
    place = np.zeros(len(ends), np.int64)
    for first in range(0, int(counts[-1]) if len(ends) else 0, _AT_ONCE):
        amplitude = _heard(haze, ends, sigma_m, first, int(counts[-1]), float(best[1].min()))
        if amplitude is None:
            continue
        number = np.arange(first - 1, first - 1 + len(amplitude))
        amplitude[number[:, None] >= counts] = -np.inf
        highest = np.argmax(amplitude[1:-1], axis=0) + 1
        around = np.stack([np.take_along_axis(amplitude, highest[None] + k, axis=0)[0] for k in (-1, 0, 1)])
        higher = around[1] > best[1]
        best, place = np.where(higher, around, best), np.where(higher, number[highest], place)
    before, there, behind = best
    inner = np.isfinite(before) & np.isfinite(behind)
    bend = np.where(inner, before - 2.0 * there + behind, 0.0)
    slope = np.where(inner, before - behind, 0.0)
    aside = np.divide(0.5 * slope, bend, out=np.zeros(len(ends)), where=bend < 0.0)
    return there - 0.25 * slope * aside, np.asarray((place + aside) * pitch_m)


def _heard(haze: Haze, ends: IndexArray, sigma_m: float, first: int, places: int, least: float) -> FloatArray | None:
    """The amplitude at `_AT_ONCE` places from a first one on, and at one more on both sides, -inf where there is none:
    shape (places, ends). None where none of them can be above `least`: the pulse's answer is a mean of the profile."""
    from scipy.special import ndtr

    number = np.arange(first - 1, min(first + _AT_ONCE, places) + 1)
    at = number * (sigma_m / _PER_SIGMA)
    low = max(int((at[0] - _REACH * sigma_m) / haze.step_m), 0)
    high = min(int((at[-1] + _REACH * sigma_m) / haze.step_m) + 2, int(ends[-1]) + 1)
    density = sigma_m * math.sqrt(2.0 * math.pi) * haze.density_per_m[low : high - 1]
    if density.max(initial=0.0) <= least:
        return None
    edges = np.arange(low, high) * haze.step_m
    weight = np.diff(ndtr((edges[None] - at[:, None]) / sigma_m), axis=1)
    sums = np.zeros((len(at), len(density) + 1))
    np.cumsum(weight * density, axis=1, out=sums[:, 1:])
    sums[(number < 0) | (number >= places)] = -np.inf
    return sums[:, np.clip(ends - low, 0, len(density))]
