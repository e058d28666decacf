"""Rows of numbers as text by compiled code: floats in the fewest digits that read back the same, as pyarrow has them.

Source: R. Giulietti, "The Schubfach way to render doubles" (2020), as A. Bolz has it in Drachennest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.elementary.compiled import bits_of
from lidarcheck.elementary.wide import wide_product, zeros_before
from lidarcheck.formats.table import Column
from lidarcheck.jit import inlined, kernel

__all__ = ["plain_text"]

Bytes = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint64]

_MOST_DOWN, _MOST_UP = 292, 324
_DECIMAL_DOWN, _DECIMAL_UP = -6, 10
"""Powers of the first digit between which pyarrow writes no exponent."""
_BYTES_A_CELL, _ROWS_AT_ONCE = 26, 4096
_NONE, _ONE, _TWO, _TEN, _FORTY = (np.uint64(number) for number in (0, 1, 2, 10, 40))
_ZERO, _MINUS, _POINT, _PLUS, _E, _LINE_END = (ord(mark) for mark in "0-.+e\n")
_WHOLE_TENS = np.array([10**power for power in range(20)], dtype=np.uint64)


def plain_text(columns: Sequence[Column], delimiter: str) -> Iterator[tuple[slice, bytes | None]]:
    """Which rows, and their text as pyarrow writes it: columns of int64 or float64, shape (n,) each, a line a row.

    None in the place of text where a number is not finite.
    """
    is_real = np.array([column.dtype.kind == "f" for column in columns])
    kinds = [[column for column, r in zip(columns, is_real, strict=True) if r == wanted] for wanted in (True, False)]
    out = np.empty(_ROWS_AT_ONCE * len(columns) * _BYTES_A_CELL, dtype=np.uint8)
    for start in range(0, len(columns[0]), _ROWS_AT_ONCE):
        rows = slice(start, min(start + _ROWS_AT_ONCE, len(columns[0])))
        blocks = [
            np.empty((len(some), rows.stop - start), kind) for some, kind in zip(kinds, ("f8", "i8"), strict=True)
        ]
        for some, block in zip(kinds, blocks, strict=True):
            for column, place in zip(some, block, strict=True):
                place[:] = column[rows]
        size = write_rows(blocks[0], blocks[1], is_real, ord(delimiter), _powers_rounded_up(), out)
        yield rows, None if size < 0 else out[:size].tobytes()


@cache
def _powers_rounded_up() -> Words:
    """The first 128 bits of the powers of ten from -`_MOST_DOWN` to `_MOST_UP`, rounded up, shape (n, 2)."""
    found = []
    for power in range(-_MOST_DOWN, _MOST_UP + 1):
        ten = 10 ** abs(power)
        bits = -(-(1 << (ten.bit_length() + 127)) // ten) if power < 0 else -(-(ten << 128) >> ten.bit_length())
        found.append((bits >> 64, bits & (2**64 - 1)))
    return np.array(found, dtype=np.uint64)


@inlined
def _odd_product(high: Any, low: Any, number: Any) -> Any:
    """The upper 64 of the 192 bits of a product; the last one set where bits behind it are."""
    top, middle = wide_product(high, number)
    more, _ = wide_product(low, number)
    middle += more
    top += _ONE if middle < more else _NONE
    return top | (_ONE if middle > _ONE else _NONE)


@inlined
def _shortest(value: Any, powers: Any) -> Any:
    """The fewest digits, and among these the nearest, that read back as a finite float above 0; and their power."""
    scaled = np.rint(value * 1e4)
    if scaled < 1e15 and scaled / 1e4 == value:
        return np.uint64(np.int64(scaled)), -4
    bits = bits_of(value)
    fraction, exponent = bits & ((1 << 52) - 1), bits >> 52
    c = np.uint64(fraction | 1 << 52 if exponent else fraction)
    q = (exponent if exponent else 1) - 1075
    odd = c & _ONE
    closer = fraction == 0 and exponent > 1  # below a power of two floats are half as far apart
    k = (q * 1262611 - (524031 if closer else 0)) >> 22
    shift = np.uint64(q + ((-k * 1741647) >> 19) + 1)
    high, low = powers[_MOST_DOWN - k, 0], powers[_MOST_DOWN - k, 1]
    four = c << _TWO
    below = _odd_product(high, low, (four - (_ONE if closer else _TWO)) << shift) + odd
    middle = _odd_product(high, low, four << shift)
    above = _odd_product(high, low, (four + _TWO) << shift) - odd
    s = middle >> _TWO
    if s >= _TEN:
        tenth = s // _TEN
        down, up = below <= _FORTY * tenth, _FORTY * tenth + _FORTY <= above
        if down != up:
            return tenth + (_ONE if up else _NONE), k + 1
    down, up = below <= s << _TWO, (s + _ONE) << _TWO <= above
    half = (s << _TWO) + _TWO
    up = up if down != up else middle > half or (middle == half and s & _ONE == _ONE)
    return s + (_ONE if up else _NONE), k


@inlined
def _digits_of(number: Any) -> Any:
    """How many digits a whole number has."""
    count = ((64 - zeros_before(number | _ONE)) * 1233) >> 12
    return count + (1 if number >= _WHOLE_TENS[count] else 0) + (1 if number == _NONE else 0)


@inlined
def _put(out: Any, at: Any, number: Any, count: Any) -> Any:
    """Put the last `count` digits of a number; where the next byte goes."""
    for place in range(at + count - 1, at - 1, -1):
        rest = number // _TEN
        out[np.uint64(place)] = np.uint8(number - rest * _TEN) + np.uint8(_ZERO)
        number = rest
    return at + count


@inlined
def _put_real(out: Any, at: Any, value: Any, powers: Any) -> Any:
    """Put a finite float as pyarrow writes it; where the next byte goes."""
    if bits_of(value) < 0:
        out[at] = _MINUS
        at, value = at + 1, -value
    if value == 0.0:
        return _put(out, at, _NONE, 1)
    digits, power = _shortest(value, powers)
    while digits % _TEN == _NONE:
        digits, power = digits // _TEN, power + 1
    count = _digits_of(digits)
    first = count - 1 + power
    if power >= 0 and first < _DECIMAL_UP:
        return _put(out, _put(out, at, digits, count), _NONE, power)
    if _DECIMAL_DOWN <= first < _DECIMAL_UP:
        tens = _WHOLE_TENS[min(-power, 19)]
        whole = digits // tens if power > -20 else _NONE
        at = _put(out, at, whole, max(first + 1, 1))
        out[at] = _POINT
        return _put(out, at + 1, digits - whole * tens, -power)
    tens = _WHOLE_TENS[count - 1]
    at = _put(out, at, digits // tens, 1)
    if count > 1:
        out[at] = _POINT
        at = _put(out, at + 1, digits % tens, count - 1)
    out[at], out[at + 1] = _E, _MINUS if first < 0 else _PLUS
    return _put(out, at + 2, np.uint64(abs(first)), _digits_of(np.uint64(abs(first))))


@kernel
def write_rows(
    reals: FloatArray,
    wholes: npt.NDArray[np.int64],
    is_real: npt.NDArray[np.bool_],
    delimiter: int,
    powers: Words,
    out: Bytes,
) -> int:
    """Put rows, a line each, into `out`; how many bytes these are, -1 where a number is not finite.

    `is_real`, shape (columns,): which columns are the next of `reals`, the others of `wholes`, shape (some, rows) each.
    """
    at, columns = 0, len(is_real)
    for row in range(reals.shape[1]):
        real, whole = 0, 0
        for column in range(columns):
            if is_real[column]:
                value = reals[real, row]
                real += 1
                if not abs(value) < np.inf:
                    return -1
                at = _put_real(out, at, value, powers)
            else:
                number = wholes[whole, row]
                whole += 1
                if number < 0:
                    out[at] = _MINUS
                    at += 1
                size = np.uint64(-number if number < 0 else number)
                at = _put(out, at, size, _digits_of(size))
            out[at] = delimiter if column < columns - 1 else _LINE_END
            at += 1
    return at
