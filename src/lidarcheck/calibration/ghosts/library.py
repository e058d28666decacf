"""What the sensor makes of a faint pulse: how often it sees it, and with what AREA, PEAK and range, by its strength."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.ghosts.data import WINDOW_M
from lidarcheck.model.chain import echoes_of
from lidarcheck.scan import Light, PulseShape
from lidarcheck.sensor import Sensor

__all__ = ["FaintPulseLibrary", "library_of"]


FAINTEST, BRIGHTEST, STEPS = 5e-4, 60.0, 64
FINE = 2000
DRAWS = 10_000
AT_M = 60.0
LEAST_SEEN = 50
"""Echoes that a strength needs for a mean of its own; below, that of the next one that has them."""
RARE = 1e-5
LEAST_SPREAD, LEAST_SPREAD_M = 0.01, 0.003


@dataclass(frozen=True)
class FaintPulseLibrary:
    """Tables over `log_signal`, the natural logarithm of S; all of shape (FINE,).

    `probability` of an echo at the pulse's place; of those echoes mean and standard deviation of the logarithm of
    AREA, mean PEAK, and mean and standard deviation of how far behind the pulse's place they stand.
    """

    log_signal: FloatArray
    probability: FloatArray
    log_area: FloatArray
    log_area_spread: FloatArray
    peak: FloatArray
    shift_m: FloatArray
    shift_spread_m: FloatArray

    def at(self, column: FloatArray, log_signal: FloatArray) -> FloatArray:
        """A column at some strengths; beyond the table its last value."""
        return np.asarray(np.interp(log_signal, self.log_signal, column))

    def with_scatter(self, log_area: float) -> FaintPulseLibrary:
        """The same for pulses that scatter: `log_area` is the spread that this adds to the logarithm of AREA."""
        return replace(self, log_area_spread=np.hypot(self.log_area_spread, log_area))


@functools.lru_cache(maxsize=16)
def library_of(
    sensor: Sensor, shape: PulseShape | None, background_per_ns: float, *, seed: int = 0
) -> FaintPulseLibrary:
    """The library of a sensor behind a pulse shape and a background, from the exact chain.

    All strengths are drawn with the same random numbers, so that the tables are smooth.
    """
    log_signal = np.linspace(np.log(FAINTEST), np.log(BRIGHTEST), STEPS)
    # Places within a bin of the clock, evenly.
    at_m = AT_M + 3.0 * (np.arange(DRAWS) + 0.5) / DRAWS
    rows = [_row(np.exp(s), at_m, sensor, shape, background_per_ns, seed) for s in log_signal]
    fine = np.linspace(log_signal[0], log_signal[-1], FINE)
    table = [_smooth(log_signal, column, fine) for column in np.array(rows).T]
    probability = np.clip(table[0], RARE, 1.0 - RARE)
    spread, shift_spread = np.maximum(table[2], LEAST_SPREAD), np.maximum(table[5], LEAST_SPREAD_M)
    return FaintPulseLibrary(fine, probability, table[1], spread, table[3], table[4], shift_spread)


def _smooth(log_signal: FloatArray, column: FloatArray, fine: FloatArray) -> FloatArray:
    """A column between its steps; where a strength is too faint to be seen, as at the next one that is not."""
    from scipy.interpolate import PchipInterpolator

    known = np.flatnonzero(np.isfinite(column))
    if len(known) < 2:
        return np.zeros(len(fine))
    inside = np.clip(fine, log_signal[known[0]], log_signal[known[-1]])
    return np.asarray(PchipInterpolator(log_signal[known], column[known])(inside))


def _row(
    signal: float, at_m: FloatArray, sensor: Sensor, shape: PulseShape | None, background_per_ns: float, seed: int
) -> list[float]:
    n = len(at_m)
    beams = sensor.beams
    layer, point = np.divmod(np.arange(n, dtype=np.int32), np.int32(beams.points))
    background = np.full(n, background_per_ns)
    light = Light(layer, point, background, np.arange(n + 1), at_m, np.full(n, signal), shape=shape, beams=beams)
    scan = echoes_of(light, sensor, seed=seed)
    beam = beams.index(scan.layer, scan.point)
    behind = scan.range_m - at_m[beam]
    near = np.flatnonzero(np.abs(behind) <= WINDOW_M)
    order = near[np.lexsort((np.abs(behind[near]), beam[near]))]
    first = order[np.concatenate([[True], np.diff(beam[order]) > 0])] if len(order) else order
    if len(first) < LEAST_SEEN:
        return [len(first) / n, *[float("nan")] * 5]
    log_area = np.log(scan.area[first])
    return [
        len(first) / n,
        *(log_area.mean(), log_area.std()),
        scan.peak[first].mean(),
        *(behind[first].mean(), behind[first].std()),
    ]
