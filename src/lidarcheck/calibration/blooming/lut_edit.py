"""Edit a blooming table: several cells at once, by row or by X; all that is not edited keeps its bytes.

The editor's scale is the one of the files (`lidarcheck.formats.lut`): whole numbers 0 ... 1000, 0.007 decades a step,
0 for no light.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Any

from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import Axis, LutFile, LutTable
from lidarcheck.formats.lut_scale import SCALE_MAX, scaled_of_y

__all__ = [
    "LutChange",
    "added_at",
    "changes",
    "document",
    "inserted",
    "moved_to",
    "multiplied",
    "rows_at",
    "rows_by_number",
    "set_rows",
    "shifted",
    "smoothed",
    "table_of",
    "taken_over",
    "without_rows",
]

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*(?:\.\.\s*({_NUMBER}))?\s*")


@dataclass(frozen=True)
class LutChange:
    """A row that an edit changed: its X, and Y before and after, NaN where there is no such row. `x_before`: its X
    where that was another. `row`: its number now, of one that was taken out the number it had.
    """

    table: Axis
    row: int
    x: float
    before: float
    after: float
    x_before: float | None = None

    @property
    def scaled(self) -> tuple[int | None, int | None]:
        """The scaled values before and after; None where there is no such row."""
        old, new = (None if math.isnan(y) else scaled_of_y(y) for y in (self.before, self.after))
        return old, new


def table_of(lut: LutFile, name: str | None) -> Axis:
    """The table of that name; the only one where none is named. `UsageError` names those there are."""
    there = list(lut.tables)
    if name is None:
        if len(there) > 1:
            fix = "say which: --table vertical or --table horizontal"
            raise UsageError("the file has two tables", fix=fix, file=lut.file)
        return there[0]
    for axis in there:
        if axis == name:
            return axis
    if name in ("vertical", "horizontal"):
        raise UsageError(f"the file has no {name} table", fix=f"it has a {there[0]} one", file=lut.file)
    raise UsageError(f"there is no table {name!r}", fix="use vertical or horizontal")


def document(lut: LutFile) -> list[dict[str, Any]]:
    """The tables as `lut show --json` prints them."""
    return [
        {"name": axis, "rows": [{"x": row.x, "y": row.y, "scaled": row.scaled} for row in table.rows()]}
        for axis, table in lut.tables.items()
    ]


def rows_by_number(lut: LutFile, table: Axis, text: str) -> list[int]:
    """Rows by number, from 0 as `lut show` counts: `3`, `5..9`, `0,3,5..9`."""
    most = len(lut.tables[table]) - 1
    found: list[int] = []
    for low, high in _ranges(text, "rows"):
        if low != int(low) or high != int(high) or not 0 <= low <= high <= most:
            what = f"rows {text}: the {table} table has rows 0 to {most}"
            raise UsageError(what, fix="use N or N..M, as 5..9", file=lut.file)
        found += range(int(low), int(high) + 1)
    return sorted(set(found))


def rows_at(lut: LutFile, table: Axis, text: str) -> list[int]:
    """Rows by X: `-20`, `-33..-10`, `0,20..60`. A single X must be the table's; of a repeated X all rows count."""
    x = lut.tables[table].x
    found: list[int] = []
    for low, high in _ranges(text, "X"):
        if low > high:
            raise UsageError(f"X {text} runs downward", fix=f"write {high:g}..{low:g}", file=lut.file)
        rows = [row for row, at in enumerate(x.tolist()) if low <= at <= high or math.isclose(at, low, abs_tol=1e-9)]
        if not rows:
            near = min(x.tolist(), key=lambda at: abs(at - low))
            what = f"the {table} table has no X = {low:g}" if low == high else f"no X lies in {low:g}..{high:g}"
            fix = f"the nearest is {near:g}; X goes from {x[0]:g} to {x[-1]:g}"
            raise UsageError(what, fix=fix, file=lut.file)
        found += rows
    return sorted(set(found))


def _ranges(text: str, of: str) -> Iterable[tuple[float, float]]:
    for part in text.split(","):
        match = _RANGE.fullmatch(part)
        if not match:
            raise UsageError(f"{part.strip()!r} names no {of}", fix="use N, N..M, or several with commas: 0,5..9")
        low = float(match[1])
        yield low, low if match[2] is None else float(match[2])


def set_rows(lut: LutFile, table: Axis, rows: Sequence[int], value: str, *, true_y: bool = False) -> LutFile:
    """Rows get a scaled value, 0 or 1 ... 1000, or with `true_y` a Y in [0, 1]; a value they have changes nothing."""
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if true_y:
        if not 0.0 <= number <= 1.0:
            raise UsageError(f"Y = {value} is out of range", fix="use a number from 0 to 1")
        return _each(lut, rows, lambda lut, row: lut.with_y(table, row, number))
    if not (0.0 <= number <= SCALE_MAX and number == int(number)):
        raise UsageError(f"scaled Y = {value} is out of range", fix=f"use a whole number from 0 to {SCALE_MAX}")
    return _each(lut, rows, lambda lut, row: lut.with_scaled(table, row, int(number)))


def shifted(lut: LutFile, table: Axis, rows: Sequence[int], steps: int, *, clip: bool = False) -> LutFile:
    """Rows move by steps on the editor's scale; Y = 0 stays 0. `clip`: stop at 1 and 1000 instead of refusing."""

    def move(lut: LutFile, row: int) -> LutFile:
        now = scaled_of_y(float(lut.tables[table].y[row]))
        if now == 0:
            return lut
        return lut.with_scaled(table, row, _within(lut, table, row, now + steps, 1, SCALE_MAX, clip, "scaled Y"))

    return _each(lut, rows, move)


def multiplied(lut: LutFile, table: Axis, rows: Sequence[int], factor: float, *, clip: bool = False) -> LutFile:
    """Y of rows times a factor, off the editor's grid. `clip`: stop at 1e-7 and 1 instead of refusing."""
    if not (math.isfinite(factor) and factor > 0.0):
        raise UsageError(
            f"the factor {factor:g} is out of range", fix="use a number above 0; set cells to 0 with lut set"
        )

    def move(lut: LutFile, row: int) -> LutFile:
        now = float(lut.tables[table].y[row])
        if now == 0.0:
            return lut
        return lut.with_y(table, row, _within(lut, table, row, now * factor, 1e-7, 1.0, clip, "Y"))

    return _each(lut, rows, move)


def smoothed(lut: LutFile, table: Axis, rows: Sequence[int]) -> LutFile:
    """Rows move half of the way to the line through their neighbours, in log10 Y over X; all from the same table.

    Y = 0, X = 0 (the target itself), the ends of a side and rows that share their X stay; what lies across X = 0 or
    beyond a Y of 0 is no neighbour. A straight line stays as it is.
    """
    x, y = lut.tables[table].x.tolist(), lut.tables[table].y.tolist()
    moved: dict[int, float] = {}
    for row in rows:
        around = (row - 1, row, row + 1)
        if row <= 0 or row >= len(x) - 1 or any(y[i] <= 0.0 or x[i] == 0.0 for i in around):
            continue
        low, here, high = (x[i] for i in around)
        if not low < here < high or low * high < 0.0:
            continue
        left, own, right = (math.log10(y[i]) for i in around)
        line = left + (right - left) * (here - low) / (high - low)
        moved[row] = float(f"{min(10.0 ** (0.5 * (own + line)), 1.0):.7f}")
    for row, value in moved.items():
        if scaled_of_y(value) != scaled_of_y(y[row]):
            lut = lut.with_y(table, row, value)
    return lut


def _within(
    lut: LutFile, table: Axis, row: int, value: Any, low: Any, high: Any, clip: bool, of: str
) -> Any:  # fmt: skip
    if clip or low <= value <= high:
        return min(max(value, low), high)
    x = lut.tables[table].x[row]
    what = f"row {row} (X = {x:g}) would get {of} = {value:g}, which must lie between {low:g} and {high:g}"
    fix = "choose rows with --rows or --x, or stop at the ends with --clip"
    raise UsageError(what, fix=fix, file=lut.file)


def _each(lut: LutFile, rows: Iterable[int], edit: Any) -> LutFile:
    for row in rows:
        lut = edit(lut, row)
    return lut


def changes(before: LutFile, after: LutFile) -> list[LutChange]:
    """The rows that differ, in the file's order: other Y, other X, new ones and such as were taken out."""
    found: list[LutChange] = []
    for axis, table in before.tables.items():
        if axis in after.tables:
            found += _row_changes(axis, table, after.tables[axis])
    return found


def _row_changes(axis: Axis, before: LutTable, after: LutTable) -> Iterator[LutChange]:
    x, y, new_x, new_y = before.x.tolist(), before.y.tolist(), after.x.tolist(), after.y.tolist()
    steps = SequenceMatcher(None, x, new_x, autojunk=False).get_opcodes()
    for kind, start, end, new_start, new_end in steps:
        # Rows that stand in the place of as many others are these with another X.
        if kind == "equal" or end - start == new_end - new_start:
            for row, new in zip(range(start, end), range(new_start, new_end), strict=True):
                if (x[row], y[row]) != (new_x[new], new_y[new]):
                    moved = x[row] if x[row] != new_x[new] else None
                    yield LutChange(axis, new, new_x[new], y[row], new_y[new], moved)
            continue
        yield from (LutChange(axis, row, x[row], y[row], math.nan) for row in range(start, end))
        yield from (LutChange(axis, row, new_x[row], math.nan, new_y[row]) for row in range(new_start, new_end))


def inserted(lut: LutFile, table: Axis, row: int) -> LutFile:
    """A new row after this one: X between the two, by their geometric mean where both have one sign, and Y on the line
    through them in log10 Y over X; after the last row one step further with the same Y.
    """
    x = lut.tables[table].x.tolist()
    if row + 1 >= len(x):
        step = x[row] - x[row - 1] if row > 0 else 0.0
        return _with_row(lut, table, row, x[row] + (step or 1.0))
    low, high = x[row], x[row + 1]
    middle = math.copysign(math.sqrt(low * high), low) if low * high > 0.0 else 0.5 * (low + high)
    return _with_row(lut, table, row, min(max(float(f"{middle:.6g}"), low), high))


def added_at(lut: LutFile, table: Axis, value: str, y: str = "", *, true_y: bool = False) -> LutFile:
    """A new row at this X, in its place, with a scaled value or with `true_y` a Y; without one Y is on the line through
    the rows around it in log10 Y over X, beyond the ends that of the end. An X that is there already is refused.
    """
    at, x = _number(value), lut.tables[table].x.tolist()
    if at in x:
        what = f"row {x.index(at)} of the {table} table has X = {at:g} already"
        raise UsageError(what, fix="set its Y with lut set --at, or repeat it with lut add --after", file=lut.file)
    row = sum(there < at for there in x) - 1
    lut = _with_row(lut, table, row, at)
    return set_rows(lut, table, [row + 1], y, true_y=true_y) if y else lut


def _with_row(lut: LutFile, table: Axis, row: int, at: float) -> LutFile:
    """A new row after this one with that X, and Y on the line through the rows around it."""
    x, y = lut.tables[table].x.tolist(), lut.tables[table].y.tolist()
    if row < 0 or row + 1 >= len(x):
        return lut.with_row(table, row, at, y[max(row, 0)])
    low, high = x[row], x[row + 1]
    part = (at - low) / (high - low) if high > low else 0.5
    if y[row] > 0.0 and y[row + 1] > 0.0:
        value = 10.0 ** ((1.0 - part) * math.log10(y[row]) + part * math.log10(y[row + 1]))
    else:
        value = (1.0 - part) * y[row] + part * y[row + 1]
    return lut.with_row(table, row, at, min(float(f"{value:.7f}"), 1.0))


def taken_over(lut: LutFile, table: Axis, other: LutFile, rows: Sequence[int] | None = None) -> LutFile:
    """The rows of a table, or those of `rows`, with the Y that `other` has at their X, as it is spelled there.

    Of an X that is repeated the first row gets the first Y, and so on; a row that `other` lacks stays as it is.
    """
    theirs = other.tables[table_of(other, table)].x.tolist()
    places: dict[float, list[int]] = {}
    for row, x in enumerate(theirs):
        places.setdefault(x, []).append(row)
    texts = {}
    for row, x in enumerate(lut.tables[table].x.tolist()):
        there = places.get(x)
        if there:
            text = other.text(table, there.pop(0))
            if (rows is None or row in rows) and float(text) != float(lut.tables[table].y[row]):
                texts[row] = text
    return lut.with_texts(table, texts)


def without_rows(lut: LutFile, table: Axis, rows: Sequence[int]) -> LutFile:
    """Without these rows."""
    return _each(lut, sorted(rows, reverse=True), lambda lut, row: lut.without_row(table, row))


def moved_to(lut: LutFile, table: Axis, row: int, value: str) -> LutFile:
    """A row with another X, between those of its neighbours."""
    return lut.with_x(table, row, _number(value))


def _number(value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise UsageError(f"X = {value} is no number", fix="use a number as 2.5 or -20") from None
