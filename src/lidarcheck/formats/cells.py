"""One row of text at a time: its cells, their values, and what is wrong with a line that is no row."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.growing import EXACT_IN_FLOAT, INEXACT
from lidarcheck.formats.names import is_needed
from lidarcheck.formats.table import Column, counted, quoted

__all__ = ["NUMBER", "CellFault", "cells_of", "line_fault", "lines_of", "slow_columns"]

NUMBER = rb"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
_NUMBER = re.compile(NUMBER)
_WHOLE = re.compile(rb"([+-]?[0-9]++)(?:\.0*+)?")
_DECIMAL_COMMA = re.compile(rb"[+-]?[0-9]+,[0-9]+")
_NOT_FINITE = re.compile(rb"([+-]?)(nan|inf|infinity)(?:\([^()]*\))?", re.IGNORECASE)
_COUNT_WORDS = rb"zero|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|hundred|thousand|million"
_LIKE_COUNT = re.compile(rb"0[xX][0-9a-fA-F]+|[0-9]+(?:[_'][0-9]+)+|[A-Za-z]+[ \t]*[:=][ \t]*[0-9]+|" + _COUNT_WORDS)
_LINES = re.compile(rb"([^\r\n]*+)(?:\r\n|\n|\r)|([^\r\n]++)\Z")


@dataclass(frozen=True, slots=True)
class CellFault:
    """A line that is no row: how many lines stand before it, its bytes, and whether it is the last."""

    index: int
    line: bytes
    last: bool


def lines_of(body: bytes) -> Iterator[bytes]:
    """The lines without their ends, one after the other."""
    return (match[1] if match[2] is None else match[2] for match in _LINES.finditer(body))


def cells_of(line: bytes, delimiter: str) -> list[bytes]:
    """The cells of a row, without blanks around them; quotes stay, and what stands between them is one cell."""
    if delimiter == " ":
        return [cell for cell in line.replace(b"\t", b" ").split(b" ") if cell]
    mark = delimiter.encode()
    if b'"' not in line:
        return [cell.strip(b" \t") for cell in line.split(mark)]
    cell = re.compile(rb'([ ]*+"(?:[^"]|"")*+"[ ]*+|[^%b]*+)(?:%b|\Z)' % (mark, mark))
    found, place = [], 0
    while place <= len(line):
        match = cell.match(line, place)
        if match is None:  # a quote that closes in the midst of a cell
            return [cell.strip(b" \t") for cell in line.split(mark)]
        found.append(match[1].strip(b" \t"))
        place = match.end() if match.end() > match.end(1) else len(line) + 1
    return found


def slow_columns(
    body: bytes, names: Sequence[str], delimiter: str, real: frozenset[str], odd: set[str]
) -> tuple[dict[str, Column], dict[str, tuple[int, str]]] | CellFault:
    """The columns cell by cell, without those that are `odd`; and those that turn out to be, with the line and why.

    The first line that is no row is a `CellFault`. Lines are counted from 0.
    """
    cells: dict[str, list[bytes]] = {name: [] for name in names if name not in odd}
    places = {name: (place, is_needed(name)) for place, name in enumerate(names) if name in cells}
    found: dict[str, tuple[int, str]] = {}
    lines = lines_of(body)
    for index, line in enumerate(lines):
        row = cells_of(line, delimiter)
        if len(row) != len(names):
            return CellFault(index, line, next(lines, None) is None)
        for name, (place, needed) in list(places.items()):
            why = _oddness(row[place], needed=needed)
            if why is None:
                cells[name].append(row[place])
            elif needed:
                return CellFault(index, line, next(lines, None) is None)
            else:
                found[name] = index, why
                del places[name], cells[name]
    columns = {}
    for name in places:
        column = _values(cells.pop(name), real=name.casefold() in real)
        if column is None:
            found[name] = 0, INEXACT
        else:
            columns[name] = column
    return columns, found


def _oddness(cell: bytes, *, needed: bool) -> str | None:
    """Why a cell is no value; None where it is one."""
    if _NUMBER.fullmatch(cell):
        may_be_large = len(cell) > 300 or b"e" in cell or b"E" in cell
        return f"{quoted(cell)}, beyond the range of a 64-bit float" if may_be_large and np.isinf(float(cell)) else None
    if _NOT_FINITE.fullmatch(cell) or (not cell and not needed):
        return None
    return f"{quoted(cell)}, not a number"


def _values(cells: list[bytes], *, real: bool) -> Column | None:
    """The cells as whole numbers where they are, else as real ones; None where those would lose digits."""
    if not real and cells:
        spelled = [_WHOLE.fullmatch(cell) for cell in cells]
        wholes = [int(match[1]) for match in spelled if match]
        large = any(abs(whole) > EXACT_IN_FLOAT for whole in wholes)
        plain = all(match is not None and match[1] == match[0] and match[0][:1] != b"+" for match in spelled)
        if len(wholes) == len(cells) and (plain or large):
            low, high = min(wholes), max(wholes)
            for kind in (np.int64, np.uint64):
                if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max:
                    return np.array(wholes, dtype=kind)
        elif large:
            return None
    return np.array([_real(cell) for cell in cells], dtype=np.float64)


def _real(cell: bytes) -> float:
    if not cell:
        return np.nan
    match = _NOT_FINITE.fullmatch(cell)
    return float(match[1] + match[2]) if match else float(cell)


def line_fault(
    fault: CellFault, names: Sequence[str], delimiter: str, path: Path, number: int, *, last: bool
) -> InputError:
    """What is wrong with line `number`, and what to do; `last`: of the whole file."""
    line = fault.line
    cells = cells_of(line, delimiter)
    expected = len(names)
    plain = _plain_fault(names, delimiter, line)
    if plain is not None:
        return InputError(plain[0], file=path, line=number, fix=plain[1])
    if number == 2 and len(cells) < expected and _looks_like_count(line.strip(b" \t")):
        what = f"{quoted(line.strip())} looks like a number of rows"
        return InputError(what, file=path, line=number, fix="write a whole number or leave the line out")
    for name, cell in zip(names, cells, strict=False):
        if is_needed(name) and _oddness(cell, needed=True):
            what, fix = _cell_fault(name, cell, delimiter, few=len(cells) < expected)
            return InputError(what, file=path, line=number, fix=fix)
    what = f"the row has {counted(len(cells), 'value')}, the header names {counted(expected, 'column')}"
    fix = "give every column a value"
    if len(cells) > expected:
        fix = "give every column one value"
        if delimiter == "," and len(cells) == 2 * expected:
            fix = "write decimals with a point, not a comma"
    elif last:
        fix = "was the file cut off?"
    return InputError(what, file=path, line=number, fix=fix)


def _plain_fault(names: Sequence[str], delimiter: str, line: bytes) -> tuple[str, str] | None:
    """What is wrong with a line that is no row at all, and what to do; None for what should have been a row."""
    if not line.strip(b" \t"):
        return "the line is blank", "rows must follow each other"
    try:
        line.decode("utf-8")
    except UnicodeDecodeError as error:
        return f"the line is not UTF-8: byte 0x{line[error.start]:02x}", "save the file as UTF-8"
    bare = cells_of(re.sub(rb"^[ \t]*(?://|#)[ \t]*", b"", line), delimiter)
    if [cell.strip(b"\"'").decode().casefold() for cell in bare] == [name.casefold() for name in names]:
        return "a second header stands among the rows", "take it out; a file holds one scan"
    return None


def _looks_like_count(text: bytes) -> bool:
    """Whether a line is a number of rows in some spelling other than plain digits."""
    if _NUMBER.fullmatch(text):
        return float(text).is_integer()
    return _LIKE_COUNT.fullmatch(text.lower()) is not None


def _cell_fault(name: str, cell: bytes, delimiter: str, *, few: bool) -> tuple[str, str]:
    if _NUMBER.fullmatch(cell):
        return f"{quoted(name)} is {quoted(cell)}, beyond the range of a 64-bit float", "use values up to 1.7e308"
    what, fix = f"{quoted(name)} is {quoted(cell)}, not a number", "give every column a number"
    if not cell:
        what, fix = f"{quoted(name)} has no value", "give every column a value, nan where there is none"
    elif delimiter != "," and _DECIMAL_COMMA.fullmatch(cell):
        fix = "write decimals with a point, not a comma"
    elif few and re.search(rb"[,;]", cell):
        fix = "separate the values as the header separates its names"
    elif cell.startswith((b'"', b"'")):
        fix = "write numbers without quotes"
    return what, fix
