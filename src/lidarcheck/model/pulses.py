"""Pulses: where in the trace each beam's light arrives, and how much of it in each bin."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model.jit import inlined
from lidarcheck.model.numbers import Numbers
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor

__all__ = ["Pulses", "add_rates", "pulses_of", "window"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_TAIL = 1e-6
"""Signal avalanches a beam may lose, on average, where its pulse is cut off."""
_PHASES = 512
"""Pulse positions within a bin that are tabulated; linear between them, the share of a bin is exact to 2e-8."""


class Pulses(NamedTuple):
    """The pulses of all beams: centre [bins], S, and how many bins to either side a pulse matters; each (n_pulses,).

    Beam i has the pulses `first[i]` ... `first[i + 1] - 1`. Beyond its reach, fewer than `_TAIL` avalanches of a pulse
    are expected in a beam; the reach is whole, so that a slightly changed signal meets the same draws in the same bins.
    `shares`, (phases + 1, bins), holds the share of a pulse's light in each bin around it; row p: a pulse p / phases of
    a bin behind the beginning of the middle bin.
    """

    first: IntArray
    centre: FloatArray
    signal: FloatArray
    reach: IntArray
    shares: FloatArray


def pulses_of(light: Light, sensor: Sensor, numbers: Numbers) -> Pulses:
    """The light's pulses as kernels see them."""
    from scipy.special import ndtr

    # A pulse far behind the end of the trace is as good as one just behind it, and its bin fits an integer.
    centre = np.minimum(2.0 * light.pulse_range_m / (LIGHT_SPEED_M_PER_NS * sensor.bin_ns), 1e9)
    expected = numbers.detectors * light.pulse_signal / _TAIL
    reach = np.ceil(numbers.sigma * np.sqrt(2.0 * np.log(np.maximum(expected, 1.0)))).astype(np.int64)
    half = int(reach.max(initial=0)) + 1
    edges = np.arange(-half, half + 2)
    phases = np.arange(_PHASES + 1) / _PHASES
    shares = np.ascontiguousarray(np.diff(ndtr((edges - phases[:, None]) / numbers.sigma), axis=1))
    return Pulses(light.first_pulse, centre, light.pulse_signal, reach, shares)


@inlined
def window(numbers: Numbers, pulses: Pulses, beam: int) -> Any:
    """The bins in which the beam's pulses can set off avalanches, and their outputs' ON time."""
    begin, end = numbers.bins, 0
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        if pulses.signal[j] > 0.0:
            middle = math.floor(pulses.centre[j])
            low = middle - pulses.reach[j]
            high = middle + pulses.reach[j] + 1 + numbers.on
            begin = min(begin, max(low, 0))
            end = max(end, min(high, numbers.bins))
    if begin >= end:
        return 0, 0
    return begin, end


@inlined
def add_rates(pulses: Pulses, beam: int, begin: int, end: int, rates: FloatArray) -> None:
    """Add the pulses' avalanches per armed SPAD to `rates` of the bins `begin` ... `end - 1` (index 0 is `begin`)."""
    half = pulses.shares.shape[1] // 2
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        centre, signal, reach = pulses.centre[j], pulses.signal[j], pulses.reach[j]
        if signal <= 0.0:
            continue
        middle = math.floor(centre)
        low = max(middle - reach, begin)
        high = min(middle + reach + 1, end)
        position = (centre - middle) * _PHASES
        phase = int(position)
        above = signal * (position - phase)
        below = signal - above
        nearer, farther = pulses.shares[phase], pulses.shares[phase + 1]
        column, bin_ = np.uint64(low - middle + half), np.uint64(low - begin)
        for k in range(np.uint64(max(high - low, 0))):
            rates[bin_ + k] += below * nearer[column + k] + above * farther[column + k]
