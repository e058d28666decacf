"""CloudCompare text: a header, optionally the number of rows, then a row a line. CSV shares its reader.

The header may begin with `//` or `#` and names the columns in any order. Comments before and after it, blanks, tabs,
CRLF, a byte order mark and blank lines at the end are read. What gives the first row as many cells as there are names
separates both, so that names may hold blanks or commas. Everything else that is not a row of numbers is refused with
its line. A table that came from text is written back with every unedited byte as it was.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.cells import NUMBER, cells_of
from lidarcheck.formats.growing import EXACT_IN_FLOAT
from lidarcheck.formats.limits import BYTES_A_CELL, check_rows
from lidarcheck.formats.names import canonical, is_needed, usable_names, writable_names
from lidarcheck.formats.rows import REAL_COLUMNS, TextRows, end_of_rows, parse_rows, warn_of_open_end, worth_compiled
from lidarcheck.formats.source import read_lines
from lidarcheck.formats.table import Column, Table, TextLayout, check_names, counted, quoted

__all__ = ["as_text", "check_header", "delimiter_of", "read_text", "rows_as_text", "source_as_text", "write_text"]

_BOM = b"\xef\xbb\xbf"
_LINE = re.compile(rb"([^\r\n]*)(?:\r\n|\n|\r|\Z)")
_COMMENT = re.compile(r"[ \t]*(?://|#)[ \t]*")
_BLANK = b" \t\r\n"
_BLANKS = (" ", "\t")
_NAME_IN_TEXT = re.compile(r"[^\s,;\"]+")
MOST_COMMENTS = 1000
_BYTES_A_CELL = 8  # about so many, where it is asked what is worth while


def read_text(path: str | os.PathLike[str]) -> Table:
    """The columns of a text file whose header separates names by blanks, tabs, commas or semicolons.

    `InputError` names the file and the line of whatever is not as the module says.
    """
    file = Path(path)
    source = read_lines(file)
    head = _read_head(source, file)
    names = usable_names(head.names, file)
    check_names(names, file, head.line)
    if head.count is not None and head.count * len(names) * BYTES_A_CELL <= len(source):
        check_rows(head.count, len(names), file, line=head.first_line - 1)
    end = end_of_rows(source, head.body)
    columns = parse_rows(TextRows(source, head.body, end, names, head.delimiter, file, head.first_line))
    table = Table(columns, file, TextLayout(source, head.delimiter, head.body, head.first_line))
    if head.count is not None and head.count != len(table):
        what = f"the count line says {counted(head.count, 'row')}, the file has {len(table)}"
        fix = "correct the count" if head.count < len(table) else "correct the count; or was the file cut off?"
        raise InputError(what, file=file, line=head.first_line - 1, fix=fix)
    if head.body < end == len(source):
        warn_of_open_end(file)
    return table


@dataclass(frozen=True, slots=True)
class _Line:
    """A line of the head: its text, its number from 1, where it and the next one begin; `ended` by a line end."""

    text: str
    number: int
    begin: int
    end: int
    ended: bool


@dataclass(frozen=True, slots=True)
class _Head:
    """The header's names and line, how many rows there should be, and where the first of them begins."""

    names: list[str]
    line: int
    delimiter: str
    count: int | None
    body: int
    first_line: int


def _read_head(source: bytes, file: Path) -> _Head:
    """The header and the count line, and where the rows begin."""
    start = len(_BOM) if source.startswith(_BOM) else 0
    lines = _head_lines(source, start, file)
    first = next(lines)
    if not first.text.strip(" \t"):
        what = "the first line is blank" if source[start:].strip(_BLANK) else "the file holds nothing but blanks"
        raise InputError(what, file=file, line=1, fix="begin with a header such as //X Y Z Layer Point")
    comments: list[_Line] = []
    below: _Line | None = first
    while below is not None and _COMMENT.match(below.text):
        comments.append(below)
        below = next(lines, None)
    if below is not None and (not comments or _is_header(below.text)):
        headers, below = [below], _next_row(lines)
    else:
        headers = comments
    count_line = below
    count = None if below is None or not _has_two_names(headers[-1].text) else _count(below, file)
    if count is not None:
        below = _next_row(lines)
    header, delimiter = _best_header(headers, None if below is None else below.text, file)
    if not header.ended:
        raise InputError("the header has no line end", file=file, line=header.number, fix="was the file cut off?")
    last = headers[-1] if count is None or count_line is None else count_line
    at, line = (last.end, last.number + 1) if below is None else (below.begin, below.number)
    return _Head(_names(header.text, delimiter, file, header.number), header.number, delimiter, count, at, line)


def _head_lines(source: bytes, place: int, file: Path) -> Iterator[_Line]:
    """The first lines, the very first as text or refused, the others whatever they are."""
    for number in range(1, MOST_COMMENTS + 1):
        match = _LINE.match(source, place)
        if match is None or (number > 1 and match.start() == len(source)):
            return
        text = _decoded(match[1], file) if number == 1 else match[1].decode("utf-8", "surrogateescape")
        yield _Line(text, number, place, match.end(), match.end() > match.end(1))
        place = match.end()


def _next_row(lines: Iterator[_Line]) -> _Line | None:
    """The next line that is no comment."""
    return next((line for line in lines if not _COMMENT.match(line.text)), None)


def _is_header(text: str) -> bool:
    """Whether a line below comments names columns: several words, none of them a number."""
    words = [word.strip("\"'") for word in re.split(r"[,;\s]+", text.strip()) if word]
    return len(words) > 1 and not any(re.fullmatch(NUMBER, word.encode("utf-8", "replace")) for word in words)


def _has_two_names(header: str) -> bool:
    return len(re.split(r"[,;\s]+", _COMMENT.sub("", header, count=1).strip())) > 1


def _best_header(headers: Sequence[_Line], row: str | None, file: Path) -> tuple[_Line, str]:
    """The line that names the columns of the first row, and what separates the names.

    Of several comments that fit, the one with most names that mean something, and of those the last.
    """
    best = max(headers, key=lambda line: (*_fit(line.text, row), line.number))
    return best, _delimiter(best.text, row)


def _fit(header: str, row: str | None) -> tuple[bool, int]:
    delimiter = _delimiter(header, row)
    names = _split(header, delimiter)
    fits = row is not None and len(names) == len(_text_cells(row, delimiter))
    return fits, sum(is_needed(name) for name in names)


def _delimiter(header: str, row: str | None) -> str:
    """What separates the names: `";"`, `","`, a tab, or `" "` for blanks and tabs.

    Where the header has several of these, that which gives the first row as many cells.
    """
    marks = [mark for mark in ";," if mark in header] + [" "] + ["\t"] * ("\t" in header)
    for mark in marks if row is not None else ():
        if 1 < len(_text_cells(row or "", mark)) == len(_split(header, mark)):
            return mark
    return marks[0]


def _text_cells(row: str, delimiter: str) -> list[str]:
    cells = cells_of(row.encode("utf-8", "surrogateescape"), delimiter)
    return ["" if cell.startswith(b'"') else cell.decode("utf-8", "surrogateescape") for cell in cells]


def delimiter_of(start: bytes) -> str:
    """What separates the names in a file's first bytes; of what is no table, the words of its first line."""
    try:
        return _read_head(start, Path()).delimiter
    except InputError:
        line = start.removeprefix(_BOM).splitlines()[:1]
        return _delimiter(line[0].decode("utf-8", "replace") if line else "", None)


def _decoded(line: bytes, file: Path) -> str:
    """The header's text, or the error that says why this is not text."""
    fix = "save it as UTF-8 text"
    if line.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("the file is UTF-16", file=file, line=1, fix=fix)
    if b"\0" in line:
        raise InputError("the file is binary: its first line holds NUL bytes", file=file, line=1, fix=fix)
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError as error:
        what = f"the header is not UTF-8: byte 0x{line[error.start]:02x} at {error.start + 1}"
        raise InputError(what, file=file, line=1, fix="save the file as UTF-8") from error


def _split(header: str, delimiter: str) -> list[str]:
    """The names of a header line; no names where its quotes do not fit together."""
    bare = _COMMENT.sub("", header, count=1)
    if delimiter == " ":
        return re.split(r"[ \t]+", bare.strip(" \t")) if bare.strip(" \t") else []
    try:
        (cells,) = csv.reader([bare], delimiter=delimiter, skipinitialspace=delimiter != "\t", strict=True)
    except (csv.Error, ValueError):
        return []
    return [cell.strip(" \t") for cell in cells]


def _names(text: str, delimiter: str, file: Path, line: int) -> list[str]:
    names = _split(text, delimiter)
    if not names and _COMMENT.sub("", text, count=1).strip():
        what = "the header's quotes do not fit together"
        raise InputError(what, file=file, line=line, fix="quote a whole name or nothing")
    if not names:
        raise InputError("the header names no columns", file=file, line=line, fix="name them, as //X Y Z Layer Point")
    if all(re.fullmatch(NUMBER, name.encode()) for name in names):
        what = f"the first line holds numbers ({quoted(text)}), not the names of the columns"
        raise InputError(what, file=file, line=line, fix="put a header before it, such as //X Y Z Layer Point")
    return names


def _count(line: _Line, file: Path) -> int | None:
    """The number of rows, where the line after the header is one whole number."""
    text = line.text.strip(" \t")
    if not re.fullmatch(r"[0-9]+", text, re.ASCII):
        return None
    if len(text) > 18:
        what = f"the count line says {quoted(text)}, more rows than any file holds"
        raise InputError(what, file=file, line=line.number, fix="correct the count")
    return int(text)


def write_text(table: Table, path: str | os.PathLike[str]) -> None:
    """Write CloudCompare text: `//` and the names, the number of rows, the rows.

    A table read from such text keeps its layout and every unedited byte. Floats are written with as few digits as give
    the same bits back. `InputError`, with nothing written, when a name or a value cannot be held.
    """
    content = as_text(table, path)
    with atomic_write(path) as stream:
        stream.write(content)


def as_text(table: Table, path: str | os.PathLike[str]) -> bytes:
    """What `write_text` writes."""
    if table.layout is not None and table.layout.delimiter in _BLANKS:
        return source_as_text(table)
    plain = Table(writable_names(table, path, lambda name: _NAME_IN_TEXT.fullmatch(name) is not None))
    header = f"//{' '.join(plain.columns)}\n{len(table)}\n"
    return header.encode() + rows_as_text(plain, " ")


def check_header(
    table: Table, name_fits: re.Pattern[str], separator: str, path: str | os.PathLike[str], *, instead: str
) -> None:
    """Refuse, with an `InputError`, a column name that a header with such separators cannot hold."""
    for name in table.columns:
        if not name_fits.fullmatch(name):
            what = f"the column name {quoted(name)} cannot stand in a header separated by {separator}"
            raise InputError(what, file=path, fix=f"rename the column, or write {instead}")


def rows_as_text(table: Table, delimiter: str) -> bytes:
    """The rows, a line each, that read back as the same values."""
    if not len(table):
        return b""
    columns = [_printable(name, column) for name, column in table.columns.items()]
    plain = [column for column in columns if not isinstance(column, list) and np.can_cast(column.dtype, np.int64)]
    plain += [column for column in columns if not isinstance(column, list) and column.dtype == np.float64]
    if len(plain) < len(columns) or not worth_compiled(len(table) * len(columns) * _BYTES_A_CELL):
        return _by_pyarrow(columns, delimiter)
    from lidarcheck.formats.compiled_text import plain_text

    pieces = plain_text([np.asarray(column) for column in columns], delimiter)
    return b"".join(
        _by_pyarrow([column[rows] for column in columns], delimiter) if text is None else text for rows, text in pieces
    )


def _by_pyarrow(columns: Sequence[Column | list[str]], delimiter: str) -> bytes:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    names = [str(number) for number in range(len(columns))]
    stream = io.BytesIO()
    options = arrow_csv.WriteOptions(include_header=False, delimiter=delimiter, quoting_style="none")
    arrow_csv.write_csv(pa.Table.from_arrays([pa.array(column) for column in columns], names=names), stream, options)
    return stream.getvalue()


def _printable(name: str, column: Column) -> Column | list[str]:
    """A column whose printed form reads back with the same values, and as real numbers where it holds them."""
    if column.dtype.kind == "b":
        return column.astype(np.int64)
    if column.dtype.kind != "f":
        return column
    reals = column.astype(np.float64)
    if name.casefold() not in REAL_COLUMNS and (reals == np.rint(reals))[np.isfinite(reals)].all():
        return [_real_text(value) for value in reals.tolist()]
    return reals


def _real_text(value: float) -> str:
    """A whole number as a real one: with `.0`, or with an exponent where digits alone would promise to be exact."""
    return (
        repr(value)
        if abs(value) < EXACT_IN_FLOAT or not np.isfinite(value)
        else f"{Decimal(repr(value)).normalize():e}"
    )


def source_as_text(table: Table) -> bytes:
    """The bytes that a text table came from, with only the cells of edited columns changed."""
    assert table.layout is not None, "only tables read from text have a source"
    content = table.layout.source
    if table.edited:
        head = _read_head(content, table.path or Path())
        names = [canonical(name)[0] if name not in table.columns else name for name in head.names]
        for name in sorted(table.edited):
            content = _with_cells(content, table.layout, names.index(name), table.columns[name])
    return content


def _with_cells(content: bytes, layout: TextLayout, position: int, column: Column) -> bytes:
    """The content with the cells of one column replaced, those that changed."""
    if layout.delimiter == " ":
        before = rb"[ \t]*+(?:[^ \t\r\n]++[ \t]++){%d}" % position
        cell = rb"[^ \t\r\n]++"
    else:
        mark = layout.delimiter.encode()
        one = rb'(?:[ ]*+"(?:[^"\r\n]|"")*+"[ ]*+|[^\r\n%b]*+)' % mark
        before = rb"(?:%b%b){%d} *+" % (one, mark, position)
        cell = rb"[^\r\n \t%b]++" % mark
    values = iter(column.tolist())
    row = re.compile(rb"(?<![^\r\n])(" + before + rb")(" + cell + rb")")
    head, body = content[: layout.body], content[layout.body :]
    return head + row.sub(lambda match: match[1] + _cell_text(match[2], next(values)), body)


def _cell_text(old: bytes, value: float) -> bytes:
    """The value, with as many decimals as the cell had where both are whole."""
    if float(old) == value:
        return old
    if not np.isfinite(value):
        return repr(value).encode()
    decimals = len(old.partition(b".")[2])
    if value == int(value) and re.fullmatch(rb"[+-]?[0-9]+\.0*", old):
        return f"{value:.{decimals}f}".encode()
    return (str(int(value)) if value == int(value) else repr(value)).encode()
