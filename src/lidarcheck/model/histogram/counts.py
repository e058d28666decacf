"""Kernels from the light of a zone to its histogram: avalanches expected in each bin, and the counts drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.haze_rates import add_ramp
from lidarcheck.model.exact.pulse_form import PHASES
from lidarcheck.model.histogram.numbers import HistogramNumbers, ZoneLight
from lidarcheck.model.lane_math import fired, whole_below
from lidarcheck.model.many_trials import binomial_number

__all__ = ["add_rates", "draw_counts"]


@kernel
def add_rates(light: ZoneLight, zone: Any, rates: FloatArray) -> None:
    """Write the avalanches per armed SPAD and shot in each bin of a zone to `rates` (bins,)."""
    bins = len(rates)
    for k in range(bins):
        rates[k] = light.background[zone] + light.glass[k]
    columns = light.shares.shape[1]
    for j in range(light.first_pulse[zone], light.first_pulse[zone + np.uint64(1)]):
        signal = light.signal[j]
        middle = whole_below(light.centre[j])
        origin = middle - light.middle
        low, high = max(origin, 0), min(origin + columns, bins)
        if signal <= 0.0 or low >= high:
            continue
        position = (light.centre[j] - middle) * PHASES
        phase = int(position)
        above = signal * (position - phase)
        below = signal - above
        nearer, farther = light.shares[phase], light.shares[phase + 1]
        at, column = np.uint64(low), np.uint64(low - origin)
        for k in range(np.uint64(high - low)):
            rates[at + k] += below * nearer[column + k] + above * farther[column + k]
    if len(light.air) > 0:
        _add_air(light, zone, rates)


@kernel
def _add_air(light: ZoneLight, zone: Any, rates: FloatArray) -> None:
    """Add what the air scatters back: of all whole cells before its end, and of the part of the last one."""
    cells, bins = light.air.shape[0] - 1, len(rates)
    for row in range(light.air_first[zone], light.air_first[zone + np.uint64(1)]):
        share, end = light.air_share[row], min(max(light.air_end[row], 0.0), float(cells))
        cell = min(int(end), cells - 1)
        for k in range(bins):
            rates[k] += share * light.air[cell, k]
        begins, ends = cell * light.air_step - light.first, end * light.air_step - light.first
        low = max(whole_below(begins) - light.ramp_middle, 0)
        high = min(whole_below(ends) - light.ramp_middle + light.ramps.shape[1], bins)
        weight = share * light.air_density[cell]
        if low < high:
            add_ramp(light.ramps, light.ramp_middle, ends, weight, 0, low, high, rates)
            add_ramp(light.ramps, light.ramp_middle, begins, -weight, 0, low, high, rates)


@kernel
def draw_counts(
    numbers: HistogramNumbers,
    rates: FloatArray,
    key: npt.NDArray[np.uint64],
    beam: Any,
    frame: Any,
    inverse: FloatArray,
    chances: FloatArray,
    counts: FloatArray,
) -> None:
    """Draw the counts of all trials in each bin, clipped as the chip clips them, into `counts` (bins,).

    First photons are multinomial: bin after bin, of those trials that have not counted yet, each counts with
    1 - exp(-rate). With dead time, a bin's chance follows from those before it (`chances`, (bins,), is work space).
    Draws: a block a bin.
    """
    left = numbers.trials
    last_rate, fires, busy = -1.0, 0.0, 0.0
    for k in range(len(rates)):
        if rates[k] != last_rate:
            last_rate, fires = rates[k], fired(rates[k])
        chance = fires
        if numbers.dead > 1:
            if k >= numbers.dead:
                busy -= chances[k - numbers.dead]
            chance = fires * min(max(1.0 - busy, 0.0), 1.0)
            chances[k] = chance
            busy += chance
        count = binomial_number(left, chance, key[0], key[1], np.uint64(k), beam, frame, inverse)
        if numbers.dead == 0:
            left -= count
        counts[k] = min(float(count), numbers.most_counts)
