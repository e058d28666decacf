"""What is done to a row of `LANES` numbers, one of each beam side by side, in a few instructions for vectors.

The compiler takes loops over so few numbers apart before it looks for vectors, so they are written as vectors here.
Arrays are flat; each row is an array and the index where the row begins. A mask has a bit for each lane, the first
lane's the lowest.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarcheck.model.lane_math import LANES

__all__ = [
    "add_echo",
    "add_row",
    "clear_row",
    "fire_row",
    "how_many",
    "lowest",
    "on_row",
    "open_row",
    "reaching_row",
    "spend_row",
    "take_row",
]

_SHORT, _INT, _LONG = ir.IntType(16), ir.IntType(32), ir.IntType(64)
_SINGLE, _REAL = ir.FloatType(), ir.DoubleType()
_BYTES = {_SHORT: 2, _INT: 4, _SINGLE: 4, _REAL: 8}
_INDEX = types.uint64


class _Rows:
    """The arguments of an intrinsic, whose rows are loaded and stored by the position of their array."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self.context, self.build, self.kinds, self.given = context, builder, signature.args, arguments

    def load(self, position: int, element: Any, offset: int = 0) -> Any:
        return self.build.load(self._place(position, element, offset), align=_BYTES[element])

    def store(self, row: Any, position: int, element: Any, offset: int = 0) -> None:
        self.build.store(row, self._place(position, element, offset), align=_BYTES[element])

    def _place(self, position: int, element: Any, offset: int) -> Any:
        array = self.context.make_array(self.kinds[position])(self.context, self.build, self.given[position])
        index = self.build.add(self.given[position + 1], ir.Constant(_LONG, offset * LANES))
        return self.build.bitcast(self.build.gep(array.data, [index]), ir.VectorType(element, LANES).as_pointer())

    def alike(self, number: Any, element: Any) -> Any:
        """A row of one number."""
        empty = ir.Constant(ir.VectorType(element, LANES), ir.Undefined)
        row = self.build.insert_element(empty, number, ir.Constant(_INT, 0))
        return self.build.shuffle_vector(row, empty, ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES))

    def short(self, position: int) -> Any:
        """A row of the whole number at `position`."""
        return self.alike(self.build.trunc(self.given[position], _SHORT), _SHORT)

    def mask(self, bits: Any) -> Any:
        return self.build.zext(self.build.bitcast(bits, ir.IntType(LANES)), _LONG)


def _how_many(typing_context: Any, mask: Any) -> Any:
    """Lanes of a mask."""
    return _INDEX(_INDEX), lambda context, builder, signature, given: builder.ctpop(given[0])


def _lowest(typing_context: Any, mask: Any) -> Any:
    """The first lane of a mask, which must have one."""

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.cttz(given[0], ir.Constant(ir.IntType(1), 1))

    return _INDEX(_INDEX), codegen


def _clear_row(typing_context: Any, row: Any, first: Any) -> Any:
    """Set a row of 16-bit numbers to 0."""

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        _Rows(context, builder, signature, given).store(ir.Constant(ir.VectorType(_SHORT, LANES), None), 0, _SHORT)
        return context.get_dummy_value()

    return types.none(row, _INDEX), codegen


def _summed(operation: str, to: Any, more: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows = _Rows(context, builder, signature, given)
        rows.store(getattr(builder, operation)(rows.load(0, _SHORT), rows.load(2, _SHORT)), 0, _SHORT)
        return context.get_dummy_value()

    return types.none(to, _INDEX, more, _INDEX), codegen


def _add_row(typing_context: Any, to: Any, first: Any, more: Any, more_first: Any) -> Any:
    """Add a row of 16-bit numbers to another one."""
    return _summed("add", to, more)


def _take_row(typing_context: Any, of: Any, first: Any, less: Any, less_first: Any) -> Any:
    """Subtract a row of 16-bit numbers from another one."""
    return _summed("sub", of, less)


def _spend_row(typing_context: Any, left: Any, first: Any, fired: Any, fired_first: Any) -> Any:
    """Subtract a row of 16-bit numbers from a row in double precision; the lanes whose number falls below 0."""

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows, zero = _Rows(context, builder, signature, given), ir.Constant(ir.VectorType(_REAL, LANES), None)
        now = builder.fsub(rows.load(0, _REAL), builder.sitofp(rows.load(2, _SHORT), zero.type))
        rows.store(now, 0, _REAL)
        return rows.mask(builder.fcmp_ordered("<", now, zero))

    return _INDEX(left, _INDEX, fired, _INDEX), codegen


def _fire_row(typing_context: Any, armed: Any, first: Any, fired: Any, fired_first: Any, to: Any, to_first: Any) -> Any:
    """Write a row of 16-bit numbers, `fired`, to `to` and take it from `armed`."""

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows = _Rows(context, builder, signature, given)
        row = rows.load(2, _SHORT)
        rows.store(builder.sub(rows.load(0, _SHORT), row), 0, _SHORT)
        rows.store(row, 4, _SHORT)
        return context.get_dummy_value()

    return types.none(armed, _INDEX, fired, _INDEX, to, _INDEX), codegen


def _open_row(typing_context: Any, draws: Any, first: Any, rates: Any, rates_first: Any, trials: Any) -> Any:
    """The lanes in which one of so many trials may fire: a draw of at least 1 - trials x rate."""

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows = _Rows(context, builder, signature, given)
        most = builder.fmul(rows.alike(given[4], _REAL), rows.load(2, _REAL))
        quiet_below = builder.fsub(ir.Constant(ir.VectorType(_REAL, LANES), [1.0] * LANES), most)
        return rows.mask(builder.fcmp_ordered(">=", rows.load(0, _REAL), quiet_below))

    return _INDEX(draws, _INDEX, rates, _INDEX, types.float64), codegen


def _reaching_row(typing_context: Any, numbers: Any, first: Any, limit: Any) -> Any:
    """The lanes whose number, in single or double precision, is at or above a limit of the same precision."""
    element = _SINGLE if numbers.dtype == types.float32 else _REAL

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows = _Rows(context, builder, signature, given)
        return rows.mask(builder.fcmp_ordered(">=", rows.load(0, element), rows.alike(given[2], element)))

    return _INDEX(numbers, _INDEX, numbers.dtype), codegen


def _on_row(
    typing_context: Any, lanes: Any, on: Any, counts: Any, first: Any, length: Any, length_first: Any, bin_: Any,
    threshold: Any,
) -> Any:  # fmt: skip
    """The detectors ON in a bin: adds its avalanches to the row `on`; returns the lanes above the threshold.

    Lanes whose window of `length` bins has ended are not among them. The row behind `on` keeps what was ON last.
    """

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows = _Rows(context, builder, signature, given)
        now = builder.add(rows.load(0, _SHORT), rows.load(2, _SHORT))
        rows.store(now, 0, _SHORT)
        inside = builder.icmp_signed(">", rows.load(4, _SHORT), rows.short(6))
        rows.store(builder.select(inside, now, rows.load(0, _SHORT, 1)), 0, _SHORT, 1)
        above = builder.icmp_signed(">", now, rows.short(7))
        return rows.mask(builder.and_(above, inside))

    return _INDEX(lanes, _INDEX, counts, _INDEX, length, _INDEX, types.int64, types.int64), codegen


def _add_echo(
    typing_context: Any, lanes: Any, on: Any, echo: Any, first: Any, moment: Any, moment_first: Any, mask: Any,
    bin_: Any,
) -> Any:  # fmt: skip
    """Add a bin in which detectors are ON to the echoes of the lanes of a mask.

    `echo`: three rows of whole numbers, width, area and peak; `moment`: detectors ON times the bin's number.
    """

    def codegen(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        rows, whole = _Rows(context, builder, signature, given), ir.VectorType(_INT, LANES)
        bits = builder.bitcast(builder.trunc(given[6], ir.IntType(LANES)), ir.VectorType(ir.IntType(1), LANES))
        on = builder.select(bits, builder.zext(rows.load(0, _SHORT), whole), ir.Constant(whole, None))
        rows.store(builder.add(rows.load(2, _INT), builder.zext(bits, whole)), 2, _INT)
        rows.store(builder.add(rows.load(2, _INT, 1), on), 2, _INT, 1)
        peak = rows.load(2, _INT, 2)
        rows.store(builder.select(builder.icmp_signed(">", on, peak), on, peak), 2, _INT, 2)
        number = rows.alike(builder.sitofp(given[7], _REAL), _REAL)
        more = builder.fmul(builder.sitofp(on, ir.VectorType(_REAL, LANES)), number)
        rows.store(builder.fadd(rows.load(4, _REAL), more), 4, _REAL)
        return context.get_dummy_value()

    return types.none(lanes, _INDEX, echo, _INDEX, moment, _INDEX, _INDEX, types.int64), codegen


how_many: Any = intrinsic(_how_many)
lowest: Any = intrinsic(_lowest)
clear_row: Any = intrinsic(_clear_row)
add_row: Any = intrinsic(_add_row)
take_row: Any = intrinsic(_take_row)
fire_row: Any = intrinsic(_fire_row)
spend_row: Any = intrinsic(_spend_row)
open_row: Any = intrinsic(_open_row)
reaching_row: Any = intrinsic(_reaching_row)
on_row: Any = intrinsic(_on_row)
add_echo: Any = intrinsic(_add_echo)
