"""Parquet: a column a field, of any type of number. Pages carry checksums, so that damage is noticed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_path
from lidarcheck.formats.source import check_file
from lidarcheck.formats.table import Column, Table, check_names, quoted

__all__ = ["read_parquet", "write_parquet"]


def read_parquet(path: str | os.PathLike[str]) -> Table:
    """The columns with the file's own types. `InputError` for damage, missing values and what is not a number."""
    import pyarrow as pa
    from pyarrow import parquet

    file = check_file(path)
    try:
        with parquet.ParquetFile(file, page_checksum_verification=True) as stream:
            check_names(stream.schema_arrow.names, file)
            content = stream.read(use_threads=False)
    except (pa.ArrowException, OSError, ValueError, KeyError, IndexError, MemoryError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"damaged or cut off Parquet: {reason}", file=file, fix="write it anew") from error
    return Table({name: _numbers(name, content.column(name), file) for name in content.column_names}, file)


def _numbers(name: str, column: Any, file: Path) -> Column:
    """A field's values as one array."""
    import pyarrow as pa

    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        what = f"the column {quoted(name)} is {quoted(str(kind))}, not a number"
        raise InputError(what, file=file, fix="store it as a number, or leave it out")
    if column.null_count:
        row = int(np.flatnonzero(column.is_null().to_numpy())[0])
        raise InputError(f"row {row + 1}: {quoted(name)} has no value", file=file, fix="give every column a value")
    return np.asarray(column.to_numpy())


def write_parquet(table: Table, path: str | os.PathLike[str]) -> None:
    """Write the columns with their types. `InputError`, with nothing written, when the file cannot be."""
    import pyarrow as pa
    from pyarrow import parquet

    content = pa.table({name: pa.array(column) for name, column in table.columns.items()})
    with atomic_path(path) as temporary:
        parquet.write_table(content, temporary, write_page_checksum=True)
