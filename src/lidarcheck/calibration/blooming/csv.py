"""A measured profile as a CSV table: PEAK, AREA and WIDTH over the offset, a row an offset or a row a value.

Wide: `offset_spad_rows` (vertical) or `offset_columns` (horizontal), and any of `range_m`, `PEAK`, `AREA`, `WIDTH_ns`.
Long: `feature,y_m,value`, a row a value, over the lateral position of the echo [m]; horizontal. Empty or `nan` cells
are not known. Profiles of other sensors count beams (`offset_layers`, `offset_points`): see `beside`.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.blooming.cells import Cells, Sources
from lidarcheck.calibration.blooming.response import FEATURES
from lidarcheck.calibration.blooming.target import STEP, saturated
from lidarcheck.errors import InputError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.source import decode_text, read_source
from lidarcheck.formats.table import quoted
from lidarcheck.kpi.variant import ABOVE_SATURATION
from lidarcheck.sensor import SpadArray

__all__ = ["BEAM_OFFSETS", "is_profile", "number_of", "profile_axis", "read_profile", "rows_of"]

_OFFSETS: dict[str, Axis] = {"offset_spad_rows": "vertical", "offset_columns": "horizontal"}
BEAM_OFFSETS: dict[str, Axis] = {"offset_layers": "vertical", "offset_points": "horizontal"}
"""Of sensors that are no SPAD arrays; `beside` reads them."""
_NAMES = {"PEAK": ("peak",), "AREA": ("area",), "WIDTH": ("width_ns", "width"), "range_m": ("range_m", "range")}
_LONG = ("feature", "y_m", "value")
_LARGEST = 1e6  # a hundred times what any of these numbers can be
_COLUMN_RAD = math.radians(0.05)


def is_profile(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins like a profile; False for what cannot be read."""
    try:
        with Path(path).open("rb") as stream:
            head = stream.readline(1000).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return False
    return _axis_of(_header(head)) is not None


def profile_axis(path: str | os.PathLike[str]) -> Axis | None:
    """The axis of a profile; None where the file is none."""
    with Path(path).open("rb") as stream:
        return _axis_of(_header(stream.readline(1000).decode("utf-8-sig", errors="replace")))


def _header(line: str) -> list[str]:
    return [name.strip().lower() for name in line.split(",")]


def _axis_of(header: Sequence[str]) -> Axis | None:
    if header == list(_LONG):
        return "horizontal"
    return next((axis for name, axis in {**_OFFSETS, **BEAM_OFFSETS}.items() if name in header), None)


def read_profile(
    path: str | os.PathLike[str], sensor: SpadArray, *, signal_at_1m: float, distance_m: float | None = None
) -> Cells:
    """The cells of a profile. Its target is the longest run of offsets at which the sensor saturates.

    The target's beams lie within that run, half a step wider, S = `signal_at_1m` / R^2 each. R is `distance_m`, else
    the mean of the profile's ranges. `InputError` with the line of what is no number; also for a profile without a
    target or one cut off.
    """
    file = Path(path)
    rows = rows_of(file)
    header = [name.strip().lower() for name in rows[0]]
    axis = _axis_of(header)
    if axis is None:
        raise InputError("is no profile", file=file, line=1, fix=f"name columns {', '.join(_OFFSETS)} or {_LONG}")
    if set(header) & set(BEAM_OFFSETS):
        what = f"counts beams, and {sensor.name} is a SPAD array"
        raise InputError(what, file=file, line=1, fix=f"name columns {', '.join(_OFFSETS)}")
    numbered = [(number, row) for number, row in enumerate(rows[1:], start=2) if any(cell.strip() for cell in row)]
    offset, range_m, value = _long(numbered, file) if header == list(_LONG) else _wide(header, numbered, file)
    if not np.any(np.isfinite(value)):
        raise InputError("has no PEAK, AREA or WIDTH", file=file, fix="give at least one of them")
    most = np.nanmax(value[:, 0]) if np.any(np.isfinite(value[:, 0])) else 0.0
    if most > ABOVE_SATURATION * sensor.peak_saturation:
        what = f"PEAK reaches {most:g}, above the {sensor.peak_saturation:g} at which {sensor.variant} saturates"
        raise InputError(what, file=file, fix="name the model of the variant that measured")
    at_m = float(np.nanmean(range_m)) if distance_m is None and np.any(np.isfinite(range_m)) else distance_m
    if at_m is None or not at_m > 0:
        what = "has no ranges" if at_m is None else f"has ranges whose mean is {at_m:g} m"
        raise InputError(what, file=file, fix="name the distance as PROFILE@DISTANCE")
    return _cells(file, axis, at_m, offset, range_m, value, sensor, signal_at_1m)


def rows_of(file: Path) -> list[list[str]]:
    """The cells of each line, as many as it has."""
    reader = csv.reader(io.StringIO(decode_text(read_source(file), file), newline=None))
    try:
        return list(reader)
    except csv.Error as error:
        fix = "write numbers separated by commas"
        raise InputError(f"is no CSV: {error}", file=file, line=reader.line_num, fix=fix) from None


def _wide(
    header: Sequence[str], rows: Iterable[tuple[int, list[str]]], file: Path
) -> tuple[FloatArray, FloatArray, FloatArray]:
    at = next(header.index(name) for name in _OFFSETS if name in header)
    columns = [next((header.index(n) for n in _NAMES[name] if n in header), None) for name in (*FEATURES, "range_m")]
    table = [
        [number_of(row, at, line, file, needed=True), *(number_of(row, c, line, file) for c in columns)]
        for line, row in rows
    ]
    values = np.array(table, dtype=np.float64).reshape(-1, 5)
    values = values[np.argsort(values[:, 0], kind="stable")]
    return values[:, 0], values[:, 4], values[:, 1:4]


def _long(rows: Iterable[tuple[int, list[str]]], file: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each value a cell of its own; the lateral position as an angle, by the range of the nearest row that has one."""
    found = []
    names = {"range_m": 3, "PEAK": 0, "AREA": 1, "WIDTH_ns": 2, "WIDTH": 2}
    for line, row in rows:
        name = row[0].strip()
        if name not in names:
            raise InputError(
                f"there is no feature {quoted(name)}", file=file, line=line, fix=f"use one of {', '.join(names)}"
            )
        found.append(
            (names[name], number_of(row, 1, line, file, needed=True), number_of(row, 2, line, file, needed=True))
        )
    kind, y_m, value = np.array(found, dtype=np.float64).reshape(-1, 3).T
    ranges = kind == 3
    if not np.any(ranges):
        raise InputError("has no range_m", file=file, fix="positions become angles by the range: add some rows of it")
    order = np.argsort(y_m[ranges])
    near_m = np.interp(y_m, y_m[ranges][order], value[ranges][order])
    use = ~ranges
    offset = np.arcsin(np.clip(y_m / near_m, -1.0, 1.0))[use] / _COLUMN_RAD
    table = np.full((int(use.sum()), 3), np.nan)
    table[np.arange(len(table)), kind[use].astype(int)] = value[use]
    sort = np.argsort(offset, kind="stable")
    return offset[sort], near_m[use][sort], table[sort]


def number_of(row: Sequence[str], at: int | None, line: int, file: Path, *, needed: bool = False) -> float:
    """The number of a cell, NaN for an empty one that is not `needed`; `InputError` with the line of what is none."""
    text = "" if at is None or at >= len(row) else row[at].strip()
    if text.lower() in ("", "nan", "-") and not needed:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.inf
    if not abs(value) <= _LARGEST:
        what = f"{quoted(text)} is not a number" + (f" up to {_LARGEST:g}" if math.isfinite(value) else "")
        raise InputError(what, file=file, line=line, fix="write it as 12.5, or leave it empty")
    return value


def _cells(
    file: Path, axis: Axis, distance_m: float, offset: FloatArray, range_m: FloatArray, value: FloatArray,
    sensor: SpadArray, signal_at_1m: float,
) -> Cells:  # fmt: skip
    low, high = _target(file, offset, value, sensor)
    center = 0.0 if low < 0.0 < high else 0.5 * (low + high)
    offset, low, high = offset - center, low - center, high - center
    step = STEP[axis]
    first = np.ceil((low + 0.5 * step) / step - 1e-9)
    count = max(int(np.floor((high - 0.5 * step) / step + 1e-9) - first) + 1, 1)
    signal = signal_at_1m / distance_m**2
    sources = Sources(step * (first + np.arange(count)), np.full(count, signal))
    on_target = (offset >= low) & (offset <= high)
    n = len(offset)
    return Cells(
        file.name, axis, distance_m, offset,
        beams=np.zeros(n, dtype=np.int64), echoes=np.any(np.isfinite(value), axis=1).astype(np.int64), value=value,
        range_m=range_m, target=np.where(on_target, signal, 0.0), other=np.zeros(n),
        line=np.zeros(n, dtype=np.int64), sources=(sources,),
    )  # fmt: skip


def _target(file: Path, offset: FloatArray, value: FloatArray, sensor: SpadArray) -> tuple[float, float]:
    """Ends of the longest run of saturated offsets, half a step wider; rows that cannot say belong to their run."""
    bright = saturated(value[:, 0], value[:, 1], sensor)
    silent = np.isnan(value[:, 1]) & (np.isnan(value[:, 0]) | (bright & bool(np.any(np.isfinite(value[:, 1])))))
    use = np.flatnonzero(~silent)
    at, lit = offset[use], bright[use]
    if not np.any(lit):
        most = np.nanmax(value[:, 0]) if np.any(np.isfinite(value[:, 0])) else math.nan
        what = f"no PEAK or AREA saturates (PEAK {sensor.peak_saturation}): the largest PEAK is {most:g}"
        raise InputError(what, file=file, fix="is the variant right?")
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lit.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    start, stop = runs[np.argmax(at[runs[:, 1] - 1] - at[runs[:, 0]] + 1e-6 * (runs[:, 1] - runs[:, 0]))]
    if start == 0 or stop == len(at):
        what = f"the target is cut by the end of the profile: it saturates from {at[start]:g} to {at[stop - 1]:g}"
        raise InputError(what, file=file, fix="use a profile that shows both sides of the target")
    return 0.5 * float(at[start - 1] + at[start]), 0.5 * float(at[stop - 1] + at[stop])
