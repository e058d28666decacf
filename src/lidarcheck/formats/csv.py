"""CSV: a header of names separated by commas or semicolons, then a row a line. Written with commas."""

from __future__ import annotations

import os
import re

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.table import Table, quoted
from lidarcheck.formats.text import read_text, rows_as_text, source_as_text

__all__ = ["read_csv", "write_csv"]

_NAME_IN_CSV = re.compile(r"(?!//|#)[^\s,;\"](?:[^,;\"\r\n]*[^\s,;\"])?")


def read_csv(path: str | os.PathLike[str]) -> Table:
    """The columns of a CSV file; numbers with a decimal point, unquoted. `InputError` with file and line."""
    return read_text(path)


def write_csv(table: Table, path: str | os.PathLike[str]) -> None:
    """Write names and rows separated by commas; a table read from CSV keeps its layout and every unedited byte.

    `InputError`, with nothing written, when a name or a value cannot be held.
    """
    if table.layout is not None and table.layout.delimiter != " ":
        content = source_as_text(table)
    else:
        for name in table.columns:
            if not _NAME_IN_CSV.fullmatch(name):
                what = f"the column name {quoted(name)} cannot stand in a header separated by commas"
                raise InputError(what, file=path, fix="rename the column, or write Parquet")
        content = f"{','.join(table.columns)}\n".encode() + rows_as_text(table, ",", path)
    with atomic_write(path) as stream:
        stream.write(content)
