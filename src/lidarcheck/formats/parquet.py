"""Parquet: a column a field, of any type of number. Pages carry checksums, so that damage is noticed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_path
from lidarcheck.formats.limits import check_rows
from lidarcheck.formats.names import is_needed, leave_out
from lidarcheck.formats.source import check_file
from lidarcheck.formats.table import Column, Table, check_names, quoted

__all__ = ["read_parquet", "write_parquet"]


def read_parquet(path: str | os.PathLike[str]) -> Table:
    """The columns with the file's own types; a missing value is NaN.

    A column that nothing needs and that is no number, or has missing values beside whole numbers that no float holds,
    is left out. `InputError` for damage, and for a needed column of either kind.
    """
    import pyarrow as pa
    from pyarrow import parquet

    file = check_file(path)
    try:
        with parquet.ParquetFile(file, page_checksum_verification=True) as stream:
            check_names(stream.schema_arrow.names, file)
            names = _numeric(stream.schema_arrow, file)
            _check_counts(stream.metadata, names, file)
            content = stream.read(columns=names, use_threads=False)
    except (pa.ArrowException, OSError, ValueError, KeyError, IndexError, MemoryError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"damaged or cut off Parquet: {reason}", file=file, fix="write it anew") from error
    columns = {name: _numbers(name, content.column(name), file) for name in content.column_names}
    return Table({name: column for name, column in columns.items() if column is not None}, file)


def _check_counts(metadata: Any, names: list[str], file: Path) -> None:
    """What the footer says of the columns that will be read: pages of a few bytes may stand for any number of rows."""
    check_rows(metadata.num_rows, max(len(names), 1), file)
    wanted, found = set(names), 0
    for number in range(metadata.num_row_groups):
        group = metadata.row_group(number)
        found += group.num_rows
        for column in (group.column(i) for i in range(group.num_columns)):
            if column.path_in_schema in wanted and column.num_values != group.num_rows:
                raise ValueError(
                    f"group {number + 1} has {group.num_rows} rows, but {quoted(column.path_in_schema)} says "
                    f"{column.num_values}"
                )
    if found != metadata.num_rows:
        raise ValueError(f"the footer says {metadata.num_rows} rows, its groups {found}")


def _numeric(schema: Any, file: Path) -> list[str]:
    """The names of the fields that are numbers."""
    import pyarrow as pa

    names = []
    for field in schema:
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            names.append(field.name)
        elif is_needed(field.name):
            what = f"the column {quoted(field.name)} is {quoted(str(kind))}, not a number"
            raise InputError(what, file=file, fix="store it as a number, or leave it out")
        else:
            leave_out(file, field.name, f"it is {quoted(str(kind))}, not a number")
    return names


def _numbers(name: str, column: Any, file: Path) -> Column | None:
    """A field's values as one array; None where it is left out."""
    import pyarrow as pa

    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if column.null_count and not pa.types.is_floating(column.type):
        row = int(np.flatnonzero(column.is_null().to_numpy())[0])
        if is_needed(name):
            what = f"row {row + 1}: {quoted(name)} has no value"
            raise InputError(what, file=file, fix="give every row of it a value")
        try:
            column = column.cast(pa.float64())
        except pa.ArrowException:
            leave_out(file, name, f"row {row + 1} has no value")
            return None
    return np.asarray(column.to_numpy())


def write_parquet(table: Table, path: str | os.PathLike[str]) -> None:
    """Write the columns with their types. `InputError`, with nothing written, when the file cannot be."""
    import pyarrow as pa
    from pyarrow import parquet

    content = pa.table({name: pa.array(column) for name, column in table.columns.items()})
    with atomic_path(path) as temporary:
        parquet.write_table(content, temporary, write_page_checksum=True)
