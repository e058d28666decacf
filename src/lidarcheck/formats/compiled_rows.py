"""Rows of plain numbers read by compiled code, each number the float next to what is written.

Numbers of up to 19 digits: the digits as a whole number, times or by a power of ten. Where both are exact in a float,
so is the rounding of their product or quotient; else the product with the power's first 128 bits is rounded once.
Whatever else a cell holds is left to the readers that say what is wrong.

Source: D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021); that no
number of up to 19 digits needs more bits: N. Mushtak, D. Lemire, "Fast number parsing without fallback" (2023).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.elementary.compiled import from_bits
from lidarcheck.elementary.wide import wide_product, zeros_before
from lidarcheck.formats.growing import EXACT_IN_FLOAT
from lidarcheck.formats.limits import BYTES_A_CELL
from lidarcheck.formats.table import Column
from lidarcheck.jit import inlined, kernel

__all__ = ["PlainRows"]

Bytes = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint64]

LEAST_POWER, MOST_POWER = -342, 308
_EXACT_POWER, _MOST_DIGITS, _WHOLE_DIGITS = 22, 19, 18
_PLAIN = 10**6
_NONE, _ONE, _FIVE, _TEN, _EXACT = (np.uint64(number) for number in (0, 1, 5, 10, EXACT_IN_FLOAT))
_ZERO, _MINUS, _POINT, _PLUS, _E, _TO_LOWER = (ord(mark) for mark in "0-.+e ")
_LINE_END, _RETURN = ord("\n"), ord("\r")
_TENS = np.array([float(10**power) for power in range(_EXACT_POWER + 1)])


class PlainRows:
    """Reads pieces of text whose rows are plain numbers, each behind one `delimiter`, into columns of those `names`."""

    def __init__(self, names: Sequence[str], delimiter: str, real: Sequence[bool]) -> None:
        self._names, self._delimiter, self._real = names, ord(delimiter), np.array(real, dtype=np.bool_)
        self._reals, self._wholes = np.empty((len(names), 0)), np.empty((len(names), 0), dtype=np.int64)

    def columns(self, text: bytes) -> dict[str, Column] | None:
        """The columns, shape (n,) each, until the next call; None where others have to look at the text."""
        most = len(text) // (BYTES_A_CELL * len(self._names)) + 1
        if most > self._reals.shape[1]:
            self._reals = np.empty((len(self._names), most))
            self._wholes = np.empty(self._reals.shape, dtype=np.int64)
        is_real = np.empty(len(self._names), dtype=np.bool_)
        content = np.frombuffer(text, dtype=np.uint8)
        rows = read_rows(content, self._delimiter, self._real, powers_of_ten(), self._reals, self._wholes, is_real)
        if rows < 0:
            return None
        found = (self._reals[i] if is_real[i] else self._wholes[i] for i in range(len(self._names)))
        return {name: column[:rows] for name, column in zip(self._names, found, strict=True)}


@cache
def powers_of_ten() -> Words:
    """The first 128 bits of the powers of five from `LEAST_POWER` to `MOST_POWER`, shape (n, 2): upper, lower.

    Below 1 the last bit is rounded up, above it bits are cut off.
    """
    found = []
    for power in range(LEAST_POWER, MOST_POWER + 1):
        five = 5 ** abs(power)
        if power >= 0:
            bits = (five << 128) >> five.bit_length()
        else:
            bits = (1 << (five.bit_length() + 127)) // five + 1
            bits >>= bits.bit_length() - 128
        found.append((bits >> 64, bits & (2**64 - 1)))
    return np.array(found, dtype=np.uint64)


@inlined
def _rounded(whole: Any, power: Any, powers: Any) -> Any:
    """The float next to `whole` (above 0) times ten to the power; negative where it is not a normal one."""
    zeros = zeros_before(whole)
    w = whole << np.uint64(zeros)
    row = power - LEAST_POWER
    high, low = wide_product(w, powers[row, 0])
    if high & np.uint64(0x1FF) == np.uint64(0x1FF):
        more, _ = wide_product(w, powers[row, 1])
        low += more
        high += np.uint64(1) if low < more else np.uint64(0)
    upper = high >> np.uint64(63)
    shift = upper + np.uint64(9)
    bits = high >> shift
    exponent = ((217706 * power) >> 16) + 63 + np.int64(upper) - zeros + 1023
    half = low <= np.uint64(1) and -4 <= power <= 23 and bits & np.uint64(3) == np.uint64(1)
    if half and bits << shift == high:  # between two floats: to the even one
        bits &= ~np.uint64(1)
    bits = (bits + (bits & np.uint64(1))) >> np.uint64(1)
    if bits >= np.uint64(1 << 53):
        bits, exponent = np.uint64(1 << 52), exponent + 1
    if exponent <= 0 or exponent >= 2047:
        return -1.0
    return from_bits((exponent << 52) | np.int64(bits & np.uint64((1 << 52) - 1)))


@inlined
def _digits(text: Any, i: Any, end: Any, whole: Any) -> Any:
    """Where the digits from `i` on end, and the number that they make behind `whole`."""
    while i < end and np.uint8(text[i] - _ZERO) < 10:
        whole = whole * _TEN + np.uint64(np.uint8(text[i] - _ZERO))
        i += _ONE
    return i, whole


@inlined
def _number(text: Any, i: Any, end: Any) -> Any:
    """Where the number ends that begins at `i`; its sign, digits, power of ten; -1, or how many digits it has.

    Without point and exponent the power is `_PLAIN`.
    """
    negative = i < end and text[i] == _MINUS
    if negative:
        i += _ONE
    first: Any = i
    power: Any = _PLAIN
    i, whole = _digits(text, i, end, _NONE)
    digits: Any = np.int64(i - first)
    if i < end and text[i] == _POINT:
        begin = i + _ONE
        i, whole = _digits(text, begin, end, whole)
        power = -np.int64(i - begin)
        digits -= power
    while digits > _MOST_DIGITS and (text[first] == _ZERO or text[first] == _POINT):
        digits -= text[first] == _ZERO
        first += _ONE
    if i < end and text[i] | _TO_LOWER == _E:
        i += _ONE
        down = i < end and text[i] == _MINUS
        if i < end and (down or text[i] == _PLUS):
            i += _ONE
        begin = i
        i, exponent = _digits(text, i, end, _NONE)
        digits = digits if _NONE < i - begin < _FIVE else -1
        power = (0 if power == _PLAIN else power) + (-np.int64(exponent) if down else np.int64(exponent))
    return i, negative, whole, power, digits


@inlined
def _value(whole: Any, power: Any, powers: Any) -> Any:
    """The float next to `whole` times ten to the power; negative where it is not to be had here."""
    if whole < _EXACT and -_EXACT_POWER <= power <= _EXACT_POWER:
        value = np.float64(np.int64(whole))
        return value / _TENS[-power] if power < 0 else value * _TENS[power]
    if whole == _NONE:
        return 0.0
    return _rounded(whole, power, powers) if LEAST_POWER <= power <= MOST_POWER else -1.0


@inlined
def _after(text: Any, i: Any, end: Any, last: Any, delimiter: Any) -> Any:
    """Where the next cell begins; `i` itself where something else stands there than what ends a cell."""
    if not last:
        return i + _ONE if i < end and text[i] == delimiter else i
    if i < end and text[i] == _RETURN:
        i += _ONE
        return i + _ONE if i < end and text[i] == _LINE_END else i
    return i + _ONE if i >= end or text[i] == _LINE_END else i


@kernel
def _made_real(wholes: npt.NDArray[np.int64], reals: FloatArray) -> bool:
    """Whole numbers as real ones, shape (n,) both; false where one has more digits than these hold."""
    for row in range(len(wholes)):
        if abs(wholes[row]) >= EXACT_IN_FLOAT:
            return False
        reals[row] = np.float64(wholes[row])
    return True


@kernel
def read_rows(
    text: Bytes,
    delimiter: int,
    real: npt.NDArray[np.bool_],
    powers: Words,
    reals: FloatArray,
    wholes: npt.NDArray[np.int64],
    is_real: npt.NDArray[np.bool_],
) -> int:
    """How many rows there are, their cells in `reals` or `wholes`, shape (columns, rows) each; -1 for others to read.

    `is_real`, shape (columns,): in which of the two a column is: whole numbers, unless it is among the `real` ones or
    one of its cells has a point or an exponent. Neither whole numbers of 19 digits nor, in a column that holds both
    kinds, numbers of 2^53 and more are read here.
    """
    columns, rows, i, end = len(real), 0, _NONE, np.uint64(len(text))
    for column in range(columns):
        is_real[column] = real[column]
    while i < end:
        for column in range(columns):
            i, negative, whole, power, digits = _number(text, i, end)
            begin = _after(text, i, end, column == columns - 1, delimiter)
            if begin == i or not 0 < digits <= _MOST_DIGITS:
                return -1
            i = begin
            if power == _PLAIN and not is_real[column]:
                if digits > _WHOLE_DIGITS or (negative and whole == _NONE):
                    return -1
                wholes[column, rows] = -np.int64(whole) if negative else np.int64(whole)
                continue
            value = _value(whole, 0 if power == _PLAIN else power, powers)
            if value < 0.0 or (not real[column] and value >= EXACT_IN_FLOAT):
                return -1
            if not is_real[column]:
                is_real[column] = True
                if not _made_real(wholes[column, :rows], reals[column]):
                    return -1
            reals[column, rows] = -value if negative else value
        rows += 1
    return rows
