"""Kernels of the fast path: the signal of a frame's beams, and which sample of the library each of them draws.

What a beam drew is a word of `words.py`. Where that is not the whole of its echoes, the word says what else: `SPECIAL`,
then 4 bits of `EXACT`, `TABLE` or `ALARM`, 8 bits for the number of the library, and above the place in its words.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.fast import words as w
from lidarcheck.model.streams import philox, unit

__all__ = [
    "ALARM",
    "EXACT",
    "NOTHING",
    "TABLE",
    "Tables",
    "beam_key",
    "draw_beams",
    "in_order",
    "signals",
]

ColumnArray = npt.NDArray[np.int32]

EXACT, TABLE, ALARM = 1, 2, 3
"""Why a beam is special: it goes through the exact chain, its sample has a row in the table, or background alone
makes an echo away from the pulse."""
NOTHING = (1 << 48) - 1
"""The place of a beam that no pulse comes back to."""
_BATCH = 512
"""Beams whose samples are read one after the other: many reads that wait for memory then wait together."""
_COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(11))
"""Coefficients of the cosine's series, good to 1e-15 up to a right angle."""

_ZERO, _ONE, _KIND = np.uint64(0), np.uint64(w.ONE), np.uint64(w.KIND)
_SPECIAL, _MANY, _NOTHING = np.uint64(w.SPECIAL), np.uint64(w.MANY), np.uint64(NOTHING)
_EXACT, _TABLE, _ALARM = np.uint64(EXACT), np.uint64(TABLE), np.uint64(ALARM)
_CODE_AT, _LIBRARY_AT, _PLACE_AT = np.uint64(w.CODE_AT), np.uint64(w.LIBRARY_AT), np.uint64(w.PLACE_AT)
_CODE = np.uint64((1 << w.CODE_BITS) - 1)
_MANTISSA_BITS, _MANTISSA, _BIAS = 52, np.uint64((1 << 52) - 1), 1023


class Tables(NamedTuple):
    """A library as kernels see it.

    `words` (blocks * nodes * phases * samples,), of which those of `filled` blocks are set; `before`, `length`
    (blocks,): their spans. `lowest`: the exponent of block 1. `alarms`: clumps of echoes that background alone makes, a
    bin. The bits say how many signal steps, phases and samples there are; `number`, which of the frame's libraries.
    """

    words: WordArray
    filled: npt.NDArray[np.bool_]
    before: IndexArray
    length: IndexArray
    lowest: int
    bins: int
    bins_per_m: float
    alarms: float
    signal_bits: int
    phase_bits: int
    sample_bits: int
    number: int


def _bits_of(typing_context: Any, value: Any) -> Any:
    """The 64 bits of a float64, as `uint64`."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.uint64(types.float64), codegen


_bits: Any = intrinsic(_bits_of)


@inlined
def beam_key(layer: Any, point: Any) -> Any:
    """The number by which streams know a beam; see `streams.beam_keys`."""
    return np.uint64(np.int64(layer)) << np.uint64(32) | np.uint64(np.int64(point))


@kernel
def signals(
    distance_m: FloatArray,
    incidence_deg: FloatArray,
    material: ColumnArray,
    strength: FloatArray,
    falloff: FloatArray,
    signal: FloatArray,
    start: int,
    stop: int,
) -> int:
    """S of the rows `start` ... `stop - 1` by the range equation (see `light.surface_signal`) into `signal`.

    `strength`, `falloff`: by material; NaN where there is no such material. Returns how many rows are no ordinary
    ones: a distance below 0 or not finite, an incidence beyond a right angle, a material that is not there.
    """
    odd = 0
    last = np.uint32(len(strength) - 1)
    for row in range(start, stop):
        i = np.uint64(row)
        distance, angle = distance_m[i], incidence_deg[i]
        number = np.uint32(material[i])
        number = number if number < last else last
        t = angle * (math.pi / 180.0)
        t = t * t
        cosine = 0.0
        for k in range(10, -1, -1):
            cosine = cosine * t + _COSINE[k]
        cosine = cosine if cosine > 0.0 else 0.0
        nearest = distance if distance > 1e-3 else 1e-3
        value = strength[number] * (falloff[number] * cosine + (1.0 - falloff[number])) / (nearest * nearest)
        hit = distance > 0.0
        fair = (distance >= 0.0) & (distance < math.inf) & (angle >= 0.0) & (angle <= 90.0)
        odd += 0 if fair & ((value >= 0.0) | (not hit)) else 1
        signal[i] = value if hit else 0.0
    return odd


@kernel
def in_order(layer: ColumnArray, point: ColumnArray, layers: int, points: int, start: int, stop: int) -> bool:
    """Whether the rows are beams of the sensor, one a beam, in order of (layer, point), the row before included."""
    wrong = 0
    for i in range(max(start, 1), stop):
        rises = (layer[i] > layer[i - 1]) | ((layer[i] == layer[i - 1]) & (point[i] > point[i - 1]))
        wrong += 0 if rises else 1
    for i in range(start, stop):
        inside = (layer[i] >= 0) & (layer[i] < layers) & (point[i] >= 0) & (point[i] < points)
        wrong += 0 if inside else 1
    return wrong == 0


@inlined
def _step_of(tables: Tables, signal: float) -> Any:
    """The block of a signal, the node below it, and the rest up to the next as a share of 2^(52 - signal bits)."""
    fine = np.uint64(_MANTISSA_BITS - tables.signal_bits)
    bits: Any = _bits(signal)
    block: Any = np.int64(bits >> np.uint64(_MANTISSA_BITS)) - _BIAS - tables.lowest + 1
    node = np.int64((bits & _MANTISSA) >> fine)
    rest = np.int64(bits & ((np.uint64(1) << fine) - np.uint64(1)))
    if block < 1:
        at = signal * 2.0**-tables.lowest * (1 << tables.signal_bits)
        block, node = 0, np.int64(at)
        rest = np.int64((at - node) * np.float64(np.int64(1) << np.int64(fine)))
    return block, node, rest


@inlined
def _place_of(tables: Tables, block: int, node: int, rest: int, centre: float, x0: Any, x1: Any, x2: Any) -> Any:
    """The place of the sample: at one of the nodes and at one of the positions on either side, drawn by nearness."""
    fine = np.uint64(_MANTISSA_BITS - tables.signal_bits)
    node += 1 if np.int64(x0 >> (np.uint64(64) - fine)) < rest else 0
    position = (centre - np.int64(centre)) * (1 << tables.phase_bits)
    phase = np.int64(position)
    phase = (phase + (1 if unit(x1) < position - phase else 0)) & ((1 << tables.phase_bits) - 1)
    row = block * ((1 << tables.signal_bits) + 1) + node
    sample = np.int64(x2 >> np.uint64(64 - tables.sample_bits))
    return np.uint64((((row << tables.phase_bits) + phase) << tables.sample_bits) + sample)


@inlined
def _find_place(
    tables: Tables,
    key: tuple[Any, Any, Any],
    beam: Any,
    range_m: float,
    signal: float,
    wanted: npt.NDArray[np.bool_],
) -> Any:
    """Where a beam's sample stands, and why the beam is special before that sample is known."""
    x0, x1, x2, x3 = philox(key[0], key[1], 0, beam, key[2], 0)
    elsewhere, place, code = tables.bins, _NOTHING, _ZERO
    if signal > 0.0:
        block, node, rest = _step_of(tables, signal)
        last = len(tables.filled) - 1
        known = block if block < last else last
        centre = range_m * tables.bins_per_m
        first = np.int64(centre if centre < 1e9 else 1e9) - tables.before[known]
        if block > last or first < 0 or first + tables.length[known] > tables.bins:
            code = _EXACT
        elif not tables.filled[known]:
            wanted[known] = True
        else:
            place = _place_of(tables, known, node, rest, centre, x0, x1, x2)
            elsewhere = tables.bins - tables.length[known]
    mean = tables.alarms * elsewhere
    # 1 - exp(-mean), where alarms are rare.
    if code == _ZERO and unit(x3) < mean * (1.0 - 0.5 * mean):
        code = _ALARM
    return place, code


@kernel
def draw_beams(
    tables: Tables,
    key: tuple[Any, Any, Any],
    layer: ColumnArray,
    point: ColumnArray,
    range_m: FloatArray,
    signal: FloatArray,
    start: int,
    stop: int,
    drawn: WordArray,
    special: IndexArray,
    wanted: npt.NDArray[np.bool_],
) -> Any:
    """What the beams `start` ... `stop - 1` draw, into `drawn`; rows of special ones into `special` from `start` on.

    `key`: seed, purpose and frame. Returns how many are plain beams with an echo, and how many are special. A block
    that is not filled is put down in `wanted`, and its beams are not drawn.
    """
    plain: Any = 0
    odd = start
    library = np.uint64(tables.number) << _LIBRARY_AT
    for low in range(start, stop, _BATCH):
        high = min(low + _BATCH, stop)
        for row in range(low, high):
            i = np.uint64(row)
            place, code = _find_place(tables, key, beam_key(layer[i], point[i]), range_m[i], signal[i], wanted)
            drawn[i] = place << _PLACE_AT | code
        for row in range(low, high):
            i = np.uint64(row)
            place, code = drawn[i] >> _PLACE_AT, drawn[i] & _CODE
            word = _ZERO if place == _NOTHING else tables.words[place]
            if (word & _KIND) == _MANY and code == _ZERO:
                code = _TABLE
            if code > _ZERO:
                drawn[i] = _SPECIAL | code << _CODE_AT | library | place << _PLACE_AT
                special[odd] = row
                odd += 1
            else:
                drawn[i] = word
                plain += np.int64(word & _ONE)
    return plain, odd - start
