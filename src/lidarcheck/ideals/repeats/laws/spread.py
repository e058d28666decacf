"""How ranges and amplitudes scatter from repeat to repeat, pooled over rays of about one amplitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray

__all__ = ["CORE_TAIL", "AmplitudeBin", "Sample", "binned", "bins_of", "pooled_variance", "unrounded"]

_FEWEST_RAYS = 60
_TAIL = 1e-4
"""Rays that scatter more than all but so many would by the law are left out: leaves in the wind, edges overlooked. Rays
of one amplitude do not all scatter alike: of an XT32's weakest 4 % lie beyond what 1 % would, and belong to its law."""
CORE_TAIL = 0.01
"""The same where the rays that scatter alike are what counts."""


@dataclass(frozen=True)
class Sample:
    """Rays of one surface each that were seen twice or more; columns of shape (n,).

    `range_var`, `amplitude_var`: unbiased, of `hits` values as reported; `step`: of the amplitude.
    """

    amplitude: FloatArray
    path_m: FloatArray
    hits: IndexArray
    fired: IndexArray
    range_var: FloatArray
    amplitude_var: FloatArray
    step: FloatArray


@dataclass(frozen=True)
class AmplitudeBin:
    """Rays of about one amplitude: how many, how their ranges and amplitudes scatter, what share of shots was seen.

    `freedom`: degrees of freedom of the two scatters; `hits`: echoes a ray; `width`: standard deviation of the rays'
    mean amplitudes.
    """

    amplitude: float
    width: float
    hits: float
    path_m: float
    rays: int
    freedom: int
    range_sd_m: float
    amplitude_sd: float
    step: float
    hit_share: float

    @property
    def resolved(self) -> bool:
        """Whether the scatter of the amplitude is two steps or more."""
        return bool(self.amplitude_sd >= 2.0 * self.step)


def bins_of(amplitude: FloatArray, *, octave: int = 2) -> IndexArray:
    """The bin of each ray, shape (n,): so many an octave of amplitude, from the weakest; few rays join the next."""
    weakest = max(float(amplitude.min(initial=np.inf)), 1e-9 * float(np.abs(amplitude).max(initial=0.0)), 1e-300)
    place = np.floor(octave * np.log2(np.maximum(amplitude, weakest) / weakest)).astype(np.int64)
    counts = np.bincount(place)
    bin_of = np.zeros(len(counts), dtype=np.int64)
    number, held = 0, 0
    for k, count in enumerate(counts):
        bin_of[k] = number
        held += int(count)
        if held >= _FEWEST_RAYS:
            number, held = number + 1, 0
    if 0 < held < _FEWEST_RAYS and number:
        bin_of[bin_of == number] = number - 1
    return np.asarray(bin_of[place])


def binned(sample: Sample, step_m: float) -> list[AmplitudeBin]:
    """The sample by amplitude. `step_m`: of the ranges."""
    if not len(sample.amplitude):
        return []
    found = []
    number = bins_of(sample.amplitude)
    for k in np.unique(number):
        rows = np.flatnonzero(number == k)
        freedom = sample.hits[rows] - 1
        step = float(np.median(sample.step[rows]))
        variance, kept = pooled_variance(sample.range_var[rows], freedom, least=0.04 * step_m**2)
        of_amplitude, _ = pooled_variance(sample.amplitude_var[rows], freedom, least=0.04 * step**2)
        plain = unrounded(of_amplitude, step)
        found.append(
            AmplitudeBin(
                float(np.mean(sample.amplitude[rows])), float(np.std(sample.amplitude[rows])),
                float(np.mean(sample.hits[rows])), float(np.median(sample.path_m[rows])), len(rows),
                int(freedom[kept].sum()), float(np.sqrt(unrounded(variance, step_m))), float(np.sqrt(plain)), step,
                float(sample.hits[rows].sum() / max(int(sample.fired[rows].sum()), 1)),
            )
        )  # fmt: skip
    return found


def pooled_variance(
    variance: FloatArray, freedom: IndexArray, *, least: float = 0.0, tail: float = _TAIL
) -> tuple[float, BoolArray]:
    """The mean of variances of so many degrees of freedom, without those beyond chance, and which these are.

    What the `tail` would have added is put back by the chi-squared distribution. Variances below `least` are rounding.
    """
    kept = np.isfinite(variance) & (freedom > 0)
    limits = {int(n): chi2.ppf(1.0 - tail, n) / n for n in np.unique(freedom[kept])}
    limit = np.array([limits.get(int(n), np.inf) for n in freedom])
    mean = _weighted(variance, freedom, kept)
    order = np.argsort(variance[kept])
    if len(order):
        # Begin from a quarter of the rays, those that scatter least beyond the median, so that outliers do not rule.
        middle = np.median(variance[kept][order] / chi2.median(freedom[kept][order]) * freedom[kept][order])
        mean = max(float(middle), least) if middle > 0.0 else mean
    inside = kept
    for _ in range(20):
        inside = kept & (variance <= limit * max(mean, least))
        whole = _weighted(variance, freedom, inside) / _share(freedom[inside], tail)
        if abs(whole - mean) <= 1e-6 * mean:
            break
        mean = whole
    return float(mean), inside


def _weighted(variance: FloatArray, freedom: IndexArray, rows: BoolArray) -> float:
    return float((variance[rows] * freedom[rows]).sum() / max(int(freedom[rows].sum()), 1))


def _share(freedom: IndexArray, tail: float) -> float:
    """What the mean of the variances below the limit is of the whole mean."""
    if not len(freedom):
        return 1.0
    numbers, counts = np.unique(freedom, return_counts=True)
    cut = chi2.ppf(1.0 - tail, numbers)
    part = chi2.cdf(cut, numbers + 2) / (1.0 - tail)
    return float((part * counts * numbers).sum() / (counts * numbers).sum())


def unrounded(variance: float, step: float) -> float:
    """The variance before values were rounded to a step: less step^2/12, and less than that where steps hide it.

    With the place within a step even, the mean of rounded values still depends on it by
    sum exp(-4 pi^2 k^2 s^2)/(2 pi^2 k^2) of its variance, s the standard deviation in steps.
    """
    if step <= 0.0:
        return variance
    ratios = np.linspace(0.0, 1.0, 401)
    k = np.arange(1, 60)[:, None]
    kept = (np.exp(-4.0 * (np.pi * k * ratios) ** 2) / (2.0 * (np.pi * k) ** 2)).sum(axis=0)
    rounded = ratios**2 + 1.0 / 12.0 - kept
    rounded = np.maximum.accumulate(rounded - rounded[0])
    seen = variance / step**2
    if seen >= rounded[-1]:
        return variance - step**2 / 12.0
    return float(np.interp(seen, rounded, ratios) ** 2) * step**2
