"""Range scatter from repeated scans of a static scene: precision as a function of signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.validation import GAUSS_SHARE

__all__ = ["RangeScatter", "central_half_width", "range_scatter"]

FEWEST_PAIRS = 50


@dataclass(frozen=True)
class RangeScatter:
    """Standard deviation of one range over the signal, and two descriptions of it.

    Shapes (k,): `signal` (geometric mean of a bin), `sigma_m`, `pairs`. `scale_m`: a of σ = a/√signal; `slope`: of
    log σ over log signal, −½ where photon statistics rule alone; `floor_m`: f of σ² = a²/signal + f², what is left at
    strong signal. NaN where too few bins hold pairs: one for the scale, two for slope and floor.
    """

    signal: FloatArray
    sigma_m: FloatArray
    pairs: IndexArray
    scale_m: float
    slope: float
    floor_m: float


def range_scatter(
    first_m: npt.ArrayLike, second_m: npt.ArrayLike, signal: npt.ArrayLike, *, resolution_m: float = 0.0
) -> RangeScatter:
    """Scatter of range between two scans of a scene that stands still, a pair of ranges a beam, shapes (n,).

    `signal`: the beam's signal in photons or any unit in proportion to them, e.g. the mean of both scans; pairs
    without a positive one are left out. `resolution_m`: step of the reported range, 0 = none. Pairs that saw two
    surfaces are to be left out before (`pair_echoes` with a tolerance).

    Per octave of signal with at least 50 pairs: σ = w/√2, w the half-width around 0 that holds 68.3 % of the
    differences (σ√2 of a Gaussian, with a third of outliers ignored). Differences on a grid are spread over their
    step, and the variance that rounding two ranges and spreading one difference adds, resolution²/4, is taken off.
    Only scatter shows: a bias is the same in both scans. Scale, slope and floor weight a bin by its number of pairs;
    bins whose scatter drowns in the resolution are left out.
    """
    first, second, strength = (np.asarray(x, dtype=np.float64) for x in (first_m, second_m, signal))
    if not first.shape == second.shape == strength.shape:
        raise UsageError("the two scans' ranges and the signals differ in number", fix="give a pair a beam")
    usable = (strength > 0.0) & np.isfinite(first) & np.isfinite(second)
    difference, strength = np.abs(second - first)[usable], strength[usable]
    octave = np.floor(elementary.log2(strength)).astype(np.int64)
    kept = [o for o in np.unique(octave) if np.count_nonzero(octave == o) >= FEWEST_PAIRS]
    sigma = [_sigma(difference[octave == o], resolution_m) for o in kept]
    mean_signal = [float(elementary.exp(np.mean(elementary.log(strength[octave == o])))) for o in kept]
    pairs = [int(np.count_nonzero(octave == o)) for o in kept]
    return _describe(np.array(mean_signal), np.array(sigma), np.array(pairs, dtype=np.int64))


def central_half_width(magnitude: npt.ArrayLike, *, share: float = GAUSS_SHARE, step: float = 0.0) -> float:
    """Half-width around 0 that holds a share of a sample, from its magnitudes, shape (n,), not empty.

    `step` > 0: the values lie on that grid; each is taken to be spread evenly over its step, so that the result is
    not bound to it.
    """
    values = np.asarray(magnitude, dtype=np.float64)
    if step <= 0.0:
        return float(np.quantile(values, share))
    place, count = np.unique(np.rint(values / step), return_counts=True)
    held = np.cumsum(count) / values.size
    at = int(np.searchsorted(held, share))
    start = max(float(place[at]) - 0.5, 0.0)
    inside = (share - (float(held[at - 1]) if at else 0.0)) / (float(count[at]) / values.size)
    return step * (start + inside * (float(place[at]) + 0.5 - start))


def _sigma(difference_m: FloatArray, resolution_m: float) -> float:
    width = central_half_width(difference_m, step=resolution_m)
    return float(np.sqrt(max(width**2 - resolution_m**2 / 4.0, 0.0) / 2.0))


def _describe(signal: FloatArray, sigma_m: FloatArray, pairs: IndexArray) -> RangeScatter:
    clear = sigma_m > 0.0
    s, y, w = signal[clear], sigma_m[clear], pairs[clear].astype(np.float64)
    nan = float("nan")
    scale = float(elementary.exp(np.average(elementary.log(y * np.sqrt(s)), weights=w))) if s.size else nan
    if s.size < 2:
        return RangeScatter(signal, sigma_m, pairs, scale, nan, nan)
    slope, _ = _line(elementary.log(s), elementary.log(y), w)
    # A variance's error goes with the variance: weight by its inverse, so that weak signals do not rule.
    _, floor_square = _line(1.0 / s, y**2, w / y**4)
    return RangeScatter(signal, sigma_m, pairs, scale, slope, float(np.sqrt(max(floor_square, 0.0))))


def _line(x: FloatArray, y: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Slope and intercept of the straight line through points (n,) of such weights, by least squares."""
    middle_x, middle_y = np.average(x, weights=weight), np.average(y, weights=weight)
    off = x - middle_x
    slope = float((weight * off * (y - middle_y)).sum() / (weight * off * off).sum())
    return slope, float(middle_y - slope * middle_x)
