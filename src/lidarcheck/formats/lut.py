"""Blooming look-up tables: INI text of which every untouched byte is kept.

A file holds a vertical table (`PostPro.LUT_blooming_X` and `_Y`; X in SPAD rows, positive = upward), a horizontal one
(`PostPro.LUT_bloomingH_X` and `_Y`; X in columns of 0.05 deg), or both. The case of the keys is the file's own. X does
not decrease; real files pad the end by repeating the last X. Y, the share of the target's light, lies in [0, 1].

Editors show Y as a whole number s: 0 for Y = 0, else s = round(1000 + log10(Y)/0.007), back Y = 10^(-0.007 (1000 - s)).
1 ... 1000 spans seven decades. The file has 7 decimals, so below about s = 260 neighbouring s may be written alike.
"""

from __future__ import annotations

import codecs
import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.config.words import nearest, shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.formats.lut_scale import scaled_of_y, y_of_scaled
from lidarcheck.formats.source import read_source

__all__ = [
    "Axis",
    "LutFile",
    "LutRow",
    "LutTable",
    "load_lut",
    "parse_lut",
    "save_lut",
]

Axis = Literal["vertical", "horizontal"]

_KEYS: dict[Axis, tuple[str, str]] = {
    "vertical": ("PostPro.LUT_blooming_X", "PostPro.LUT_blooming_Y"),
    "horizontal": ("PostPro.LUT_bloomingH_X", "PostPro.LUT_bloomingH_Y"),
}
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_COMMENT = re.compile(r"[#;]")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


class LutRow(NamedTuple):
    """One row as an editor shows it: the offset, the light's share, and the share as a whole number 0 ... 1000."""

    x: float
    y: float
    scaled: int


class _Cell(NamedTuple):
    """A cell's text and where it stands; `start` counts bytes from the beginning of the file."""

    text: str
    start: int
    line: int


@dataclass(frozen=True)
class LutTable:
    """Offsets `x` and light shares `y`, both of shape (n,), read-only."""

    x: FloatArray
    y: FloatArray
    _cells: tuple[_Cell, ...] = field(repr=False)
    _x_cells: tuple[_Cell, ...] = field(repr=False)

    def __len__(self) -> int:
        return len(self.x)

    def rows(self) -> list[LutRow]:
        """The table row by row."""
        return [LutRow(x, y, scaled_of_y(y)) for x, y in zip(self.x.tolist(), self.y.tolist(), strict=True)]

    def interp(self, x: npt.ArrayLike) -> FloatArray:
        """Y at offsets `x` (any shape), linear in Y between the rows and 0 outside of the table.

        Where an X is repeated Y steps, and the last of its rows holds at X itself.
        """
        return np.asarray(np.interp(np.asarray(x, dtype=np.float64), self.x, self.y, left=0.0, right=0.0))


@dataclass(frozen=True)
class LutFile:
    """A LUT file: its bytes and the tables in them. An edit gives a new one, in which only that cell's text differs."""

    content: bytes
    tables: Mapping[Axis, LutTable] = field(compare=False)
    file: Path | None = field(default=None, compare=False)

    def with_y(self, table: Axis, index: int, value: float) -> LutFile:
        """Row `index` gets Y = `value`, written with 7 decimals; no change where it has that value already.

        `UsageError` when the table or the row does not exist, or `value` is not in [0, 1] or would be written as 0.
        """
        cell = self._cell(table, index)
        if not 0.0 <= value <= 1.0:
            raise UsageError(f"Y = {value:g} is out of range", fix="use a number from 0 to 1")
        if value == self.tables[table].y[index]:
            return self
        text = f"{value:.7f}"
        if value > 0.0 and float(text) == 0.0:
            raise UsageError(f"Y = {value:g} is too small for 7 decimals", fix="use 0 or at least 0.0000001")
        return self._spliced((cell.start, cell.start + len(cell.text), text))

    def with_x(self, table: Axis, index: int, value: float) -> LutFile:
        """Row `index` gets X = `value`; no change where it has that value already.

        `UsageError` that names both neighbours when the value does not lie between them.
        """
        self._cell(table, index)
        x = self.tables[table].x.tolist()
        if value == x[index]:
            return self
        self._check_between(table, value, x[:index][-1:], x[index + 1 :][:1])
        cell = self.tables[table]._x_cells[index]
        return self._spliced((cell.start, cell.start + len(cell.text), _x_text(value)))

    def with_row(self, table: Axis, index: int, x: float, y: float) -> LutFile:
        """A new row after row `index`, -1 for one before the first; errors as `with_x` and `with_y`."""
        beside, own = self._cell(table, max(index, 0)), self.tables[table]
        self._check_between(table, x, own.x.tolist()[max(index, 0) : index + 1], own.x.tolist()[index + 1 :][:1])
        there = own._x_cells[max(index, 0)]
        # With the Y of the row beside it first: `with_y` checks the new one and spells it.
        if index < 0:
            made = self._spliced((*(there.start,) * 2, f"{_x_text(x)}, "), (*(beside.start,) * 2, f"{beside.text}, "))
        else:
            made = self._spliced((*(_end(there),) * 2, f", {_x_text(x)}"), (*(_end(beside),) * 2, f", {beside.text}"))
        return made.with_y(table, index + 1, y)

    def without_row(self, table: Axis, index: int) -> LutFile:
        """Row `index` is taken out; `UsageError` where it is the only one."""
        self._cell(table, index)
        own = self.tables[table]
        if len(own) < 2:
            raise UsageError("a table needs a row", fix="remove the table's two lines from the file instead")
        spans = []
        for cells in (own._x_cells, own._cells):
            first, last = (cells[0], cells[1]) if index == 0 else (cells[index - 1], cells[index])
            ends = (first.start, last.start) if index == 0 else (_end(first), _end(last))
            spans.append((*ends, ""))
        return self._spliced(*spans)

    def _spliced(self, *spans: tuple[int, int, str]) -> LutFile:
        """The bytes from one place to another replaced by a text, for each of the spans."""
        content = self.content
        for start, end, text in sorted(spans, reverse=True):
            content = content[:start] + text.encode() + content[end:]
        return parse_lut(content, self.file)

    def with_scaled(self, table: Axis, index: int, scaled: int) -> LutFile:
        """Row `index` gets the Y of a whole number 0 ... 1000; a number that it shows already changes nothing."""
        self._cell(table, index)
        if scaled == scaled_of_y(float(self.tables[table].y[index])):
            return self
        return self.with_y(table, index, y_of_scaled(scaled))

    def text(self, table: Axis, index: int) -> str:
        """Row `index`'s Y as the file spells it."""
        return self._cell(table, index).text

    def with_texts(self, table: Axis, texts: Mapping[int, str]) -> LutFile:
        """Rows get Y as spelled, all of them or none; `ConfigError` for what is no number from 0 to 1."""
        content = self.content
        for index in sorted(texts, reverse=True):  # from the end, so that earlier cells stay where they are
            cell = self._cell(table, index)
            content = content[: cell.start] + texts[index].encode() + content[cell.start + len(cell.text) :]
        return self if content == self.content else parse_lut(content, self.file)

    def _check_between(self, table: Axis, value: float, before: list[float], after: list[float]) -> None:
        """Refuse an X that is no number or not between those of the rows around it, of which one may be missing."""
        line = self.tables[table]._x_cells[0].line
        if not math.isfinite(value):
            raise UsageError(f"X = {value} is no number", fix="use a number as 2.5", file=self.file, line=line)
        low, high = (f"{end[0]:g}" if end else "" for end in (before, after))
        if any(value < end for end in before) or any(value > end for end in after):
            if low and high:
                what, fix = f"is not between its neighbours, {low} and {high}", f"use a number from {low} to {high}"
            elif low:
                what, fix = f"is below its neighbour, {low}", f"use {low} or more"
            else:
                what, fix = f"is above its neighbour, {high}", f"use {high} or less"
            raise UsageError(f"X = {value:g} {what}", fix=fix, file=self.file, line=line)

    def _cell(self, table: Axis, index: int) -> _Cell:
        if table not in self.tables:
            raise UsageError(f"the file has no {table} table", fix=f"choose {' or '.join(self.tables)}")
        cells = self.tables[table]._cells
        if not 0 <= index < len(cells):
            raise UsageError(f"the {table} table has no row {index}", fix=f"use 0 to {len(cells) - 1}")
        return cells[index]


def _end(cell: _Cell) -> int:
    return cell.start + len(cell.text)


def _x_text(value: float) -> str:
    return f"{value:.10g}"


def load_lut(path: str | os.PathLike[str]) -> LutFile:
    """Read a LUT file. `InputError` when it cannot be read, `ConfigError` with each fault of its tables."""
    return parse_lut(read_source(path, pipes=True), Path(path))


def save_lut(lut: LutFile, path: str | os.PathLike[str]) -> None:
    """Write a LUT file, atomic; what nobody edited has the same bytes as before."""
    write_bytes(path, lut.content)


def parse_lut(content: bytes, file: Path | None = None) -> LutFile:
    """The tables in a LUT file's bytes; errors as `load_lut`, naming `file`."""
    if not content.strip():
        raise InputError("the file is empty", file=file, fix="was it written completely?")
    if b"\0" in content:
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise InputError("this is not a text file in UTF-8 or ASCII", file=file, line=line, fix="save it as UTF-8")
    faults: list[InputError] = []
    entries = _entries(content, file, faults)
    tables: dict[Axis, LutTable] = {}
    for axis, names in _KEYS.items():
        table = _table(entries, names, file, faults)
        if table is not None:
            tables[axis] = table
    if not tables and not faults:
        near = _near_key(entries, [name for names in _KEYS.values() for name in names])
        faults.append(
            InputError("the file has no blooming table", file=file, fix=near or f"add {_KEYS['vertical'][0]} and _Y")
        )
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return LutFile(content, tables, file)


class _Entry(NamedTuple):
    key: str
    line: int
    cells: list[_Cell]


def _entries(content: bytes, file: Path | None, faults: list[InputError]) -> dict[str, _Entry]:
    """All `key = ...` lines by lower-case key."""
    # Latin-1 makes one character of each byte, whatever the file's encoding, so positions are those of the bytes.
    text = content.decode("latin-1")
    ours = {name.lower() for names in _KEYS.values() for name in names}
    entries: dict[str, _Entry] = {}
    first = len(codecs.BOM_UTF8) if content.startswith(codecs.BOM_UTF8) else 0
    for number, match in enumerate(_LINE.finditer(text, first), start=1):
        before, equals, after = match.group().partition("=")
        key = before.strip()
        if not equals or key.startswith(("#", ";", "[")):
            continue
        name = key.lower()
        if name in ours and name in entries:
            fix = f"remove it or line {entries[name].line}"
            faults.append(InputError(f"{key} stands here again", file=file, line=number, fix=fix))
        values = _COMMENT.split(after, maxsplit=1)[0]
        cells = list(_cells(values, match.start() + len(before) + 1, number)) if name in ours else []
        entries.setdefault(name, _Entry(key, number, cells))
    return entries


def _cells(text: str, start: int, line: int) -> Iterator[_Cell]:
    if not text.strip():
        return
    position = 0
    for part in text.split(","):
        offset = len(part) - len(part.lstrip())
        yield _Cell(part.strip(), start + position + offset, line)
        position += len(part) + 1


def _table(
    entries: Mapping[str, _Entry], names: tuple[str, str], file: Path | None, faults: list[InputError]
) -> LutTable | None:
    pair = [entries.get(name.lower()) for name in names]
    if pair[0] is None or pair[1] is None:
        for name, other in zip(names, reversed(pair), strict=True):
            if other is not None:
                fix = _near_key(entries, [name]) or f"add {name} with {len(other.cells)} numbers"
                faults.append(InputError(f"{other.key} has no {name}", file=file, line=other.line, fix=fix))
        return None
    before = len(faults)
    x, y = (_numbers(entry, file, faults) for entry in (pair[0], pair[1]))
    if len(x) != len(y):
        what = f"{pair[1].key} has {len(y)} numbers, {pair[0].key} has {len(x)}"
        faults.append(InputError(what, file=file, line=pair[1].line, fix="give both the same number"))
    _check_order(x, pair[0], file, faults)
    _check_shares(y, pair[1], file, faults)
    return (
        None if len(faults) > before else LutTable(_column(x), _column(y), tuple(pair[1].cells), tuple(pair[0].cells))
    )


def _numbers(entry: _Entry, file: Path | None, faults: list[InputError]) -> list[float]:
    """The cells' values, NaN where one is not a number."""
    if not entry.cells:
        faults.append(
            InputError(f"{entry.key} has no numbers", file=file, line=entry.line, fix="add them, with commas")
        )
    values = []
    for index, cell in enumerate(entry.cells):
        value = float(cell.text) if _NUMBER.fullmatch(cell.text) else math.nan
        if not math.isfinite(value):
            what = f"number {index + 1} of {entry.key} is empty"
            if cell.text:
                what = f"number {index + 1} of {entry.key} is {shown(cell.text)}, not a number"
            faults.append(InputError(what, file=file, line=cell.line, fix="write numbers as 0.5, 0.25"))
            value = math.nan
        values.append(value)
    return values


def _check_order(x: list[float], entry: _Entry, file: Path | None, faults: list[InputError]) -> None:
    for index in range(1, len(x)):
        if x[index] < x[index - 1]:
            what = f"number {index + 1} of {entry.key} is {x[index]:g}, below {x[index - 1]:g} before it"
            faults.append(InputError(what, file=file, line=entry.line, fix="X must not decrease"))


def _check_shares(y: list[float], entry: _Entry, file: Path | None, faults: list[InputError]) -> None:
    for index, value in enumerate(y):
        if value < 0.0 or value > 1.0:
            what = f"number {index + 1} of {entry.key} is {value:g}, out of range"
            faults.append(InputError(what, file=file, line=entry.line, fix="use a number from 0 to 1"))


def _near_key(entries: Mapping[str, _Entry], names: list[str]) -> str:
    """The hint at a misspelled key, empty where none is alike."""
    known = {name.lower() for pair in _KEYS.values() for name in pair}
    for entry in entries.values():
        near = nearest(entry.key, names) if entry.key.lower() not in known else None
        if near:
            return f"did you mean {near} by {shown(entry.key)} in line {entry.line}?"
    return ""


def _column(values: list[float]) -> FloatArray:
    column = np.array(values, dtype=np.float64)
    column.flags.writeable = False
    return column
