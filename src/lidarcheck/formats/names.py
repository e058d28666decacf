"""Column names: which columns a reading rests on, and what vendors' exports call them.

What is needed and cannot be read is refused; any other column that cannot be read is left out, and one line of log says
so. Columns are told apart by name alone, in any case, before their values are looked at.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.table import Column, Table, quoted
from lidarcheck.sensor.beam_table_checks import TABLE_COLUMNS
from lidarcheck.sensor.channels import Channels

__all__ = ["canonical", "is_needed", "leave_out", "usable_names", "with_known_names", "writable_names"]

_log = logging.getLogger(__name__)

NEEDED = frozenset(
    name.casefold()
    for name in (
        *("X", "Y", "Z", "RANGE", "Layer", "Point", "EchoNumber", "ReturnType", "Frame", "frame_id", "FrameNumber"),
        *("WIDTH", "AREA", "PEAK", "INTENSITY", "SIGNAL", "REFLECTIVITY"),
        *("Distance", "MaterialID", "IncidenceAngle", "ObjectID", "Time", "Share", "Reflectance", "ReflectanceError"),
        *("DistanceError", "Azimuth0", "Edge", "CosAngle", "ObjIdx", "ObjTag"),
        *TABLE_COLUMNS,
        *Channels.__dataclass_fields__,
    )
)
"""Columns with a meaning of their own: without one of them a file would be read as something else."""

VENDORS_NAMES = {
    **{f"points_m_xyz:{i}": axis for i, axis in enumerate("XYZ")},  # VeloView
    **{f"points:{i}": axis for i, axis in enumerate("XYZ")},  # ParaView
    **{f"{axis}1".casefold(): axis for axis in "XYZ"},  # Ouster's tools: the first return
    "range1": "RANGE",
    "return number": "EchoNumber",  # CloudCompare, of a LAS file
}
"""Names in lower case, without a unit, and the column of ours that they stand for."""

METRES = {"m": 1.0, "mm": 0.001, "cm": 0.01}
LENGTHS = ("X", "Y", "Z", "RANGE", "Distance")
_WITH_UNIT = re.compile(r"(.*?)[ _]*[\[(](m|mm|cm)[\])]", re.IGNORECASE)


def canonical(name: str) -> tuple[str, float]:
    """The name that a file's name stands for, and the factor that takes its lengths to metres."""
    match = _WITH_UNIT.fullmatch(name.strip())
    bare = match[1] if match else name
    ours = VENDORS_NAMES.get(bare.casefold(), bare)
    if match and ours.casefold() in (length.casefold() for length in LENGTHS):
        return ours, METRES[match[2].lower()]
    return (ours if not match else name), 1.0


def is_needed(name: str) -> bool:
    """Whether the column must be readable for the file to be read as what it is."""
    return canonical(name)[0].casefold() in NEEDED


def leave_out(path: Path | None, name: str, why: str) -> None:
    """Say that a column which nothing needs is left out."""
    _log.warning("%s: the column %s is left out, nothing needs it: %s", path, quoted(name), why)


def usable_names(names: Iterable[str], path: Path) -> list[str]:
    """The names, with numbers for columns without one, and for further columns of one name that nothing needs."""
    usable: list[str] = []
    seen: set[str] = set()
    for number, name in enumerate(names, start=1):
        own = name or f"column_{number}"
        if own.casefold() in seen and not is_needed(own):
            own = f"{name}_{number}"
        if own != name:
            called = quoted(name) if name else "without a name"
            _log.warning("%s: column %d, %s, is called %s", path, number, called, own)
        usable.append(own)
        seen.add(own.casefold())
    return usable


def with_known_names(table: Table) -> Table:
    """The columns that vendors name otherwise under our names, lengths in metres; the log says which.

    A column keeps its name where one of ours is there already.
    """
    changed: dict[str, tuple[str, float]] = {}
    taken = {name.casefold() for name in table.names}
    for name in table.names:
        ours, factor = canonical(name)
        if ours != name and ours.casefold() != name.casefold() and ours.casefold() not in taken:
            changed[name] = ours, factor
            taken.add(ours.casefold())
    if not changed:
        return table
    said = [
        f"{quoted(name)} as {ours}{'' if factor == 1 else ' in metres'}" for name, (ours, factor) in changed.items()
    ]
    _log.warning("%s: read %s", table.path, ", ".join(said))
    _warn_of_second_returns(table)
    columns = {}
    for name, column in table.columns.items():
        ours, factor = changed.get(name, (name, 1.0))
        columns[ours] = column if factor == 1 else column * np.float64(factor)
    scaled = any(factor != 1 for _, factor in changed.values())
    return replace(table, columns=columns, layout=None if scaled else table.layout)


def _warn_of_second_returns(table: Table) -> None:
    others = [name for name in table.names if re.fullmatch(r"[XYZ]2( \(m\))?", name, re.IGNORECASE)]
    if len(others) == 3:
        names = ", ".join(others)
        _log.warning("%s: the second returns in %s are no rows of their own and are not read", table.path, names)


def writable_names(table: Table, path: str | os.PathLike[str], plain_name: Callable[[str], bool]) -> dict[str, Column]:
    """The columns by names that the format can hold: an underscore stands for blanks and separators."""
    columns: dict[str, Column] = {}
    for name, column in table.columns.items():
        own = name if plain_name(name) else re.sub(r"[\s,;\"]+", "_", name.strip())
        if not plain_name(own) or own in columns:
            what = f"this format cannot hold the column name {quoted(name)}"
            raise InputError(what, file=path, fix="rename the column, or write CSV or Parquet")
        if own != name:
            _log.warning("%s: the column %s is written as %s", path, quoted(name), own)
        columns[own] = column
    return columns
