"""What echoes a sensor makes of light: mean PEAK, AREA and WIDTH over S, and how often there is an echo.

The curves are those of the exact chain: beams with one pulse each, at every position within a bin, a ladder of light
from far below the threshold to deep saturation. Means are over detected echoes, as a measured profile's are: an echo
exists only above the threshold, so near it the mean of what is seen lies far above the mean of the trace.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.scan import Light, PulseShape, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Program, Sensor, SpadArray

__all__ = ["FEATURES", "GATE_M", "Response", "Responses", "bin_length_m", "response_of", "strongest_echoes"]

FEATURES = ("PEAK", "AREA", "WIDTH")
GATE_M = 1.5
"""Echoes within this of the target's range are the target's light: walk moves them by up to 0.4 m."""

_FROM, _TO, _STEP = -2.6, 4.4, 0.1
_BEAMS = 1500
"""Beams a level: means to 0.5 %, far below the scatter of a measured cell."""
_LEAST_ECHOES = 30
_FAR_M = 100.0


@dataclass(frozen=True)
class Response:
    """What a sensor shows of one pulse of S = 10^z avalanches per SPAD and shot, z being `levels`, shape (k,).

    `mean` (k, 3): of PEAK, AREA and WIDTH [ns] where there is an echo; `variance` (k, 3) of single echoes;
    `detected` (k,): the probability that there is one. Below the light at which any echo is found the means are those
    of the first echoes found.
    """

    levels: FloatArray
    mean: FloatArray
    variance: FloatArray
    detected: FloatArray

    def features(self, z: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Means at z = log10 S and their slopes, shape (n, 3) each."""
        at = self._within(z)
        return np.asarray(self._means(at)), np.asarray(self._mean_slopes(at))

    def probability(self, z: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The probability of an echo at z = log10 S and its slope, shape (n,) each."""
        at = self._within(z)
        p = 1.0 / (1.0 + np.exp(-self._logits(at)))
        return np.asarray(p), np.asarray(self._logit_slopes(at) * p * (1.0 - p))

    def scatter(self, z: npt.ArrayLike) -> FloatArray:
        """Variance of the features of single echoes at z, shape (n, 3): that of the nearest level."""
        place = np.rint((self._within(z) - self.levels[0]) / _STEP).astype(int)
        return np.asarray(self.variance[place])

    def light_of_area(self, area: npt.ArrayLike) -> FloatArray:
        """z at which AREA is expected, on the curve's first rise; its ends beyond."""
        top = int(np.argmax(self.mean[:, 1] >= 0.97 * self.mean[:, 1].max()))
        rise = np.maximum.accumulate(self.mean[: top + 1, 1] + 1e-9 * np.arange(top + 1))
        return np.interp(np.asarray(area, dtype=np.float64), rise, self.levels[: top + 1])

    @property
    def dark(self) -> float:
        """z up to which an echo is seen less often than once in ten beams."""
        return float(self.levels[np.flatnonzero(self.detected < 0.1)[-1]])

    def _within(self, z: npt.ArrayLike) -> FloatArray:
        return np.clip(np.asarray(z, dtype=np.float64), self.levels[0], self.levels[-1])

    @cached_property
    def _means(self) -> Any:
        return self._curve(self.mean)

    @cached_property
    def _mean_slopes(self) -> Any:
        return self._means.derivative()

    @cached_property
    def _logits(self) -> Any:
        return self._curve(_logit(self.detected))

    @cached_property
    def _logit_slopes(self) -> Any:
        return self._logits.derivative()

    def _curve(self, values: FloatArray) -> Any:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.levels, values, axis=0)

    def moved(self, others: Sequence[tuple[float, Response]]) -> Response:
        """This response and `share` times the way to each of the others, whose differences add up."""
        mean = self.mean + sum(share * (other.mean - self.mean) for share, other in others)
        logit = _logit(self.detected)
        logit = logit + sum(share * (_logit(other.detected) - logit) for share, other in others)
        return replace(self, mean=np.asarray(mean), detected=np.asarray(1.0 / (1.0 + np.exp(-logit))))


@dataclass(frozen=True)
class Responses:
    """The responses of several data sets as one: light z of row i is seen as by that of the set `set_of[i]`, (n,)."""

    of_set: tuple[Response, ...]
    set_of: IndexArray

    def features(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As `Response.features`."""
        mean, slope = self._by_set(Response.features, z)
        return mean, slope

    def probability(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As `Response.probability`."""
        p, slope = self._by_set(Response.probability, z)
        return p, slope

    def scatter(self, z: FloatArray) -> FloatArray:
        """As `Response.scatter`."""
        return self._by_set(lambda one, at: (one.scatter(at),), z)[0]

    def light_of_area(self, area: FloatArray) -> FloatArray:
        """As `Response.light_of_area`."""
        return self._by_set(lambda one, at: (one.light_of_area(at),), area)[0]

    def _by_set(self, ask: Callable[[Response, FloatArray], tuple[FloatArray, ...]], z: FloatArray) -> list[FloatArray]:
        found = [np.zeros((len(z), *part.shape[1:])) for part in ask(self.of_set[0], z[:0])]
        for number, one in enumerate(self.of_set):
            rows = np.flatnonzero(self.set_of == number)
            for whole, part in zip(found, ask(one, z[rows]), strict=True):
                whole[rows] = part
        return found


def _logit(p: FloatArray) -> FloatArray:
    return np.asarray(np.log(p / (1.0 - p)))


def response_of(
    sensor: Sensor, shape: PulseShape | None = None, *, within: tuple[float, ...] = (), seed: int = 0
) -> Response:
    """The response of a sensor to a pulse of that shape, its own where None; the same seed gives the same numbers.

    `within`: where in a bin pulses come, 0 to 1, each as often; all places alike where empty. It counts for bright
    light: whether detectors fire a second time before the pulse is over goes by it, and AREA by a quarter.
    """
    if isinstance(sensor, Program):  # which may be another one the next time
        return _simulated(sensor, shape, within, seed)
    return _kept(sensor, shape, within, seed)


def _simulated(sensor: Sensor, shape: PulseShape | None, within: tuple[float, ...], seed: int) -> Response:
    """The response, simulated."""
    from lidarcheck.model.chain import echoes_of

    levels: FloatArray = np.linspace(_FROM, _TO, round((_TO - _FROM) / _STEP) + 1)
    light = _ladder(levels, sensor, shape, within)
    scan = echoes_of(light, sensor, seed=seed, rounded=False)
    echoes = strongest_echoes(scan.take(np.abs(scan.range_m - _range_m(SpadArray.narrow(sensor.nominal))) <= GATE_M))
    values = np.column_stack([echoes.peak, echoes.area, echoes.width_ns])
    mean, variance = np.full((len(levels), 3), np.nan), np.zeros((len(levels), 3))
    count = np.bincount(echoes.layer, minlength=len(levels))
    ends = np.concatenate([[0], np.cumsum(count)])
    for i in range(len(levels)):
        if count[i] >= _LEAST_ECHOES:
            part = values[ends[i] : ends[i + 1]]
            mean[i], variance[i] = part.mean(axis=0), part.var(axis=0)
    known = np.flatnonzero(np.isfinite(mean[:, 0]))
    nearest = known[np.abs(np.arange(len(levels))[:, None] - known).argmin(axis=1)]
    mean, variance = mean[nearest], variance[nearest]
    detected = np.asarray((count + 0.5) / (_beams(sensor) + 1.0), dtype=np.float64)
    return Response(levels, mean, variance, detected)


_kept = lru_cache(maxsize=32)(_simulated)
"""The same, and kept: a fit, its pictures and the table beside them ask for the same ones."""


def _beams(sensor: Sensor) -> int:
    """Beams of each level: a program has no more than the sensor has points."""
    return min(_BEAMS, sensor.beams.points) if isinstance(sensor, Program) else _BEAMS


def _ladder(levels: FloatArray, sensor: Sensor, shape: PulseShape | None, within: tuple[float, ...]) -> Light:
    """A beam for each level (its layer) and position within a bin (its point)."""
    beams = _beams(sensor)
    n = len(levels) * beams
    counts = SpadArray.narrow(sensor.nominal)
    bin_m = bin_length_m(counts)
    beam = np.arange(beams)
    place = np.asarray(within)[beam % len(within)] if within else (beam + 0.5) / beams
    first_m = bin_m * np.floor(_range_m(counts) / bin_m)
    return Light(
        layer=np.repeat(np.arange(len(levels)), beams),
        point=np.tile(np.arange(beams), len(levels)),
        background_per_ns=np.full(n, sensor.background_per_ns),
        first_pulse=np.arange(n + 1),
        pulse_range_m=first_m + bin_m * np.tile(place, len(levels)),
        pulse_signal=np.repeat(10.0**levels, beams),
        shape=shape,
    )


def bin_length_m(sensor: SpadArray) -> float:
    """The range that a bin of the trace spans."""
    return 0.5 * LIGHT_SPEED_M_PER_NS * sensor.bin_ns


def _range_m(sensor: SpadArray) -> float:
    return min(_FAR_M, 0.5 * sensor.max_range_m)


def strongest_echoes(scan: Scan) -> Scan:
    """Of each beam the echo of the largest AREA, beams in order of (layer, point)."""
    order = np.lexsort((-scan.area, scan.point, scan.layer))
    layer, point = scan.layer[order], scan.point[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (layer[1:] != layer[:-1]) | (point[1:] != point[:-1])
    return scan.take(order[first])
