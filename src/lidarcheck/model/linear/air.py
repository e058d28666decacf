"""What the air scatters back, as a linear detector hears it: an echo at the maximum of its amplitude.

The receiver's answer to a surface is the pulse, of height S; its answer to the air is the profile (S per metre)
convolved with that pulse. Such a detector reports where its amplitude has a maximum, so air is one soft surface: at the
maximum, and as strong. What a beam meets ends the profile, and with it moves and lowers a maximum that lies behind.
"""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.scan import Haze

__all__ = ["air_echoes"]

_REACH = 5.0
"""Standard deviations of the pulse beyond which none of its light matters."""
_PER_SIGMA = 8.0
"""Places of a standard deviation at which the amplitude is looked at; between them, a parabola."""


def air_echoes(haze: Haze, sigma_m: float) -> tuple[FloatArray, FloatArray]:
    """S and range [m] of the air's echo where the profile ends at the edge of each cell: shapes (cells + 1,).

    `sigma_m`: standard deviation of the pulse along the range. The profile's rows scale S and leave the range.
    """
    cells = len(haze.density_per_m)
    signal, range_m = np.zeros(cells + 1), np.zeros(cells + 1)
    signal[-1], range_m[-1] = _maximum(haze, cells, sigma_m)
    for edge in range(cells - 1, 0, -1):
        # An end far behind the maximum leaves it as it is.
        if edge * haze.step_m > range_m[-1] + _REACH * sigma_m:
            signal[edge], range_m[edge] = signal[-1], range_m[-1]
        else:
            signal[edge], range_m[edge] = _maximum(haze, edge, sigma_m)
    range_m[0] = range_m[1] if cells else 0.0
    return signal, range_m


def _maximum(haze: Haze, cells: int, sigma_m: float) -> tuple[float, float]:
    """Height and place of the maximum of the first `cells` convolved with a pulse of height 1."""
    from scipy.special import ndtr

    end_m = cells * haze.step_m
    places = np.arange(0.0, end_m + 0.5 * sigma_m, sigma_m / _PER_SIGMA)
    edges = np.arange(cells + 1) * haze.step_m
    amplitude = np.empty(len(places))
    for first in range(0, len(places), 256):
        at = places[first : first + 256]
        low = max(int((at[0] - _REACH * sigma_m) / haze.step_m), 0)
        high = min(int((at[-1] + _REACH * sigma_m) / haze.step_m) + 2, cells + 1)
        seen = np.diff(ndtr((edges[None, low:high] - at[:, None]) / sigma_m), axis=1)
        amplitude[first : first + 256] = np.sum(seen * haze.density_per_m[low : high - 1], axis=1)
    amplitude *= sigma_m * math.sqrt(2.0 * math.pi)
    best = int(np.argmax(amplitude))
    if not 0 < best < len(places) - 1:
        return float(amplitude[best]), float(places[best])
    before, there, behind = amplitude[best - 1 : best + 2]
    bend = before - 2.0 * there + behind
    aside = 0.5 * (before - behind) / bend if bend < 0.0 else 0.0
    return float(there - 0.25 * (before - behind) * aside), float(places[best] + aside * (places[1] - places[0]))
