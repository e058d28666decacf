"""The linear detector's kernel: from the light of beams to echoes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.detector_echoes import Candidates, Gate, Rows, add, put, write
from lidarcheck.model.lane_math import LANES, exp, fired, log
from lidarcheck.model.linear.numbers import LinearLight, LinearNumbers
from lidarcheck.model.normal import normal, normals
from lidarcheck.model.streams import Stream, fill_abreast, philox, unit

__all__ = ["Draws", "Surfaces", "detect", "new_draws"]

_PER_LN10 = 0.4342944819032518
_POWER, _DISTANCE = 1, 2
_AIR = 1 << 32
"""Draws of the air's rows stand behind those of any number of pulses."""
_LEAST = 2.0**-54
"""Half the distance between two uniform numbers, in the place of 0."""


class Draws(NamedTuple):
    """The first draws of `LANES` beams: `uniform`, and the normal numbers of the first two of each; and work space."""

    beams: npt.NDArray[np.uint64]
    words: npt.NDArray[np.uint64]
    uniform: FloatArray
    normal: FloatArray


class Surfaces(NamedTuple):
    """What one beam meets, nearest first: range [m], S, and the number by which draws know it; shape (room,) each."""

    range_m: FloatArray
    signal: FloatArray
    number: IndexArray


def new_draws() -> Draws:
    """Work space of one thread."""
    beams, words = np.zeros(LANES, dtype=np.uint64), np.empty(4 * LANES, dtype=np.uint64)
    return Draws(beams, words, np.empty(4 * LANES), np.empty(2 * LANES))


@inlined
def _insert(surfaces: Surfaces, held: int, range_m: float, signal: float, number: int) -> int:
    """Add a surface in its place; returns how many there are."""
    if not signal > 0.0:
        return held
    j = held
    while j > 0 and surfaces.range_m[j - 1] > range_m:
        surfaces.range_m[j], surfaces.signal[j] = surfaces.range_m[j - 1], surfaces.signal[j - 1]
        surfaces.number[j] = surfaces.number[j - 1]
        j -= 1
    surfaces.range_m[j], surfaces.signal[j], surfaces.number[j] = range_m, signal, number
    return held + 1


@kernel
def _add_air(light: LinearLight, beam: Any, surfaces: Surfaces, held: int) -> int:
    """Add the air's echo of each of the beam's rows."""
    cells = len(light.air_signal) - 1
    first = light.air_first[beam]
    for row in range(first, light.air_first[beam + 1]):
        end = min(max(light.air_end[row], 0.0), float(cells))
        cell = min(int(end), cells - 1)
        part = end - cell
        signal = light.air_signal[cell] + part * (light.air_signal[cell + 1] - light.air_signal[cell])
        range_m = light.air_range[cell] + part * (light.air_range[cell + 1] - light.air_range[cell])
        held = _insert(surfaces, held, range_m, light.air_share[row] * signal, _AIR + row - first)
    return held


@inlined
def _merge(surfaces: Surfaces, held: int, separation: float) -> int:
    """Make one of surfaces that stand nearer than `separation` to the next, in chains: S added, range weighted by S."""
    merged = 0
    i = 0
    while i < held:
        last, signal, number = surfaces.range_m[i], surfaces.signal[i], surfaces.number[i]
        moment, first = last * signal, i
        i += 1
        while i < held and surfaces.range_m[i] - last < separation:
            last = surfaces.range_m[i]
            moment += last * surfaces.signal[i]
            signal += surfaces.signal[i]
            number = min(number, surfaces.number[i])
            i += 1
        surfaces.range_m[merged] = last if i == first + 1 else moment / signal
        surfaces.signal[merged], surfaces.number[merged] = signal, number
        merged += 1
    return merged


@inlined
def range_sigma(numbers: LinearNumbers, signal: float, sigma: float, range_m: float) -> float:
    """Standard deviation of a range [m] by the sensor's law."""
    if numbers.law == _DISTANCE:
        return numbers.base + numbers.slope * range_m
    if numbers.law == _POWER:
        weak = 0.0
        if numbers.at_threshold > 0.0 and numbers.threshold > 0.0:
            weak = numbers.at_threshold * exp(min(numbers.power * log(numbers.threshold / signal), 700.0))
    else:
        weak = numbers.edge * sigma / signal
    return math.sqrt(numbers.floor2 + weak * weak)


@kernel
def false_chance(numbers: LinearNumbers, variance: float) -> float:
    """Chance that a shot has a false echo, by Rice's rate at that variance of the amplitude in the dark.

    Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 24, 1945. None without the sensor's own noise.
    """
    if numbers.noise2 <= 0.0 or variance <= 0.0:
        return 0.0
    half = 0.5 * numbers.threshold * numbers.threshold
    exponent = half / numbers.noise2 - half / variance if numbers.from_dark else -half / variance
    rate = numbers.false_per_ns * exp(min(max(exponent, -700.0), 700.0))
    return fired(rate * numbers.gate_ns)


@kernel
def _add_false(
    numbers: LinearNumbers,
    gate: Gate,
    found: Candidates,
    held: int,
    variance: float,
    offset: float,
    draw: Any,
    real: int,
    surfaces: Surfaces,
) -> int:
    """Add the shot's false echo, anywhere in the gate, unless a real one stands within the pulse."""
    first, second, _, _ = draw
    path = numbers.gate_low + unit(first) * (numbers.gate_high - numbers.gate_low) - gate.offset
    for j in range(real):
        if abs(surfaces.range_m[j] + offset - path) < numbers.separation:
            return held
    energy = -log(max(unit(second), _LEAST))
    amplitude = math.sqrt(numbers.threshold * numbers.threshold + 2.0 * variance * energy)
    return add(gate, found, held, path, min(amplitude, numbers.saturation), _longer(numbers, amplitude))


@inlined
def _longer(numbers: LinearNumbers, amplitude: float) -> float:
    """By how much saturation lengthens the pulse [ns]."""
    if amplitude <= numbers.saturation or numbers.recovery_ns == 0.0:
        return 0.0
    return numbers.recovery_ns * _PER_LN10 * log(amplitude / numbers.saturation)


@inlined
def _gather(numbers: LinearNumbers, light: LinearLight, beam: Any, surfaces: Surfaces) -> int:
    """Write what a beam meets to `surfaces`, merged; returns how many there are."""
    met = 0
    first = light.first[beam]
    for j in range(first, light.first[beam + np.uint64(1)]):
        met = _insert(surfaces, met, light.range_m[j], light.signal[j], j - first)
    if len(light.air_signal) > 0:
        met = _add_air(light, beam, surfaces, met)
    return _merge(surfaces, met, numbers.separation) if met > 1 else met


@inlined
def _hear(
    numbers: LinearNumbers,
    gate: Gate,
    range_m: float,
    signal: float,
    dark: float,
    offset: float,
    of_amplitude: float,
    of_range: float,
    found: Candidates,
    held: int,
) -> Any:
    """A surface's amplitude and, where that is above the threshold, its range; whether it is, and echoes now.

    `of_amplitude`, `of_range`: standard normal numbers.
    """
    sigma = math.sqrt(dark + signal * (numbers.excess + numbers.relative2 * signal))
    amplitude = signal + sigma * of_amplitude
    if not amplitude > numbers.threshold:
        return False, held
    longer = 0.0
    if amplitude > numbers.saturation:
        longer = _longer(numbers, amplitude)
        amplitude = numbers.saturation
    path = range_m + range_sigma(numbers, signal, sigma, range_m) * of_range
    if numbers.walk != 0.0:
        path -= numbers.walk * _PER_LN10 * log(amplitude / numbers.walk_reference)
    return True, add(gate, found, held, path + offset, amplitude, longer)


@inlined
def _draw(light: LinearLight, stream: Stream, start: int, stop: int, draws: Draws) -> None:
    """The first draws of the beams `start` ... `stop - 1`, `LANES` at most."""
    for row in range(start, stop):
        draws.beams[row - start] = light.beams[row]
    fill_abreast(stream, draws.beams, 1, draws.words, draws.uniform)
    normals(draws.uniform, 2 * LANES, draws.normal)


@kernel
def detect(
    numbers: LinearNumbers,
    gate: Gate,
    light: LinearLight,
    stream: Stream,
    start: int,
    stop: int,
    draws: Draws,
    surfaces: Surfaces,
    found: Candidates,
    rows: Rows,
) -> int:
    """Echoes of the beams `start` ... `stop - 1` into `rows`; returns how many.

    Draws: the block of a surface's number: amplitude, range; third of block 0: whether there is a false echo; branch 1:
    where.
    """
    at = 0
    chance, chance_at = 0.0, -1.0
    zero, key, frame = np.uint64(0), stream.key, stream.counter[2]
    for row in range(start, stop):
        lane = (row - start) % LANES
        if lane == 0:
            _draw(light, stream, row, min(row + LANES, stop), draws)
        i: Any = np.uint64(row)
        offset = light.offset[i]
        met = _gather(numbers, light, i, surfaces)
        dark = numbers.noise2 + light.ambient[i]
        if dark != chance_at:
            chance, chance_at = false_chance(numbers, dark), dark
        held = real = 0
        for j in range(met):
            of_amplitude, of_range = draws.normal[lane], draws.normal[LANES + lane]
            if surfaces.number[j] > 0:
                own = philox(key[0], key[1], np.uint64(surfaces.number[j]), light.beams[i], frame, zero)
                of_amplitude, of_range = normal(unit(own[0])), normal(unit(own[1]))
            range_m, signal = surfaces.range_m[j], surfaces.signal[j]
            heard, held = _hear(numbers, gate, range_m, signal, dark, offset, of_amplitude, of_range, found, held)
            if heard:
                surfaces.range_m[real] = range_m
                real += 1
        if draws.uniform[2 * LANES + lane] < chance:
            where = philox(key[0], key[1], zero, light.beams[i], frame, np.uint64(1))
            held = _add_false(numbers, gate, found, held, dark, offset, where, real, surfaces)
        if held == 1:
            write(gate, found, 0, 1, 1, 0, row, rows, at)
            at += 1
        elif held > 1:
            at = put(gate, found, held, row, rows, at)
    return at
