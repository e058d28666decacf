"""Raw named columns, as a file holds them: what every reader returns and every writer takes.

Each format is one module with `read_NAME(path) -> Table` and `write_NAME(table, path) -> None`. A reader keeps a file's
own spelling and order of the columns and knows nothing of scans; `lidarcheck.formats.scans` and
`lidarcheck.formats.ideals` give the columns their meaning and check it. A reader raises `InputError` for whatever is
wrong with a file, a writer writes through `lidarcheck.formats.atomic`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError, UsageError

__all__ = ["Table", "TextLayout", "check_names", "clock_text", "counted", "quoted"]

Column = npt.NDArray[Any]
NUMBER_KINDS = "biuf"


@dataclass(frozen=True, slots=True)
class TextLayout:
    """How a text file is laid out, to write unedited cells back as they were.

    `source`: the whole file. `delimiter`: `" "` for blanks and tabs, else `","` or `";"`. `body`: where in `source` the
    first row starts. `first_line`: that row's line number, counted from 1; the rows follow without gaps.
    """

    source: bytes
    delimiter: str
    body: int
    first_line: int


@dataclass(frozen=True)
class Table:
    """Equally long columns of numbers by name, in the file's order and spelling.

    `columns`: one-dimensional arrays of booleans, integers or floats, all of shape (n,); no two names differ only in
    case. `path`: the file they come from, for messages. `layout`: only of text files. `edited`: names of columns whose
    values are no longer those of `path`. `origin` (n,): of some of a file's rows, where each stands in it, from 0;
    `first_line`: the line of that file's first row. `height`: rows of an organised cloud, which divide the table's
    evenly; 1 of any other. `stamp_s`: the frame's own time since 1970, where its message has one. `UsageError` when the
    columns do not fit together.
    """

    columns: Mapping[str, Column]
    path: Path | None = None
    layout: TextLayout | None = None
    edited: frozenset[str] = field(default=frozenset())
    origin: npt.NDArray[np.intp] | None = None
    first_line: int | None = None
    height: int = 1
    stamp_s: float | None = None

    def __post_init__(self) -> None:
        repeated = _repeated(self.columns)
        if repeated:
            raise UsageError(f"the column {repeated} appears twice", fix="names must differ in more than case")
        for name, column in self.columns.items():
            if column.dtype.kind not in NUMBER_KINDS or column.shape != (len(self),):
                raise UsageError(f"column {name} is {column.dtype} of shape {column.shape}, not {len(self)} numbers")

    def __len__(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), ()))

    @property
    def names(self) -> tuple[str, ...]:
        """The column names as the file spells them."""
        return tuple(self.columns)

    def spelling(self, name: str) -> str | None:
        """How this table spells a column that is asked for in any case; None when it has no such column."""
        wanted = name.casefold()
        return next((own for own in self.columns if own.casefold() == wanted), None)

    def get(self, name: str) -> Column | None:
        """A column by its name in any case; None when there is none."""
        own = self.spelling(name)
        return None if own is None else self.columns[own]

    def with_column(self, name: str, values: Column) -> Table:
        """The same table with a column replaced or appended; `edited` only where the values differ."""
        own = self.spelling(name) or name
        columns = {**self.columns, own: values}
        if own not in self.columns:
            return replace(self, columns=columns, layout=None)
        same = np.array_equal(self.columns[own], values)
        return replace(self, columns=columns, edited=self.edited if same else self.edited | {own})

    def take(self, rows: npt.NDArray[np.intp]) -> Table:
        """Some of the rows, by ascending indices of shape (m,); errors name them by their place in the file."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        origin = rows if self.origin is None else self.origin[rows]
        first = self.first_line if self.layout is None else self.layout.first_line
        return Table(columns, self.path, origin=origin, first_line=first, stamp_s=self.stamp_s)

    def row_in_file(self, row: int) -> int:
        """Where a row (from 0) stands among the rows of the file, from 0."""
        return row if self.origin is None else int(self.origin[row])

    def line_of(self, row: int) -> int | None:
        """The line of the file that a row (from 0) stands in; None where the file has no lines."""
        first = self.first_line if self.layout is None else self.layout.first_line
        return None if first is None else first + self.row_in_file(row)

    def fault(self, what: str, *, row: int | None = None, fix: str = "") -> InputError:
        """The error to raise for a fault of this table, saying where: by line in a text file, else by row from 1."""
        line = None if row is None else self.line_of(row)
        if row is not None and line is None:
            what = f"row {self.row_in_file(row) + 1}: {what}"
        return InputError(what, file=self.path, line=line, fix=fix)


def check_names(names: Iterable[str], path: Path, line: int | None = None) -> None:
    """Refuse names that are empty, unprintable or differ from another only in case: `InputError`."""
    listed = list(names)
    for number, name in enumerate(listed, start=1):
        if not name:
            raise InputError(f"column {number} has no name", file=path, line=line, fix="name it, or leave it out")
        if not name.isprintable():
            raise InputError(f"column {number} has the unprintable name {quoted(name)}", file=path, line=line)
    repeated = _repeated(listed)
    if repeated:
        fix = "keep one of them; case does not count"
        raise InputError(f"the column {quoted(repeated)} appears twice", file=path, line=line, fix=fix)


def counted(number: int, noun: str, nouns: str = "") -> str:
    """`1 row`, `2 rows`; `nouns`: where the plural is another."""
    return f"{number} {noun}" if number == 1 else f"{number} {nouns or noun + 's'}"


def quoted(text: str | bytes) -> str:
    """Somebody else's text as it can stand in a one-line message: quoted, escaped, cut to 40 characters."""
    plain = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
    return repr(plain if len(plain) <= 40 else plain[:37] + "...")


def _repeated(names: Iterable[str]) -> str | None:
    seen: set[str] = set()
    for name in names:
        if name.casefold() in seen:
            return name
        seen.add(name.casefold())
    return None


def clock_text(seconds: float) -> str:
    """`0:07`, `12:30`, `1:02:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
