"""CloudCompare text: a header, optionally the number of rows, then a row a line. CSV shares its reader.

The header may begin with `//` or `#` and names the columns in any order. Blanks, tabs, CRLF, a byte order mark and
blank lines at the end are read; everything else that is not a row of finite numbers is refused with its line. A table
that came from text is written back with every unedited byte as it was.
"""

from __future__ import annotations

import csv
import io
import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.rows import NUMBER, REAL_COLUMNS, TextRows, parse_rows, warn_of_open_end
from lidarcheck.formats.source import read_source
from lidarcheck.formats.table import Column, Table, TextLayout, check_names, counted, quoted

__all__ = ["header_delimiter", "read_text", "rows_as_text", "source_as_text", "write_text"]

_BOM = b"\xef\xbb\xbf"
_LINE = re.compile(rb"([^\r\n]*)(?:\r\n|\n|\r|\Z)")
_BLANK = b" \t\r\n"
_NAME_IN_TEXT = re.compile(r"[^\s,;\"]+")


def read_text(path: str | os.PathLike[str]) -> Table:
    """The columns of a text file whose header separates names by blanks, tabs, commas or semicolons.

    `InputError` names the file and the line of whatever is not as the module says.
    """
    file = Path(path)
    source = read_source(file)
    head = _read_head(source, file)
    end = _end_of_rows(source, head.body)
    columns = parse_rows(TextRows(source[head.body : end], head.names, head.delimiter, file, head.first_line))
    table = Table(columns, file, TextLayout(source, head.delimiter, head.body, head.first_line))
    if head.count is not None and head.count != len(table):
        what = f"the count line says {counted(head.count, 'row')}, the file has {len(table)}"
        fix = "correct the count" if head.count < len(table) else "correct the count; or was the file cut off?"
        raise InputError(what, file=file, line=2, fix=fix)
    if head.body < end == len(source):
        warn_of_open_end(file)
    return table


@dataclass(frozen=True, slots=True)
class _Head:
    names: list[str]
    delimiter: str
    count: int | None
    body: int
    first_line: int


def _read_head(source: bytes, file: Path) -> _Head:
    """The header and the count line, and where the rows begin."""
    start = len(_BOM) if source.startswith(_BOM) else 0
    first = _LINE.match(source, start)
    assert first is not None, "the pattern matches anywhere"
    text = _decoded(first[1], file)
    if not text.strip(" \t"):
        what = "the first line is blank" if source[start:].strip(_BLANK) else "the file holds nothing but blanks"
        raise InputError(what, file=file, line=1, fix="begin with a header such as //X Y Z Layer Point")
    delimiter = header_delimiter(text)
    names = _names(text, delimiter, file)
    if first.end() == first.end(1):
        raise InputError("the header has no line end", file=file, line=1, fix="was the file cut off?")
    second = _LINE.match(source, first.end())
    count = None if second is None or len(names) == 1 else _count(second[1], file)
    if second is None or count is None:
        return _Head(names, delimiter, None, first.end(), 2)
    return _Head(names, delimiter, count, second.end(), 3)


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


def header_delimiter(header: str) -> str:
    """What separates the names of a header line: `";"`, `","`, or `" "` for blanks and tabs."""
    return next((mark for mark in ";," if mark in header), " ")


def _names(text: str, delimiter: str, file: Path) -> list[str]:
    bare = re.sub(r"^[ \t]*(?://|#)?[ \t]*", "", text)
    if delimiter == " ":
        names = re.split(r"[ \t]+", bare.rstrip(" \t")) if bare.strip(" \t") else []
    else:
        try:
            (cells,) = csv.reader([bare], delimiter=delimiter, skipinitialspace=True, strict=True)
        except (csv.Error, ValueError) as error:
            what = f"the header's quotes do not fit together: {error}"
            raise InputError(what, file=file, line=1, fix="quote a whole name or nothing") from error
        names = [cell.strip(" \t") for cell in cells]
    if not names:
        raise InputError("the header names no columns", file=file, line=1, fix="name them, as //X Y Z Layer Point")
    if all(re.fullmatch(NUMBER, name.encode()) for name in names):
        what = f"the first line holds numbers ({quoted(bare)}), not the names of the columns"
        raise InputError(what, file=file, line=1, fix="put a header before it, such as //X Y Z Layer Point")
    check_names(names, file, 1)
    return names


def _count(line: bytes, file: Path) -> int | None:
    """The number of rows, where the line after the header is one whole number."""
    text = line.strip(b" \t")
    if not re.fullmatch(rb"[0-9]+", text):
        return None
    if len(text) > 18:
        what = f"the count line says {quoted(text)}, more rows than any file holds"
        raise InputError(what, file=file, line=2, fix="correct the count")
    return int(text)


def _end_of_rows(source: bytes, body: int) -> int:
    """Where the last row ends: before the blank lines at the end."""
    tail = max(body, len(source) - 4096)
    left = len(source[tail:].rstrip(_BLANK))
    return tail + left if left else body + len(source[body:].rstrip(_BLANK))


def write_text(table: Table, path: str | os.PathLike[str]) -> None:
    """Write CloudCompare text: `//` and the names, the number of rows, the rows.

    A table read from such text keeps its layout and every unedited byte. Floats are written with as few digits as give
    the same bits back. `InputError`, with nothing written, when a name or a value cannot be held.
    """
    if table.layout is not None and table.layout.delimiter == " ":
        content = source_as_text(table)
    else:
        check_header(table, _NAME_IN_TEXT, "blanks", path, instead="CSV or Parquet")
        header = f"//{' '.join(table.columns)}\n{len(table)}\n"
        content = header.encode() + rows_as_text(table, " ", path)
    with atomic_write(path) as stream:
        stream.write(content)


def check_header(
    table: Table, name_fits: re.Pattern[str], separator: str, path: str | os.PathLike[str], *, instead: str
) -> None:
    """Refuse, with an `InputError`, a column name that a header with such separators cannot hold."""
    for name in table.columns:
        if not name_fits.fullmatch(name):
            what = f"the column name {quoted(name)} cannot stand in a header separated by {separator}"
            raise InputError(what, file=path, fix=f"rename the column, or write {instead}")


def rows_as_text(table: Table, delimiter: str, path: str | os.PathLike[str]) -> bytes:
    """The rows, a line each, that read back as the same values; `InputError` for integers beyond 64 bits."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    if not len(table):
        return b""
    arrays = [pa.array(_printable(name, column, path)) for name, column in table.columns.items()]
    stream = io.BytesIO()
    options = arrow_csv.WriteOptions(include_header=False, delimiter=delimiter, quoting_style="none")
    arrow_csv.write_csv(pa.Table.from_arrays(arrays, names=list(table.columns)), stream, options)
    return stream.getvalue()


def _printable(name: str, column: Column, path: str | os.PathLike[str]) -> Column | list[str]:
    """A column whose printed form reads back with the same values, and as real numbers where it holds them."""
    if column.dtype.kind == "b":
        return column.astype(np.int64)
    if column.dtype.kind != "f":
        if column.dtype.itemsize == 8 and column.dtype.kind == "u" and len(column) and column.max() > 2**63 - 1:
            what = f"the column {quoted(name)} holds {column.max()}, text can hold up to {2**63 - 1}"
            raise InputError(what, file=path, fix="write Parquet, or leave the column out")
        return column
    reals = column.astype(np.float64)
    if not np.isfinite(reals).all():
        row = int(np.flatnonzero(~np.isfinite(reals))[0])
        raise InputError(f"row {row + 1}: {quoted(name)} is {reals[row]}, text holds finite numbers", file=path)
    if name.casefold() not in REAL_COLUMNS and (reals == np.rint(reals)).all():
        return [repr(value) for value in reals.tolist()]
    return reals


def source_as_text(table: Table) -> bytes:
    """The bytes that a text table came from, with only the cells of edited columns changed."""
    assert table.layout is not None, "only tables read from text have a source"
    content = table.layout.source
    for name in sorted(table.edited):
        content = _with_cells(content, table.layout, list(table.columns).index(name), table.columns[name])
    return content


def _with_cells(content: bytes, layout: TextLayout, position: int, column: Column) -> bytes:
    """The content with the cells of one column replaced, those that changed."""
    if layout.delimiter == " ":
        before = rb"[ \t]*+(?:[^ \t\r\n]++[ \t]++){%d}" % position
        cell = rb"[^ \t\r\n]++"
    else:
        mark = layout.delimiter.encode()
        before = rb"(?:[^\r\n%b]*+%b){%d}[ \t]*+" % (mark, mark, position)
        cell = rb"[^\r\n \t%b]++" % mark
    values = iter(column.tolist())
    row = re.compile(rb"(?<![^\r\n])(" + before + rb")(" + cell + rb")")
    head, body = content[: layout.body], content[layout.body :]
    return head + row.sub(lambda match: match[1] + _cell_text(match[2], next(values)), body)


def _cell_text(old: bytes, value: float) -> bytes:
    """The value, with as many decimals as the cell had where both are whole."""
    if float(old) == value:
        return old
    decimals = len(old.partition(b".")[2])
    if value == int(value) and re.fullmatch(rb"[+-]?[0-9]+\.0*", old):
        return f"{value:.{decimals}f}".encode()
    return (str(int(value)) if value == int(value) else repr(value)).encode()
