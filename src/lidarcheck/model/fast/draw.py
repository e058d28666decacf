"""Kernels of the fast path: which sample of which library each beam draws.

What a beam drew is a word of `words.py`. Where that is not the whole of its echoes, the word says what else: `SPECIAL`,
then 4 bits of `EXACT`, `TABLE`, `ALARM` or `SEVERAL`, 8 bits for the number of the library, and above the place in its
words.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.fast import words as w
from lidarcheck.model.fast.tables import Levels, SeveralPulses, Tables
from lidarcheck.model.streams import philox, unit

__all__ = [
    "ALARM",
    "EXACT",
    "NOTHING",
    "SEVERAL",
    "TABLE",
    "alarm_rate_of",
    "ask",
    "beam_key",
    "bins_of",
    "chance_of_any",
    "draw_beams",
    "is_lit",
    "level_of",
    "place_of",
    "step_of",
]

ColumnArray = npt.NDArray[np.int32]

EXACT, TABLE, ALARM, SEVERAL = 1, 2, 3, 4
"""Why a beam is special: it goes through the exact chain, its sample has a row in the table, background alone makes an
echo away from the pulse, or it has several pulses, each with a sample."""
NOTHING = (1 << 48) - 1
"""The place of a beam that no pulse comes back to."""
_BATCH = 512
"""Beams whose samples are read one after the other: many reads that wait for memory then wait together."""


_ZERO, _ONE, _KIND = np.uint64(0), np.uint64(w.ONE), np.uint64(w.KIND)
_SPECIAL, _MANY, _NOTHING = np.uint64(w.SPECIAL), np.uint64(w.MANY), np.uint64(NOTHING)
_EXACT, _TABLE, _ALARM, _SEVERAL = np.uint64(EXACT), np.uint64(TABLE), np.uint64(ALARM), np.uint64(SEVERAL)
_CODE_AT, _LIBRARY_AT, _PLACE_AT = np.uint64(w.CODE_AT), np.uint64(w.LIBRARY_AT), np.uint64(w.PLACE_AT)
_CODE, _LIBRARY = np.uint64((1 << w.CODE_BITS) - 1), np.uint64((1 << w.LIBRARY_BITS) - 1)
_MANTISSA_BITS, _MANTISSA, _BIAS = 52, np.uint64((1 << 52) - 1), 1023


def _bits_of(typing_context: Any, value: Any) -> Any:
    """The 64 bits of a float64, as `uint64`."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.uint64(types.float64), codegen


def _word_at_of(typing_context: Any, address: Any, place: Any) -> Any:
    """The `uint64` at a place of an array that begins at an address."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        start = builder.inttoptr(args[0], ir.IntType(64).as_pointer())
        return builder.load(builder.gep(start, [args[1]]))

    return types.uint64(types.int64, types.uint64), codegen


_bits: Any = intrinsic(_bits_of)
_word_at: Any = intrinsic(_word_at_of)


@inlined
def beam_key(layer: Any, point: Any) -> Any:
    """The number by which streams know a beam; see `streams.beam_keys`."""
    return np.uint64(np.int64(layer)) << np.uint64(32) | np.uint64(np.int64(point))


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
def place_of(tables: Tables, signal: float, centre: float, x0: Any, x1: Any, x2: Any) -> Any:
    """The place of the sample: at one of the nodes and at one of the positions on either side, drawn by nearness."""
    block, node, rest = _step_of(tables, signal)
    fine = np.uint64(_MANTISSA_BITS - tables.signal_bits)
    node += 1 if np.int64(x0 >> (np.uint64(64) - fine)) < rest else 0
    position = (centre - np.int64(centre)) * (1 << tables.phase_bits)
    phase = np.int64(position)
    phase = (phase + (1 if unit(x1) < position - phase else 0)) & ((1 << tables.phase_bits) - 1)
    row = block * ((1 << tables.signal_bits) + 1) + node
    sample = np.int64(x2 >> np.uint64(64 - tables.sample_bits))
    return np.uint64((((row << tables.phase_bits) + phase) << tables.sample_bits) + sample)


@inlined
def bins_of(tables: Tables, range_m: float, signal: float) -> Any:
    """The block of a pulse, -1 where there is none for it; the first bin that its sample sees, and how many."""
    block = _step_of(tables, signal)[0]
    last = len(tables.before) - 1
    known = block if block < last else last
    centre = range_m * tables.bins_per_m
    first = np.int64(centre if centre < 1e9 else 1e9) - tables.before[known]
    length = tables.length[known]
    if block > last or first < 0 or first + length > tables.bins:
        known = -1
    return known, first, length


@inlined
def step_of(value: float, lowest: int, bits: int) -> Any:
    """The level below a value, of 2^`bits` between two powers of two, and where it stands between that and the next.

    Level 1 is 2^`lowest`; below that there is one step, down to 0.
    """
    fine = np.uint64(_MANTISSA_BITS - bits)
    word: Any = _bits(value)
    step = np.int64(word >> fine) - (np.int64(_BIAS + lowest) << np.int64(bits))
    rest = np.int64(word & ((np.uint64(1) << fine) - np.uint64(1)))
    above: Any
    level, above = step + 1, rest * 2.0 ** -np.float64(np.int64(fine))
    if step < 0:
        level, above = np.int64(0), value * 2.0**-lowest
    return level, above


@inlined
def level_of(levels: Levels, background: float) -> Any:
    """The level below a background, and where that stands between it and the next, in parts of one."""
    level, above = np.int64(0), 0.0
    if not levels.single:
        level, above = step_of(background, levels.lowest, levels.bits)
        level -= levels.first
    return level, above


@kernel
def ask(levels: Levels, level: int, above: float, wanted: npt.NDArray[np.bool_]) -> None:
    """Put down which of the libraries of a level and of the next, where that counts, are not there."""
    last = levels.filled.shape[1] - 1
    for k in range(2 if above > 0.0 else 1):
        if not levels.filled[level + k, last]:
            wanted[level + k, last] = True


@inlined
def alarm_rate_of(levels: Levels, level: int, above: float) -> Any:
    """Clumps a bin that background alone makes, between two levels."""
    return levels.alarms[level, 0] + above * (levels.alarms[level, 1] + above * levels.alarms[level, 2])


@inlined
def chance_of_any(mean: float) -> float:
    """1 - exp(-mean), where the mean is below 1."""
    return mean * (1.0 - mean / 2.0 * (1.0 - mean / 3.0 * (1.0 - mean / 4.0 * (1.0 - mean / 5.0 * (1.0 - mean / 6.0)))))


@inlined
def is_lit(tables: Tables, signal: float) -> bool:
    """Whether one of several pulses makes any avalanche."""
    return signal > tables.dark


@kernel
def _several(
    tables: Tables, levels: Levels, level: int, pulses: SeveralPulses, i: Any, wanted: npt.NDArray[np.bool_]
) -> Any:
    """Whether the samples of a beam's pulses see bins of their own: `SEVERAL`, else `EXACT`."""
    code, lit = _SEVERAL, 0
    for j in range(pulses.first[i], pulses.first[i + np.uint64(1)]):
        if not is_lit(tables, pulses.signal[j]):
            continue
        lit += 1
        block, first, length = bins_of(tables, pulses.range_m[j], pulses.signal[j])
        if block < 0 or lit > tables.most_pulses:
            return _EXACT
        if not levels.filled[level, block]:
            wanted[level, block] = True
        for k in range(pulses.first[i], j):
            if is_lit(tables, pulses.signal[k]):
                _, other, reach = bins_of(tables, pulses.range_m[k], pulses.signal[k])
                if first < other + reach + tables.gap and other < first + length + tables.gap:
                    code = _EXACT
    return code


@inlined
def _find_place(
    tables: Tables,
    levels: Levels,
    key: tuple[Any, Any, Any],
    beam: Any,
    range_m: float,
    signal: float,
    background: float,
    pulses: SeveralPulses,
    i: Any,
    wanted: npt.NDArray[np.bool_],
) -> Any:
    """Where a beam's sample stands, in which library, and why the beam is special before that sample is known."""
    x0, x1, x2, x3 = philox(key[0], key[1], 0, beam, key[2], 0)
    elsewhere, place = tables.bins, _NOTHING
    lower, above = level_of(levels, background)
    code = np.uint64(levels.ready[lower, 1 if above > 0.0 else 0])
    if code == _TABLE:
        ask(levels, lower, above, wanted)
    level = lower + (1 if unit(x2 << np.uint64(tables.sample_bits)) < above else 0)
    if code == _ZERO and signal < 0.0:
        code = _several(tables, levels, level, pulses, i, wanted)
    elif code == _ZERO and signal > 0.0:
        known, _, length = bins_of(tables, range_m, signal)
        if known < 0:
            code = _EXACT
        elif not levels.filled[level, known]:
            wanted[level, known] = True
        else:
            place = place_of(tables, signal, range_m * tables.bins_per_m, x0, x1, x2)
            elsewhere = tables.bins - length
    if code == _ZERO and unit(x3) < chance_of_any(alarm_rate_of(levels, lower, above) * elsewhere):
        code = _ALARM
    return place, np.uint64(level), code


@kernel
def draw_beams(
    tables: Tables,
    levels: Levels,
    key: tuple[Any, Any, Any],
    layer: ColumnArray,
    point: ColumnArray,
    range_m: FloatArray,
    signal: FloatArray,
    background: FloatArray,
    pulses: SeveralPulses,
    start: int,
    stop: int,
    drawn: WordArray,
    special: IndexArray,
    wanted: npt.NDArray[np.bool_],
) -> Any:
    """What the beams `start` ... `stop - 1` draw, into `drawn`; rows of special ones into `special` from `start` on.

    `key`: seed, purpose and frame. `background`: of each beam, of none where there is a single library. Returns how
    many are plain beams with an echo, and how many are special. Libraries that are not there and blocks that are not
    filled are put down in `wanted`, as in `Levels.filled`, and their beams are not drawn.
    """
    plain: Any = 0
    odd = start
    for low in range(start, stop, _BATCH):
        high = min(low + _BATCH, stop)
        for row in range(low, high):
            i = np.uint64(row)
            around = 0.0 if levels.single else background[i]
            beam = beam_key(layer[i], point[i])
            place, level, code = _find_place(
                tables, levels, key, beam, range_m[i], signal[i], around, pulses, i, wanted
            )
            drawn[i] = place << _PLACE_AT | level << _LIBRARY_AT | code
        for row in range(low, high):
            i = np.uint64(row)
            place, level, code = drawn[i] >> _PLACE_AT, drawn[i] >> _LIBRARY_AT & _LIBRARY, drawn[i] & _CODE
            word = _ZERO if place == _NOTHING else _word_at(levels.words_at[level], place)
            if (word & _KIND) == _MANY and code == _ZERO:
                code = _TABLE
            if code > _ZERO:
                drawn[i] = _SPECIAL | code << _CODE_AT | level << _LIBRARY_AT | place << _PLACE_AT
                special[odd] = row
                odd += 1
            else:
                drawn[i] = word
                plain += np.int64(word & _ONE)
    return plain, odd - start
