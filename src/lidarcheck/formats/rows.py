"""The rows of a text file as columns of numbers: a fast path, and a slow one that names the faulty line.

The fast path hands the bytes to pyarrow, on one thread, after making sure that nothing but numbers and delimiters is in
them, so that none of pyarrow's leniency (nulls, quotes, hexadecimal) can apply. Whatever it does not take goes through
the slow path, which either finds the line that is wrong or reads the rows in plain Python.
"""

from __future__ import annotations

import logging
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.table import Column, counted, quoted

__all__ = ["NUMBER", "REAL_COLUMNS", "TextRows", "parse_rows", "warn_of_open_end"]

REAL_COLUMNS = frozenset(("x", "y", "z", "range", "width", "area", "peak", "distance", "incidenceangle", "time"))
"""Columns that hold real numbers even where every value happens to be whole; in lower case."""

NUMBER = rb"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
_INTEGER = re.compile(rb"-?[0-9]{1,19}")
_DECIMAL_COMMA = re.compile(rb"[+-]?[0-9]+,[0-9]+")
_NOT_FINITE = re.compile(rb"[+-]?(nan|inf|infinity)(\(.*\))?", re.IGNORECASE)
_COUNT_WORDS = rb"zero|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|hundred|thousand|million"
_LIKE_COUNT = re.compile(rb"0[xX][0-9a-fA-F]+|[0-9]+(?:[_'][0-9]+)+|[A-Za-z]+[ \t]*[:=][ \t]*[0-9]+|" + _COUNT_WORDS)
_PLAIN = b"0123456789+-.eE\r\n"
_TAB_TO_BLANK = bytes.maketrans(b"\t", b" ")


_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class TextRows:
    """The rows' bytes and what they should hold.

    `body`: from the first row to the end of the last one. `names`: one a column. `delimiter`: `" "` stands for any
    number of blanks and tabs. `first_line`: the first row's line.
    """

    body: bytes
    names: Sequence[str]
    delimiter: str
    path: Path
    first_line: int


def parse_rows(rows: TextRows) -> dict[str, Column]:
    """The columns, shape (n,) each: int64 where all cells are whole numbers that fit, else float64.

    The columns of `REAL_COLUMNS` are always float64. `InputError` names the first line that is not as many finite
    numbers as there are names.
    """
    if not rows.body:
        return {name: np.empty(0, dtype=np.float64) for name in rows.names}
    for body in _tidied(rows):
        columns = _fast(rows, body)
        if columns is not None:
            return columns
    _check_lines(rows)
    return _slow(rows)


def _tidied(rows: TextRows) -> Iterator[bytes]:
    """The rows as they are, then with plainer blanks: pyarrow refuses odd ones sooner than a search finds them."""
    yield rows.body
    if rows.delimiter == " ":
        if b"\t" in rows.body:
            yield rows.body.translate(_TAB_TO_BLANK)
        yield _single_blanks(rows.body)


def _fast(rows: TextRows, body: bytes) -> dict[str, Column] | None:
    """The columns by pyarrow; None when it does not take them or the slow path has to look."""
    import pyarrow as pa
    from pyarrow import csv

    blanks = b"" if rows.delimiter == " " else b" \t"
    if body.translate(None, _PLAIN + blanks + rows.delimiter.encode()):
        return None
    reals = {name: pa.float64() for name in rows.names if name.casefold() in REAL_COLUMNS}
    try:
        table = csv.read_csv(
            pa.BufferReader(body),
            csv.ReadOptions(use_threads=False, block_size=1 << 22, column_names=list(rows.names)),
            csv.ParseOptions(delimiter=rows.delimiter, quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(column_types=reals, null_values=[], true_values=[], false_values=[]),
        )
    except pa.ArrowException:
        return None
    if any(column.type not in (pa.int64(), pa.float64()) or column.null_count for column in table.columns):
        return None
    columns = {name: column.to_numpy() for name, column in zip(rows.names, table.columns, strict=True)}
    finite = all(column.dtype.kind == "i" or np.isfinite(column).all() for column in columns.values())
    return columns if finite else None


def _single_blanks(body: bytes) -> bytes:
    """The rows with one blank between cells and none around them."""
    text = np.frombuffer(body.translate(_TAB_TO_BLANK), dtype=np.uint8)
    blank = text == ord(" ")
    needless = blank.copy()
    needless[1:] &= blank[:-1] | (text[:-1] == ord("\n")) | (text[:-1] == ord("\r"))
    body = text[~needless].tobytes()
    for edge in (b" \n", b" \r"):
        if edge in body:
            body = body.replace(edge, edge[1:])
    return body.rstrip(b" ")


def _cells(line: bytes, delimiter: str) -> list[bytes]:
    if delimiter == " ":
        return [cell for cell in line.replace(b"\t", b" ").split(b" ") if cell]
    return [cell.strip(b" \t") for cell in line.split(delimiter.encode())]


def _check_lines(rows: TextRows) -> None:
    """Raise for the first line that is not the right number of numbers."""
    between = rb"[ \t]++" if rows.delimiter == " " else rb"[ \t]*+" + rows.delimiter.encode() + rb"[ \t]*+"
    row = re.compile(rb"[ \t]*+" + between.join([NUMBER] * len(rows.names)) + rb"[ \t]*+")
    lines = rows.body.splitlines()
    for index, line in enumerate(lines):
        if not row.fullmatch(line):
            raise _line_fault(rows, line, rows.first_line + index, last=index == len(lines) - 1)


def _line_fault(rows: TextRows, line: bytes, number: int, *, last: bool) -> InputError:
    cells = _cells(line, rows.delimiter)
    expected = len(rows.names)
    plain = _plain_fault(rows, line, cells)
    if plain is not None:
        return InputError(plain[0], file=rows.path, line=number, fix=plain[1])
    if number == 2 and len(cells) < expected and _looks_like_count(line.strip(b" \t")):
        what = f"{quoted(line.strip())} looks like a number of rows"
        return InputError(what, file=rows.path, line=number, fix="write a whole number or leave the line out")
    for name, cell in zip(rows.names, cells, strict=False):
        if not re.fullmatch(NUMBER, cell):
            return _cell_fault(rows, name, cell, number, few=len(cells) < expected)
    what = f"the row has {counted(len(cells), 'value')}, the header names {counted(expected, 'column')}"
    fix = "give every column a value"
    if len(cells) > expected:
        fix = "give every column one value"
        if rows.delimiter == "," and len(cells) == 2 * expected:
            fix = "write decimals with a point, not a comma"
    elif last:
        fix = "was the file cut off?"
    return InputError(what, file=rows.path, line=number, fix=fix)


def _plain_fault(rows: TextRows, line: bytes, cells: list[bytes]) -> tuple[str, str] | None:
    """What is wrong with a line that is no row at all, and what to do; None for what should have been a row."""
    if not line.strip(b" \t"):
        return "the line is blank", "rows must follow each other"
    try:
        line.decode("utf-8")
    except UnicodeDecodeError as error:
        return f"the line is not UTF-8: byte 0x{line[error.start]:02x}", "save the file as UTF-8"
    bare = _cells(re.sub(rb"^[ \t]*(?://|#)[ \t]*", b"", line), rows.delimiter)
    if [cell.strip(b"\"'").decode().casefold() for cell in bare] == [name.casefold() for name in rows.names]:
        return "a second header stands among the rows", "take it out; a file holds one scan"
    return None


def _looks_like_count(text: bytes) -> bool:
    """Whether a line is a number of rows in some spelling other than plain digits."""
    if re.fullmatch(NUMBER, text):
        return float(text).is_integer()
    return _LIKE_COUNT.fullmatch(text.lower()) is not None


def warn_of_open_end(path: Path) -> None:
    """Log that the last row has no line end: what is left of a number that was cut is a number, too."""
    _log.warning("%s: the last line has no line end; if the file was cut off, its last value is wrong", path)


def _cell_fault(rows: TextRows, name: str, cell: bytes, number: int, *, few: bool) -> InputError:
    what, fix = f"{quoted(name)} is {quoted(cell)}, not a number", "give every column a number"
    if not cell:
        what = f"{quoted(name)} has no value"
    elif _NOT_FINITE.fullmatch(cell):
        what, fix = f"{quoted(name)} is {quoted(cell)}, not a finite number", "take the row out or repair the value"
    elif rows.delimiter != "," and _DECIMAL_COMMA.fullmatch(cell):
        fix = "write decimals with a point, not a comma"
    elif few and re.search(rb"[,;]", cell):
        fix = "separate the values as the header separates its names"
    elif cell.startswith((b'"', b"'")):
        fix = "write numbers without quotes"
    return InputError(what, file=rows.path, line=number, fix=fix)


def _slow(rows: TextRows) -> dict[str, Column]:
    """The columns of rows whose lines are known to be right, cell by cell."""
    reals = [array("d") for _ in rows.names]
    wholes: list[array[int] | None] = [None if name.casefold() in REAL_COLUMNS else array("q") for name in rows.names]
    for index, line in enumerate(rows.body.splitlines()):
        for column, cell in enumerate(_cells(line, rows.delimiter)):
            value = float(cell)
            if value in (float("inf"), float("-inf")):
                what = f"{quoted(rows.names[column])} is {quoted(cell)}, beyond the range of a 64-bit float"
                raise InputError(what, file=rows.path, line=rows.first_line + index, fix="use values up to 1.7e308")
            reals[column].append(value)
            whole = wholes[column]
            if whole is not None:
                if _INTEGER.fullmatch(cell) and -(2**63) <= int(cell) < 2**63:
                    whole.append(int(cell))
                else:
                    wholes[column] = None
    columns = [real if whole is None else whole for real, whole in zip(reals, wholes, strict=True)]
    return {name: np.array(column) for name, column in zip(rows.names, columns, strict=True)}
