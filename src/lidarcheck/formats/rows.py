"""The rows of a text file as columns of numbers, piece by piece: a fast path, and a slow one that finds what is odd.

A piece is at most a megabyte of whole lines, so that memory beside the columns is bounded; a longer line is refused.
The fast path hands a piece to compiled code, where that is loaded or the file is large, and what this does not take to
pyarrow, on one thread. Letters there are those of NaN and infinity or stand in columns that are left out, so that none
of pyarrow's leniency (nulls, quotes, hexadecimal) can apply. What neither takes, the slow path reads cell by cell: it
names the line and column of what is wrong, or learns which column cannot be read.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.cells import CellFault, line_fault, slow_columns
from lidarcheck.formats.growing import EXACT_IN_FLOAT, INEXACT, GrowingColumn
from lidarcheck.formats.limits import check_rows
from lidarcheck.formats.names import is_needed, leave_out
from lidarcheck.formats.source import LONGEST_LINE, long_line
from lidarcheck.formats.table import Column, quoted

if TYPE_CHECKING:
    from lidarcheck.formats.compiled_rows import PlainRows

__all__ = ["REAL_COLUMNS", "TextRows", "end_of_rows", "parse_rows", "warn_of_open_end", "worth_compiled"]

_log = logging.getLogger(__name__)

REAL_COLUMNS = frozenset(("x", "y", "z", "range", "width", "area", "peak", "distance", "incidenceangle"))
"""Columns that hold real numbers even where every value happens to be whole; in lower case."""

_PLAIN = b"0123456789+-.eE\r\n"
_NOT_FINITE_LETTERS = b"naifytNAIFYT"
_TAB_TO_BLANK = bytes.maketrans(b"\t", b" ")
_BLANK = b" \t\r\n"
_WORTH_COMPILED, _WORTH_COMPILERS = 16 << 20, 128 << 20
"""Bytes from which on compiled code is called, and from which on compilers are loaded for it."""


Cast = Callable[[str, Column], "Column | tuple[int, str]"]


@dataclass(frozen=True, slots=True)
class TextRows:
    """The rows' bytes and what they should hold.

    `source[start:end]`: from the first row to the end of the last one. `names`: one a column. `delimiter`: `" "` stands
    for any number of blanks and tabs, else a comma, a semicolon or a tab. `first_line`: the first row's line.
    `cast`: what makes the type that a header names of a column's values, or says of which row, and why, it cannot.
    """

    source: bytes
    start: int
    end: int
    names: Sequence[str]
    delimiter: str
    path: Path
    first_line: int
    cast: Cast | None = None

    def line_at(self, place: int) -> int:
        """The line that begins at this byte of the source."""
        ends = self.source.count(b"\n", self.start, place) + self.source.count(b"\r", self.start, place)
        return self.first_line + ends - self.source.count(b"\r\n", self.start, place)


def end_of_rows(source: bytes, body: int) -> int:
    """Where the last row ends: before the blank lines at the end."""
    tail = max(body, len(source) - 4096)
    left = len(source[tail:].rstrip(_BLANK))
    return tail + left if left else body + len(source[body:].rstrip(_BLANK))


def warn_of_open_end(path: Path) -> None:
    """Log that the last row has no line end: what is left of a number that was cut is a number, too."""
    _log.warning("%s: the last line has no line end; if the file was cut off, its last value is wrong", path)


def parse_rows(rows: TextRows) -> dict[str, Column]:
    """The columns, shape (n,) each: integers where all cells are whole numbers that 64 bits hold, else float64.

    The columns of `REAL_COLUMNS` are always float64; `nan` and `inf` are values. A column that nothing needs and that
    has a cell which is no number is left out. `InputError` names the line and column of whatever else is no row.
    """
    if rows.start >= rows.end:
        return {name: np.empty(0, dtype=np.float64) for name in rows.names}
    reading = _Reading(rows, {name: GrowingColumn() for name in rows.names}, _compiled(rows))
    for start, end in _pieces(rows):
        reading.read(start, end)
    return {name: column.values for name, column in reading.columns.items()}


def _pieces(rows: TextRows) -> Iterator[tuple[int, int]]:
    """Where pieces of whole lines begin and end; `InputError` for a line that is longer than `LONGEST_LINE`."""
    start = rows.start
    while start < rows.end:
        end = _end_of_lines(rows, start)
        yield start, end
        start = end


def _end_of_lines(rows: TextRows, start: int) -> int:
    """Where the last line ends that ends within the length that a line may have."""
    if rows.end - start <= LONGEST_LINE:
        return rows.end
    end = max(rows.source.rfind(mark, start, start + LONGEST_LINE) for mark in (b"\n", b"\r")) + 1
    if not end:
        raise long_line(rows.path, rows.line_at(start))
    # A line end of two bytes is not cut in two.
    return end + (rows.source[end - 1 : end + 1] == b"\r\n")


@dataclass(slots=True)
class _Reading:
    """What has been read so far: the columns, and which are left out."""

    rows: TextRows
    columns: dict[str, GrowingColumn]
    compiled: PlainRows | None = None
    odd: set[str] = field(default_factory=set)
    tidied: int = 0

    def read(self, start: int, end: int) -> None:
        columns = self._fast(self.rows.source[start:end])
        if columns is None:
            columns = self._slow(start, end)
        left = (self.rows.end - end) / (end - start)
        for name, column in columns.items():
            values = self.rows.cast(name, column) if self.rows.cast else column
            if isinstance(values, tuple):
                self._leave_out(name, values[1], self.rows.line_at(start) + values[0])
            elif not self.columns[name].add(values, left):
                self._leave_out(name, INEXACT, self.rows.line_at(start))
        found = max((len(column.values) for column in self.columns.values()), default=0)
        check_rows(found, len(self.columns), self.rows.path, says="it holds more than" if left else "it holds")

    def _slow(self, start: int, end: int) -> dict[str, Column]:
        rows = self.rows
        found = slow_columns(rows.source[start:end], rows.names, rows.delimiter, REAL_COLUMNS, self.odd)
        if isinstance(found, CellFault):
            line = rows.line_at(start) + found.index
            raise line_fault(found, rows.names, rows.delimiter, rows.path, line, last=found.last and end == rows.end)
        columns, odd = found
        for name, (index, why) in odd.items():
            self._leave_out(name, why, rows.line_at(start) + index)
        return columns

    def _leave_out(self, name: str, why: str, line: int) -> None:
        if is_needed(name):
            fix = "correct it, or the type in the header" if self.rows.cast else "write whole numbers alone"
            raise InputError(f"{quoted(name)} is {why}", file=self.rows.path, line=line, fix=fix)
        self.odd.add(name)
        del self.columns[name]
        leave_out(self.rows.path, name, f"in line {line} it is {why}")

    def _fast(self, piece: bytes) -> dict[str, Column] | None:
        """The columns by compiled code or pyarrow; None when the slow path has to look."""
        for number, way in enumerate(_tidied(piece, self.rows.delimiter)[self.tidied :], start=self.tidied):
            text = way()
            columns = None if self.compiled is None or self.odd else self.compiled.columns(text)
            if columns is None:
                columns = fast_columns(text, self.rows.names, self.rows.delimiter, self.odd)
            if columns is not None:
                self.tidied = number
                return columns
        return None


def worth_compiled(size: int) -> bool:
    """Whether compiled code saves time with so many bytes of rows."""
    return size >= (_WORTH_COMPILED if "numba" in sys.modules else _WORTH_COMPILERS)


def _compiled(rows: TextRows) -> PlainRows | None:
    """What reads plain rows by compiled code, where they are worth it."""
    if not worth_compiled(rows.end - rows.start):
        return None
    from lidarcheck.formats.compiled_rows import PlainRows

    return PlainRows(rows.names, rows.delimiter, [name.casefold() in REAL_COLUMNS for name in rows.names])


def _tidied(piece: bytes, delimiter: str) -> list[Any]:
    """The piece as it is, then with plainer blanks: pyarrow refuses odd ones sooner than a search finds them."""
    if delimiter != " ":
        return [lambda: piece]
    return [lambda: piece, lambda: piece.translate(_TAB_TO_BLANK), lambda: single_blanks(piece)]


def fast_columns(body: bytes, names: Sequence[str], delimiter: str, odd: set[str]) -> dict[str, Column] | None:
    """The columns that are not `odd`, by pyarrow; None where the slow path has to look."""
    import pyarrow as pa
    from pyarrow import csv

    blanks = b" " if delimiter in ",;" else b""
    plain = _PLAIN + blanks + (b"\t" if delimiter in ",;" else b"") + delimiter.encode()
    letters = body.translate(None, plain)
    if letters and (delimiter == " " and b"\t" in letters):
        return None
    unlike = letters.translate(None, _NOT_FINITE_LETTERS)
    if unlike and not odd:
        return None
    types: dict[str, Any] = {name: pa.float64() for name in names if name.casefold() in REAL_COLUMNS}
    types |= {name: pa.binary() for name in odd}
    try:
        table = csv.read_csv(
            pa.BufferReader(body),
            csv.ReadOptions(use_threads=False, block_size=len(body) + 1, column_names=list(names)),
            csv.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(column_types=types, null_values=[], true_values=[], false_values=[]),
        )
    except pa.ArrowException:
        return None
    kept = [name for name in names if name not in odd]
    if any(table[name].type not in (pa.int64(), pa.float64()) or table[name].null_count for name in kept):
        return None
    if len(unlike) != sum(_odd_letters(table[name], plain) for name in odd):
        return None
    columns = {name: table[name].to_numpy() for name in kept}
    return columns if all(_is_exact(name, column, nan=bool(letters)) for name, column in columns.items()) else None


def _odd_letters(column: Any, plain: bytes) -> int:
    """How many bytes of a column of text are none of a number's."""
    return sum(len(cell.translate(None, plain + _NOT_FINITE_LETTERS)) for cell in column.to_pylist())


def _is_exact(name: str, column: Column, *, nan: bool) -> bool:
    """Whether no cell can have lost digits: neither a number beyond floats nor a whole one beyond 2^53."""
    if column.dtype.kind == "i":
        return True
    if nan:
        column = column[~np.isnan(column)]
    if name.casefold() in REAL_COLUMNS or not len(column):
        return bool(np.isfinite(column).all())
    return max(-float(column.min()), float(column.max())) < EXACT_IN_FLOAT


def single_blanks(piece: bytes) -> bytes:
    """The rows with one blank between cells and none around them."""
    text = np.frombuffer(piece.translate(_TAB_TO_BLANK), dtype=np.uint8)
    blank = text == ord(" ")
    needless = blank.copy()
    needless[1:] &= blank[:-1] | (text[:-1] == ord("\n")) | (text[:-1] == ord("\r"))
    body: bytes = text[~needless].tobytes()
    for edge in (b" \n", b" \r"):
        if edge in body:
            body = body.replace(edge, edge[1:])
    return body.rstrip(b" ")
