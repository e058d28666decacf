"""From the table `[beams]` of a sensor file to its beams."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.sensor.beam_table import TableBeams
from lidarcheck.sensor.beam_table_checks import like_radians
from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.channels import ChannelBeams, Channels
from lidarcheck.sensor.faults import KeyFault, RowFault
from lidarcheck.sensor.grid import Axis, GridBeams
from lidarcheck.sensor.sweep import Sweep

__all__ = ["Columns", "beams_missing", "beams_of_table", "read_columns"]

Columns = Callable[[str], Mapping[str, npt.NDArray[Any]]]
"""What reads a table that a sensor file names: its columns by their names."""
_OF_KIND: Mapping[str, tuple[str, ...]] = {
    "grid": ("layers", "points", "elevation_deg", "azimuth_deg"),
    "channels": (
        "elevation_deg", "azimuth_deg", "azimuth_offset_deg", "origin_m", "side_m", "height_m", "range_offset_m",
        "fire_time_us", "ring", "column_shift", "columns", "azimuth_step_deg", "columns_repeat", "file",
    ),
    "table": ("file", "direction"),
}  # fmt: skip
_STEP_DEG = 1.0
"""Stands for the step of columns of a file that does not say it; `beams_missing` does."""
_OF_ALL = ("kind", "footprint_deg", "footprint", "sub_rays")


def read_columns(columns: Columns | None, file: str) -> Mapping[str, npt.NDArray[Any]]:
    """The columns of a table that a sensor file names; `UsageError` where nobody reads it."""
    if columns is None:
        raise UsageError(f"the table {file} cannot be read here", fix="load the sensor from its file")
    return columns(file)


def beams_of_table(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    """The beams that `[beams]` describes; `KeyFault` or `RowFault` for what does not fit together."""
    given = [name for name in table.model_fields_set if getattr(table, name) is not None]
    for name in given:
        if name not in (*_OF_ALL, *_OF_KIND[table.kind]):
            kinds = ", ".join(kind for kind, names in _OF_KIND.items() if name in names)
            what = f'beams.{name} means nothing with kind = "{table.kind}"'
            raise _fault(what, f"remove it: it is for {kinds}", name)
    return {"grid": _grid, "channels": _channels, "table": _table}[table.kind](table, sweep, columns)


def _fault(what: str, fix: str, *at: str) -> KeyFault:
    return KeyFault(what, fix=fix, at=("beams", *at))


def _grid(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    for name in _OF_KIND["grid"]:
        if getattr(table, name) is None:
            raise _fault(f"beams.{name} is missing", 'kind = "grid" needs ' + ", ".join(_OF_KIND["grid"]))
    for name in ("elevation_deg", "azimuth_deg"):
        if not hasattr(getattr(table, name), "step"):
            raise _fault(f"beams.{name} has no step", "give {first = …, step = …}", name)
    up, aside = table.elevation_deg, table.azimuth_deg
    highest = max(abs(up.first), abs(up.first + (table.layers - 1) * up.step))
    if highest > 90.0 + 1e-9:
        what = f"the last of {table.layers} layers is {highest:g} degrees steep"
        raise _fault(what, "correct first or step", "elevation_deg")
    spans = [abs((n - 1) * axis.step) for n, axis in ((table.layers, up), (table.points, aside))]
    if like_radians(table.layers * table.points, *spans):
        what = f"beams.azimuth_deg spans {spans[1]:.3g} and elevation_deg {spans[0]:.3g}: these look like radians"
        raise _fault(what, "write degrees", "azimuth_deg")
    return GridBeams(sweep, Axis(table.layers, up.first, up.step), Axis(table.points, aside.first, aside.step))


def _channels(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    given = {name: getattr(table, name) for name in Channels.__dataclass_fields__ if getattr(table, name) is not None}
    if table.file is not None:
        given |= _lists_of_file(table.file, read_columns(columns, table.file), given)
    if not isinstance(given.get("elevation_deg"), tuple):
        raise _fault("beams.elevation_deg is no list", "give one elevation a channel", "elevation_deg")
    n = len(given["elevation_deg"])
    if not n:
        raise _fault("beams.elevation_deg is empty", "give one elevation a channel", "elevation_deg")
    given.setdefault("ring", tuple(range(n)))
    lists = {name: _channel_values(name, given.get(name, 0), n) for name in Channels.__dataclass_fields__}
    _check_lists(lists)
    return _turning(table, Channels(**lists), sweep)


def _lists_of_file(
    file: str, read: Mapping[str, npt.NDArray[Any]], given: Mapping[str, Any]
) -> dict[str, tuple[Any, ...]]:
    """The lists that stand in a file of their own, a row each channel."""
    lists: dict[str, tuple[Any, ...]] = {}
    for name, values in read.items():
        if name not in Channels.__dataclass_fields__:
            fix = f"known: {', '.join(Channels.__dataclass_fields__)}"
            raise RowFault(f"there is no list {name!r} of channels", fix=fix, table=file)
        if name in given:
            raise _fault(f"beams.{name} stands in the sensor file and in {file}", "give it once", name)
        whole = name in ("ring", "column_shift")
        wrong = ~np.isfinite(values) | ((values != np.rint(values)) if whole else False)
        if name == "elevation_deg":
            wrong |= np.abs(values) > 90.0
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            needed = "a whole number" if whole else "a number, of elevations from -90 to 90"
            raise RowFault(f"{name} = {values[row]:g}", fix=f"use {needed}", row=row, table=file)
        lists[name] = tuple(int(value) if whole else float(value) for value in values)
    return lists


def _channel_values(name: str, value: Any, n: int) -> tuple[Any, ...]:
    values = tuple(value) if isinstance(value, Sequence) else (value,) * n
    if len(values) != n:
        what = f"beams.{name} has {len(values)} values, elevation_deg has {n}"
        raise _fault(what, f"give {n}, one a channel" + (", or one number for all" if name != "ring" else ""), name)
    return values


def _check_lists(lists: Mapping[str, tuple[Any, ...]]) -> None:
    elevation = np.asarray(lists["elevation_deg"], dtype=np.float64)
    n = len(elevation)
    if n > 1 and not elevation.any():
        raise _fault("beams.elevation_deg is 0 throughout", "give each channel's elevation", "elevation_deg")
    if len(set(lists["ring"])) != n:
        fix = "give the file's ring number of each channel"
        raise _fault(f"beams.ring needs {n} numbers, each once", fix, "ring")
    if n >= 8 and np.ptp(elevation) < 1.6 and np.abs(elevation).max() < 0.8:
        what = f"beams.elevation_deg spans {np.ptp(elevation):.3g} degrees over {n} channels: these look like radians"
        raise _fault(what, "write degrees", "elevation_deg")


def _turning(table: Any, channels: Channels, sweep: Sweep) -> ChannelBeams:
    turn = table.azimuth_deg
    first = 0.0 if turn is None else turn.first
    way = 1.0 if sweep.direction == "left" else -1.0
    if turn is not None and hasattr(turn, "step") and not hasattr(turn, "last"):
        fix = 'with kind = "channels" give {first = …, last = …}'
        raise _fault("beams.azimuth_deg has a step", fix, "azimuth_deg")
    last = first + way * 360.0 if turn is None or turn.last is None else turn.last
    span = last - first
    if span == 0.0 or abs(span) > 360.0 + 1e-9:
        fix = "last is one step past the last column, at most a turn from the first"
        raise _fault(f"beams.azimuth_deg spans {span:g} degrees", fix, "azimuth_deg")
    if span * way < 0.0:
        what = f'beams.azimuth_deg goes {"left" if span > 0 else "right"}, sweep.direction is "{sweep.direction}"'
        raise _fault(what, f"let last be {first + way * abs(span):g}, or direction the other one", "azimuth_deg")
    if table.columns is not None and table.azimuth_step_deg is not None:
        what = "beams needs columns or azimuth_step_deg, and has both"
        raise _fault(what, "give one of them", *(() if table.columns is None else ("columns",)))
    step = span / table.columns if table.columns is not None else np.copysign(table.azimuth_step_deg or _STEP_DEG, span)
    repeats = True if table.columns_repeat is None else table.columns_repeat
    columns = span / step
    if repeats and abs(columns - round(columns)) > 1e-3:
        what = f"beams.azimuth_step_deg = {abs(step):g} gives {columns:.3f} columns"
        fix = "give a step that divides the span, or columns_repeat = false"
        raise _fault(what, fix, "azimuth_step_deg")
    return ChannelBeams(sweep, channels, first, span, float(step), repeats)


def _table(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    if table.direction == "from_scan" and table.file is None:
        return TableBeams(sweep, np.full((1, 1, 2), np.nan), np.zeros((1, 1)), None, from_scan=True)
    if table.file is None:
        raise _fault("beams.file is missing", 'kind = "table" needs the file of the beam table', "kind")
    read = read_columns(columns, table.file)
    try:
        return TableBeams.of_columns(sweep, read, from_scan=table.direction == "from_scan")
    except RowFault as fault:
        raise fault.of_table(table.file) from None


def beams_missing(table: Any) -> tuple[str, ...]:
    """What of `[beams]` must be known before anything is simulated, and is not."""
    unknown = table.kind == "channels" and table.columns is None and table.azimuth_step_deg is None
    return ("beams.columns",) if unknown else ()
