"""Pulses and haze: where in the trace each beam's light arrives, and how much of it in each bin."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined
from lidarcheck.model.exact.haze_rates import HazeRates, add_haze, haze_end, haze_rates_of
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulse_form import PHASES, form_of
from lidarcheck.model.lane_math import whole_below
from lidarcheck.model.sharing import Share, serially
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["Pulses", "add_pulses", "add_rates", "pulse_window", "pulses_of", "window"]

_CHUNK = 32768
"""Pulses that are prepared at a time: few enough for what lies between to stay in the cache."""


class Pulses(NamedTuple):
    """The pulses of all beams: centre [bins], S, and the bins before and behind that a pulse matters in; (n_pulses,).

    Beam i has the pulses `first[i]` ... `first[i + 1] - 1`. Beyond its reach, a beam loses next to nothing of a pulse.
    `shares`, (PHASES + 1, bins), holds the share of a pulse's light in each bin around it; row p: a pulse p / PHASES of
    a bin behind the beginning of the bin in column `middle`. `haze`: what the air scatters back.
    """

    first: IndexArray
    centre: FloatArray
    signal: FloatArray
    reach: IndexArray
    reach_behind: IndexArray
    shares: FloatArray
    middle: int
    haze: HazeRates


def pulses_of(light: Light, sensor: SpadArray, numbers: Numbers, share: Share = serially) -> Pulses:
    """The light's pulses and haze as kernels see them."""
    form = form_of(light.shape, sensor, sensor.bin_ns)
    n = len(light.pulse_signal)
    centre, reaches = np.empty(n), np.empty((2, n), dtype=np.int64)

    def fill(start: int) -> None:
        rows = slice(start, start + _CHUNK)
        # A pulse far behind the end of the trace is as good as one just behind it, and its bin fits an integer.
        centre[rows] = np.minimum(2.0 * light.pulse_range_m[rows] / (LIGHT_SPEED_M_PER_NS * sensor.bin_ns), 1e9)
        reaches[:, rows] = form.reach(numbers.detectors * light.pulse_signal[rows])

    share(fill, range(0, n, _CHUNK))
    reach, reach_behind = reaches
    before, behind = int(reach.max(initial=0)) + 1, int(reach_behind.max(initial=0)) + 1
    if behind > max(before, numbers.bins):
        behind = max(before, numbers.bins)
        reach_behind = np.minimum(reach_behind, behind)
    shares = form.shares(before, behind)
    haze = haze_rates_of(light, form, sensor, numbers)
    return Pulses(light.first_pulse, centre, light.pulse_signal, reach, reach_behind, shares, before, haze)


@inlined
def pulse_window(numbers: Numbers, pulses: Pulses, beam: int) -> Any:
    """The bins in which the beam's pulses can set off avalanches, and their outputs' ON time."""
    begin, end = numbers.bins, 0
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        if pulses.signal[j] > 0.0:
            middle = whole_below(pulses.centre[j])
            low = middle - pulses.reach[j]
            high = middle + pulses.reach_behind[j] + 1 + numbers.on
            begin = min(begin, max(low, 0))
            end = max(end, min(high, numbers.bins))
    if begin >= end:
        return 0, 0
    return begin, end


@inlined
def window(numbers: Numbers, pulses: Pulses, beam: int) -> Any:
    """The bins in which any of the beam's light can set off avalanches, and their outputs' ON time."""
    begin, end = pulse_window(numbers, pulses, beam)
    hazy = haze_end(numbers, pulses.haze, beam, 0.0)
    if hazy > 0:
        begin = pulses.haze.begin if end == 0 else min(begin, pulses.haze.begin)
        end = max(end, min(hazy + numbers.on, numbers.bins))
    return begin, end


@inlined
def add_pulses(
    pulses: Pulses, beam: int, begin: int, end: int, rates: FloatArray, first: int = 0, distance: int = 1
) -> None:
    """Add the pulses' avalanches per armed SPAD to the bins `begin` ... `end - 1`.

    `rates[first]` is bin `begin`, the next bin stands `distance` further.
    """
    step = np.uint64(distance)
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        centre, signal = pulses.centre[j], pulses.signal[j]
        if signal <= 0.0:
            continue
        middle = whole_below(centre)
        low = max(middle - pulses.reach[j], begin)
        high = min(middle + pulses.reach_behind[j] + 1, end)
        position = (centre - middle) * PHASES
        phase = int(position)
        above = signal * (position - phase)
        below = signal - above
        nearer, farther = pulses.shares[phase], pulses.shares[phase + 1]
        column, at = np.uint64(low - middle + pulses.middle), np.uint64(first + (low - begin) * distance)
        for k in range(np.uint64(max(high - low, 0))):
            rates[at + k * step] += below * nearer[column + k] + above * farther[column + k]


@inlined
def add_rates(pulses: Pulses, beam: int, begin: int, end: int, rates: FloatArray) -> None:
    """Add the avalanches per armed SPAD to `rates` of the bins `begin` ... `end - 1` (index 0 is `begin`)."""
    add_pulses(pulses, beam, begin, end, rates)
    if pulses.haze.last > 0:
        add_haze(pulses.haze, beam, begin, end, rates)
