"""Columns of a table by meaning: whole numbers, real numbers, and which of them a file lacks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.table import Column, Table, quoted

__all__ = [
    "INT32_MAX",
    "INT32_MIN",
    "LENGTH_MAX_M",
    "extra_columns",
    "found_columns",
    "missing",
    "real_column",
    "whole_column",
    "with_extra",
]

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
LENGTH_MAX_M = 1e9
"""Beyond any position on earth, in any frame, and far from where squares overflow."""

_LARGEST = float(np.finfo(np.float64).max)


def missing(table: Table, names: Iterable[str]) -> list[str]:
    """Those of the names that the table has no column for, in any case."""
    return [name for name in names if table.spelling(name) is None]


def found_columns(table: Table) -> str:
    """What to add where columns are missing: ` (found: A, B, C)`, at most 12 of them."""
    names = [name if name.isprintable() and len(name) <= 40 else quoted(name) for name in table.names]
    more = f" and {len(names) - 12} more" if len(names) > 12 else ""
    return f" (found: {', '.join(names[:12])}{more})" if names else ""


def whole_column(
    table: Table, name: str, low: int, high: int, *, where: npt.NDArray[np.bool_] | None = None
) -> npt.NDArray[np.int32]:
    """A column of whole numbers from `low` to `high`, shape (n,), checked `where` that is true (0 elsewhere) or
    everywhere.

    `InputError` with the first that is not.
    """
    column = table.get(name)
    assert column is not None, "ask for columns that are there"
    if where is not None:
        column = np.where(where, column, 0)
    if column.dtype.kind in "iu" and (not len(column) or (low <= column.min() and column.max() <= high)):
        return column.astype(np.int32)
    wrong = (column < low) | (column > high)
    if column.dtype.kind == "f":
        wrong |= column != np.rint(column)
    _refuse(table, name, wrong, f"must be a whole number from {low} to {high}")
    return column.astype(np.int32)


def real_column(
    table: Table,
    name: str,
    low: float = -np.inf,
    high: float = np.inf,
    unit: str = "",
    *,
    where: npt.NDArray[np.bool_] | None = None,
    missing_ok: bool = False,
) -> npt.NDArray[np.float64]:
    """A column of finite numbers from `low` to `high`, shape (n,), checked `where` that is true or everywhere.

    `missing_ok`: NaN, a missing value, is none that is wrong. `InputError` with the first that is.
    """
    column = table.get(name)
    assert column is not None, "ask for columns that are there"
    limits = f"at least {low:g}" if np.isinf(high) else f"from {low:g} to {high:g}"
    if np.isinf(low) and np.isinf(high):
        limits = "a finite number"
    low, high = max(low, -_LARGEST), min(high, _LARGEST)
    values: npt.NDArray[np.float64] = column.astype(np.float64)
    if not len(values) or (low <= values.min() and values.max() <= high):  # false where one is NaN
        return values
    wrong = ~((values >= low) & (values <= high))
    if missing_ok:
        wrong &= ~np.isnan(values)
    _refuse(table, name, wrong if where is None else wrong & where, f"must be {limits} {unit}".rstrip())
    return values


def extra_columns(table: Table, known: Iterable[str]) -> dict[str, Column]:
    """The columns that none of the known names stands for, with the file's spelling."""
    lowered = {name.casefold() for name in known}
    return {name: column for name, column in table.columns.items() if name.casefold() not in lowered}


def with_extra(columns: dict[str, Column], extra: Mapping[str, Column], known: Iterable[str]) -> dict[str, Column]:
    """The columns and after them the extra ones; `UsageError` when one of those has a known name, in any case."""
    standard = {name.casefold() for name in known}
    for name in extra:
        if name.casefold() in standard:
            raise UsageError(f"the extra column {name} has the name of a standard column", fix="rename it")
    return {**columns, **extra}


def _refuse(table: Table, name: str, wrong: npt.NDArray[np.bool_], demand: str) -> None:
    rows = np.flatnonzero(wrong)
    if rows.size:
        raise _fault(table, name, int(rows[0]), demand)


def _fault(table: Table, name: str, row: int, demand: str) -> InputError:
    own = table.spelling(name) or name
    value = table.columns[own][row].item()
    return table.fault(f"{own} is {value}", row=row, fix=f"it {demand}")
