"""The bodies of point files, shared by PCD and PLY: rows of text, or packed records of fixed size.

The header has been read by then and says what a row holds. Nothing here trusts its count: a file that is too short
for it is refused before anything of that size is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError
from lidarcheck.formats.limits import BYTES_A_CELL, check_rows
from lidarcheck.formats.names import writable_names
from lidarcheck.formats.rows import TextRows, end_of_rows, parse_rows, warn_of_open_end
from lidarcheck.formats.table import Table, check_names, counted

__all__ = [
    "HEADER_BYTES",
    "MAX_COLUMNS",
    "MOST_PADDING",
    "Field",
    "RecordLayout",
    "packed_columns",
    "text_columns",
    "writable",
]

Column = npt.NDArray[Any]
MAX_COLUMNS = 10_000
HEADER_BYTES = 4 << 20
"""Bytes in which a header ends: ten thousand columns have names of a few hundred letters then."""
MOST_PADDING = 1 << 20
"""Bytes behind the last row that a writer may have padded a file with."""
EXACT_IN_FLOAT = 2**53


@dataclass(frozen=True, slots=True)
class Field:
    """`count` numbers of one type in every row; `kept` is false for padding, which no table shows."""

    name: str
    dtype: np.dtype[Any]
    count: int = 1
    kept: bool = True

    @property
    def names(self) -> list[str]:
        """The column names: `name`, or `name_0`, `name_1`, ... where the field holds several numbers."""
        return [self.name] if self.count == 1 else [f"{self.name}_{i}" for i in range(self.count)]


@dataclass(frozen=True, slots=True)
class RecordLayout:
    """What a header claims: which fields a row has, how many rows there are, and which line of which file says so.

    `field_lines`: the header's line for each field; empty where the header has no lines.
    """

    fields: tuple[Field, ...]
    count: int
    path: Path
    line: int
    claim: str
    field_lines: tuple[int, ...] = ()

    @property
    def width(self) -> int:
        """Numbers in a row."""
        return sum(f.count for f in self.fields)

    @property
    def dtype(self) -> np.dtype[Any]:
        """One packed record."""
        return np.dtype([(str(i), f.dtype, (f.count,)) for i, f in enumerate(self.fields)])

    def check(self) -> None:
        """Refuse rows that hold nothing, far too much, or two columns of one name: `InputError`."""
        if not any(f.kept for f in self.fields):
            raise InputError("the header names no column", file=self.path, line=self.line, fix="X, Y and Z are needed")
        if self.width > MAX_COLUMNS:
            what = f"a row of {self.width} numbers is beyond what a point has"
            raise InputError(what, file=self.path, line=self.line, fix=f"use at most {MAX_COLUMNS}")
        check_names((name for f in self.fields if f.kept for name in f.names), self.path, self._faulty_line())

    def check_claim(self, size: int, *, packed: bool, last: bool = True) -> None:
        """Hold the count against the bytes that a file has for it, and the limit, before these are read.

        `packed`: records, else a line of text each. `last`: nothing else may follow them. `InputError` says what cannot
        be; of text that is too short for its count, its reader says which line is the last.
        """
        needed = self.count * self.dtype.itemsize if packed else 0
        if size < needed:
            raise self.cut_off(size)
        if last and packed and size - needed > MOST_PADDING:
            raise self.miscounted(f"but {size - needed} bytes follow the last")
        if packed or size >= self.count * self.width * BYTES_A_CELL:
            self.check_limit()

    def check_limit(self) -> None:
        """Hold the count against the limit: `InputError`."""
        check_rows(self.count, self.width, self.path, line=self.line)

    def cut_off(self, bytes_there: int) -> InputError:
        """The error for packed records that end after so many bytes."""
        have, part = divmod(bytes_there, self.dtype.itemsize)
        rest = f" and {part} bytes of another" if part else ""
        return self.miscounted(f"the bytes end after {have}{rest}")

    def _faulty_line(self) -> int | None:
        """The header's line of the first name that is unprintable or stands there again; None where there is none."""
        seen: set[str] = set()
        for field, line in zip(self.fields, self.field_lines, strict=False):
            names = [name.casefold() for name in field.names] if field.kept else []
            if any(name in seen or not name.isprintable() for name in names):
                return line
            seen.update(names)
        return None

    def miscounted(self, found: str) -> InputError:
        """The error for a body that does not hold what the header claims."""
        fix = "the file is cut off or its count is wrong: write it again"
        what = f"{self.claim} {counted(self.count, 'row')}, {found}"
        return InputError(what, file=self.path, line=self.line, fix=fix)


def packed_columns(rows: RecordLayout, body: memoryview) -> dict[str, Column]:
    """The kept columns of packed records, native byte order. `InputError` when `body` is too short."""
    size = rows.dtype.itemsize
    if len(body) < rows.count * size:
        raise rows.cut_off(len(body))
    records = np.frombuffer(body, rows.dtype, rows.count)
    columns: dict[str, Column] = {}
    for i, field in enumerate(rows.fields):
        if field.kept:
            for j, name in enumerate(field.names):
                columns[name] = np.ascontiguousarray(records[str(i)][:, j], dtype=field.dtype.newbyteorder("="))
    return columns


def text_columns(
    rows: RecordLayout, source: bytes, start: int, first_line: int, *, last: bool = True
) -> dict[str, Column]:
    """The kept columns of rows of text, a line each, from byte `start` of the source on.

    `first_line`: the line that begins there. `last`: nothing but blanks may follow the rows. A column that nothing
    needs is left out where a cell is no number of the field's type. `InputError` names the line of a short or long row,
    of any other cell that is none, or of a wrong count.
    """
    end = end_of_rows(source, start) if last else _end_of_claimed(source, start, rows.count)
    fields = [(name, field) for field in rows.fields for name in field.names]
    names = [name if field.kept else f"padding {i}" for i, (name, field) in enumerate(fields, start=1)]
    types = {name: field.dtype for name, (_, field) in zip(names, fields, strict=True)}
    text = TextRows(
        source, start, end, names, " ", rows.path, first_line, lambda name, values: _cast(values, types[name])
    )
    columns = parse_rows(text)
    if not columns:
        return {}  # all are left out, which was said
    found = len(next(iter(columns.values())))
    if found < rows.count:
        raise rows.miscounted(f"the file has {found}")
    if found > rows.count:
        raise rows.miscounted(f"line {first_line + rows.count} is one more")
    if start < end == len(source):
        warn_of_open_end(rows.path)
    kept = {name for name, (_, field) in zip(names, fields, strict=True) if field.kept}
    return {name: values.astype(types[name], copy=False) for name, values in columns.items() if name in kept}


def _end_of_claimed(source: bytes, start: int, count: int) -> int:
    """Where so many lines end, or all that there are."""
    end = start
    for _ in range(count):
        end = source.find(b"\n", end) + 1
        if not end:
            return end_of_rows(source, start)
    return start + len(source[start:end].rstrip(b" \t\r\n"))


def _cast(values: Column, dtype: np.dtype[Any]) -> Column | tuple[int, str]:
    """The values in the type that the header names; else the first row that does not fit, and why."""
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            reals = values.astype(dtype)
        lost = np.isinf(reals) & np.isfinite(values)
        if not lost.any():
            return reals
        row = int(np.argmax(lost))
        return row, f"{values[row]}, beyond the range of a {8 * dtype.itemsize}-bit float"
    low, high = int(np.iinfo(dtype).min), int(np.iinfo(dtype).max)
    if values.dtype.kind == "f":
        low, high = max(low, -EXACT_IN_FLOAT), min(high, EXACT_IN_FLOAT)
        fits = (values == np.rint(values)) & (values >= low) & (values <= high)
    else:
        found = np.iinfo(values.dtype)
        fits = (values >= max(low, found.min)) & (values <= min(high, found.max))
    if fits.all():
        return values.astype(dtype)
    row = int(np.argmin(fits))
    return row, f"{values[row]}, not a whole number from {low} to {high}"


def writable(table: Table, path: str | Path, plain_name: Callable[[str], bool]) -> dict[str, Column]:
    """The columns as 8-bit to 64-bit integers, float32 or float64, native byte order.

    64-bit integers become 32-bit ones where all values fit, as few programs read more than those; booleans become
    bytes, half and long floats float64. Names that the format's header cannot hold get underscores, and the log says
    so; `InputError` where that is no name either.
    """
    if not table.columns:
        raise InputError("there is no column to write", file=path, fix="X, Y and Z are needed")
    columns: dict[str, Column] = {}
    for name, column in writable_names(table, path, plain_name).items():
        if column.dtype.kind == "b":
            column = column.astype(np.uint8)
        elif column.dtype.kind == "f" and column.dtype.itemsize not in (4, 8):
            column = column.astype(np.float64)
        elif column.dtype.kind in "iu" and column.dtype.itemsize == 8:
            column = _narrowed(column)
        columns[name] = np.ascontiguousarray(column, dtype=column.dtype.newbyteorder("="))
    return columns


def _narrowed(column: Column) -> Column:
    """64-bit integers as int32 or uint32 where those hold all values."""
    low, high = (int(column.min()), int(column.max())) if column.size else (0, 0)
    for narrow in (np.int32, np.uint32):
        limits = np.iinfo(narrow)
        if limits.min <= low and high <= limits.max:
            return column.astype(narrow)
    return column
