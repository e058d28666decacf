"""How much a file may hold. Asked before memory is taken: what a file says of itself costs its writer a few bytes.

`--max-rows N` raises or lowers the limit of a command, the environment variable `LIDARCHECK_MAX_ROWS` that of every
process that inherits it: worker processes, the terminal interface, Python.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from lidarcheck.errors import InputError, UsageError

__all__ = [
    "BYTES_A_CELL",
    "CONFIG_BYTES",
    "MAX_ROWS",
    "MESH_BYTES",
    "MESH_CORNERS",
    "MOST_ROWS",
    "RESULT_BYTES",
    "check_bytes",
    "check_rows",
    "limit_rows",
    "max_rows",
    "own_limit",
    "scan_bytes",
]

MAX_ROWS = 50_000_000
"""Rows of a file of points, unless somebody says otherwise: a hundred frames of the reference sensor."""
MOST_ROWS = 10**12
"""The largest limit that can be named."""
NUMBERS_A_ROW = 16
"""So many columns may that number of rows have; a wider table has so many fewer rows."""
BYTES_A_ROW = 256
"""So many bytes of a file may a row take: 16 numbers of 16 characters."""
BYTES_A_CELL = 2
"""Of text at least: a digit and what separates it from the next."""
CONFIG_BYTES = 4 << 20
"""Bytes of a file of settings: TOML, JSON, INI, a profile. A case of ten thousand frames has a quarter of that."""
RESULT_BYTES = 64 << 20
"""Bytes of a result in JSON, and of the part of a GLB mesh that is JSON."""
MESH_BYTES = 256 << 20
"""Bytes of a mesh: five million triangles in STL."""
MESH_CORNERS = 15_000_000
"""Corners of so many triangles, where a file can name the same ones more than once."""
_SETTING = "LIDARCHECK_MAX_ROWS"
_OPTION = "--max-rows N"
_UNITS = ((1, "bytes"), (10**3, "kB"), (10**6, "MB"), (10**9, "GB"))


def max_rows() -> int:
    """Rows that a file of points may have. `UsageError` where the environment names no such number."""
    text = os.environ.get(_SETTING)
    if text is None:
        return MAX_ROWS
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:20]) <= MOST_ROWS):
        raise UsageError(f"{_SETTING} is {text!r}", fix=f"use a whole number from 1 to {MOST_ROWS}")
    return int(text)


def limit_rows(rows: int | None) -> None:
    """From now on, in this process and those that it starts; None changes nothing."""
    if rows is not None:
        os.environ[_SETTING] = str(rows)


@contextlib.contextmanager
def own_limit() -> Iterator[None]:
    """What `limit_rows` says while the block runs ends with it."""
    before = os.environ.get(_SETTING)
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(_SETTING, None)
        else:
            os.environ[_SETTING] = before


def scan_bytes() -> int:
    """Bytes that a file of points may have."""
    return max_rows() * BYTES_A_ROW


def check_rows(
    rows: int, columns: int, path: Path, *, line: int | None = None, says: str = "it says that it holds"
) -> None:
    """`InputError` where a file has, or says that it has, more rows than it may, or more numbers in them."""
    most = max_rows()
    if rows > most:
        fix = f"the limit is {most} rows: {_OPTION}"
        raise InputError(f"{says} {rows} rows{_in_bytes(path)}", file=path, line=line, fix=fix)
    if rows * columns > most * NUMBERS_A_ROW:
        what = f"{says} {rows} rows of {columns} numbers{_in_bytes(path)}"
        fix = f"the limit is {most * NUMBERS_A_ROW} numbers, {NUMBERS_A_ROW} in each of {most} rows: {_OPTION}"
        raise InputError(what, file=path, line=line, fix=fix)


def check_bytes(size: int, path: Path, most: int = CONFIG_BYTES) -> None:
    """`InputError` where a file is larger than what is read as one."""
    if size > most:
        fix = f"the limit is {most} bytes"
        if most == scan_bytes():
            fix += f", {BYTES_A_ROW} for each of {max_rows()} rows: {_OPTION}"
        raise InputError(f"the file has {size} bytes", file=path, fix=fix)


def _in_bytes(path: Path) -> str:
    """` in 785 kB`: what stands behind the claim; nothing where nobody knows."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        return ""
    return next(f" in {size / one:.0f} {unit}" for one, unit in _UNITS if size < 10_000 * one or unit == "GB")
