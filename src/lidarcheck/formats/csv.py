"""CSV: a header of names separated by commas or semicolons, then a row a line. Written with commas."""

from __future__ import annotations

import os
import re

from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import check_header, read_text, rows_as_text, source_as_text

__all__ = ["read_csv", "write_csv"]

_NAME_IN_CSV = re.compile(r"(?!//|#)[^\s,;\"](?:[^,;\"\r\n]*[^\s,;\"])?")


def read_csv(path: str | os.PathLike[str]) -> Table:
    """The columns of a CSV file; numbers with a decimal point, unquoted. `InputError` with file and line."""
    return read_text(path)


def write_csv(table: Table, path: str | os.PathLike[str]) -> None:
    """Write names and rows separated by commas; a table read from CSV keeps its layout and every unedited byte.

    `InputError`, with nothing written, when a name or a value cannot be held.
    """
    if table.layout is not None and table.layout.delimiter in ",;":
        content = source_as_text(table)
    else:
        check_header(table, _NAME_IN_CSV, "commas", path, instead="Parquet")
        content = f"{','.join(table.columns)}\n".encode() + rows_as_text(table, ",")
    with atomic_write(path) as stream:
        stream.write(content)
