"""What a file is and what is in it, in numbers and words."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.field.recording import RECORDINGS
from lidarcheck.formats.frames import SeveralFrames, frames_of
from lidarcheck.formats.geometry import AS_IT_IS, Placement, words
from lidarcheck.formats.ideals import ideal_from_table, is_ideal
from lidarcheck.formats.recognise import FORMATS, read_table, recognise
from lidarcheck.formats.scans import RowCounts, read_scan
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.sensor_columns import histogram_names, spellings
from lidarcheck.formats.table import Column, Table, counted
from lidarcheck.formats.times import TimeUnit, clock_of, seconds
from lidarcheck.scan import COUNTED, IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["ColumnSummary", "FileDescription", "beam_keys", "describe", "described"]


@dataclass(frozen=True, slots=True)
class ColumnSummary:
    """One column as the file holds it; `low`, `high` and `mean` of its finite values, None where there are none.

    `missing`: rows that are NaN.
    """

    name: str
    dtype: str
    low: float | None
    high: float | None
    mean: float | None
    missing: int = 0


@dataclass(frozen=True, slots=True)
class FileDescription:
    """What `describe` found in a file.

    `kind`: `scan`, `ideal`, `model`, `lut`, `settings`. `rows`: of the file, with those that are no echo. `beams`:
    distinct (layer, point) pairs of echoes; None where not known. `range_m`: low, high and mean of the echoes' (or
    hits') ranges. `echoes_per_beam`: how many beams have 1, 2, ... echoes (of an ideal scan: rows). `defaulted`:
    standard columns that the file lacks. `facts`: what else there is to say, by its name.
    """

    path: str
    format: str
    kind: str
    rows: int | None = None
    columns: tuple[ColumnSummary, ...] = ()
    beams: int | None = None
    range_m: tuple[float, float, float] | None = None
    echoes_per_beam: Mapping[str, int] = field(default_factory=dict)
    defaulted: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries, lists, numbers and words, fit for JSON."""
        content = dataclasses.asdict(self)
        content["columns"] = list(content["columns"])
        content["defaulted"] = list(self.defaulted)
        content["range_m"] = None if self.range_m is None else list(self.range_m)
        return content

    def __str__(self) -> str:
        lines = [f"{self.path}: {self.kind}, {self.format}"]
        if self.rows is not None:
            lines.append(f"rows             {self.rows}")
        if self.beams is not None:
            lines.append(f"beams            {self.beams}")
        if self.range_m is not None:
            low, high, mean = self.range_m
            lines.append(f"range            {low:.3f} ... {high:.3f} m, mean {mean:.3f} m")
        if self.echoes_per_beam:
            counts = ", ".join(f"{count} x {number}" for number, count in self.echoes_per_beam.items())
            lines.append(f"{'rows' if self.kind == 'ideal' else 'echoes'} per beam".ljust(17) + counts)
        if self.defaulted:
            lines.append(f"missing columns  {', '.join(self.defaulted)}")
        lines += [f"{name.ljust(16)} {_words(value)}" for name, value in self.facts.items()]
        return "\n".join([*lines, *self._column_lines()])

    def _column_lines(self) -> list[str]:
        if not self.columns:
            return []
        width = max(len("column"), *(len(column.name) for column in self.columns))
        some = any(column.missing for column in self.columns)
        lines = [f"{'column'.ljust(width)}  {'type':8}{'low':>14}{'high':>14}{'mean':>14}" + "   missing" * some]
        for column in self.columns:
            numbers = ["-" if value is None else f"{value:.6g}" for value in (column.low, column.high, column.mean)]
            row = f"{column.name.ljust(width)}  {column.dtype:8}" + "".join(f"{text:>14}" for text in numbers)
            lines.append(row + f"{column.missing:>10}" * some)
        return lines


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {_words(inner)}" for name, inner in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_words(inner) for inner in value) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def describe(
    path: str | os.PathLike[str],
    *,
    load_model: Callable[[str | os.PathLike[str]], Any] | None = None,
    placement: Placement = AS_IT_IS,
    time_unit: TimeUnit | None = None,
    sensor: Sensor | None = None,
) -> FileDescription:
    """What a file is and what is in it: scans and ideal scans in any format, LUTs, settings, models.

    `load_model`: what reads a model (`lidarcheck.model.load_model`); a TOML file is refused without it. `placement`:
    what is declared of a scan; `time_unit`: of its time column, where that does not tell; `sensor`: what measured, a
    built-in one where None. `InputError` or `ConfigError`
    when the file is none of these or has faults.
    """
    name = recognise(path)
    if name in FORMATS:
        return described(read_table(path), FORMATS[name].title, placement, time_unit, sensor)[0]
    if name in RECORDINGS:
        from lidarcheck.formats.field.describe import describe_recording

        return describe_recording(path, name, placement, time_unit, sensor)
    if name == "lut":
        return _describe_lut(path)
    if name == "settings":
        return _describe_settings(path)
    if load_model is None:
        raise InputError("the file is TOML, and nothing was given to read it with", file=path, fix="name a scan")
    return _describe_model(path, load_model(path))


def described(
    table: Table, form: str, placement: Placement, time_unit: TimeUnit | None, sensor: Sensor | None
) -> tuple[FileDescription, Scan | IdealScan, RowCounts]:
    """What is in a table, what it was read as, and how many of its rows are no echoes of their own."""
    rows: Scan | IdealScan
    facts: dict[str, Any] = {}
    found = RowCounts()
    whole, frames = _with_frames(table)
    if is_semantic(table) or is_ideal(table):
        rows = ideal_from_table(ideal_table(table, sensor) if is_semantic(table) else table, sensor)
        kind, range_m, facts = "ideal", rows.distance_m[rows.distance_m > 0], _ideal_facts(rows)
    else:
        rows, found = read_scan(whole, placement, sensor=sensor)
        kind, range_m, facts = "scan", rows.range_m, {**_row_facts(rows, found), **_time_facts(table, time_unit)}
    frame = rows.extra[whole.spelling("Frame") or ""] if whole is not table else np.zeros(len(rows), dtype=np.int64)
    counts = np.concatenate([_rows_per_beam(rows.layer[at], rows.point[at]) for at in _each(frame)])
    description = FileDescription(
        path=str(table.path),
        format=form,
        kind=kind,
        rows=len(table) if kind == "scan" else len(rows),
        columns=tuple(_summary(name, column) for name, column in table.columns.items()),
        beams=len(_rows_per_beam(rows.layer, rows.point)),
        range_m=_span(range_m),
        echoes_per_beam={str(number): int(np.count_nonzero(counts == number)) for number in np.unique(counts)},
        defaulted=tuple(name for name in rows.defaulted if _expected(name, sensor)),
        facts={**frames, **_sensor_facts(table, sensor, kind), **facts},
    )
    return description, rows, found


def _expected(column: str, sensor: Sensor | None) -> bool:
    """Whether a standard column that the file lacks is missing: another sensor's features are not."""
    return sensor is None or column not in COUNTED or any(feature.name == column for feature in sensor.features)


def _sensor_facts(table: Table, sensor: Sensor | None, kind: str) -> dict[str, Any]:
    """How the file is read as that sensor's: its beams, the hand of Y, the column of each feature."""
    if sensor is None:
        return {}
    beams = sensor.beams
    said = [f"{sensor.name}, {beams.layers} layers x {beams.points} points"]
    if kind == "scan":
        own = spellings(table, sensor) | {name: name for name in COUNTED if table.spelling(name)}
        own |= {f.name: f"h0 ... h{n - 1}" for f in sensor.features if f.law == "histogram" and (n := _bins(table))}
        said += ["left-handed, Y is negated"] if sensor.handedness == "left" else []
        said += [f"{f.name} {f'is {own[f.name]}' if f.name in own else 'is not there'}" for f in sensor.features]
    return {"sensor": said}


def _bins(table: Table) -> int:
    return len(histogram_names(table))


def _with_frames(table: Table) -> tuple[Table, dict[str, Any]]:
    """The table with its rows' frames numbered, where it holds several, and what to say of them."""
    try:
        found = frames_of(table)
    except SeveralFrames as error:
        return table, {"frames": f"several, not told apart: {error.what}"}
    if len(found) < 2:
        return table, {}
    frame = np.zeros(len(table), dtype=np.int64)
    for number, rows in enumerate(found.rows):
        frame[rows] = number
    sizes = np.bincount(frame)
    said = f"{len(found)}, told apart {found.how}; {sizes.min()} to {sizes.max()} rows each"
    return table.with_column("Frame", frame), {"frames": said}


def _each(frame: Column) -> list[npt.NDArray[np.intp]]:
    """The rows of each frame."""
    order = np.argsort(frame, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(frame[order])) + 1)


def _row_facts(scan: Scan, counts: RowCounts) -> dict[str, Any]:
    """What the rows are, where they are not simply an echo each, and how their positions agree with their beams."""
    facts: dict[str, Any] = {"geometry": words(scan.geometry).removeprefix("geometry ")}
    if counts.no_return:
        unknown = f", {counts.unplaced} of unknown beams" if counts.unplaced else ""
        facts["no return"] = counted(counts.no_return, "row") + unknown
    if scan.fired is not None:
        silent = len(_rows_per_beam(scan.fired.layer, scan.fired.point)) - len(_rows_per_beam(scan.layer, scan.point))
        facts["fired beams"] = f"{len(scan.fired)}, {silent} without an echo"
    if counts.copies:
        facts["copies"] = f"{counted(counts.copies, 'row')} that the file has twice"
    if counts.renumbered:
        facts["renumbered"] = f"the echoes of {counted(counts.renumbered, 'beam')}, by range from 1"
    return facts


def _time_facts(table: Table, unit: TimeUnit | None) -> dict[str, Any]:
    """Which column is the time, in which unit and over how long; or why that is not known."""
    try:
        clock = clock_of(table.columns, unit)
    except UsageError as error:
        return {"time": f"not known: {error.what}; {error.fix}"}
    if clock is None:
        return {}
    span = _span(seconds(table.columns, clock))
    from_to = "" if span is None else f", {span[0]:.6g} ... {span[1]:.6g} s from the frame's start"
    return {"time": f"{clock.column} in {clock.unit} by {clock.said_by}{from_to}"}


def _ideal_facts(ideal: IdealScan) -> dict[str, Any]:
    materials, rows = np.unique(ideal.material_id[ideal.distance_m > 0], return_counts=True)
    return {
        "rows with no hit": int(np.count_nonzero(ideal.distance_m == 0)),
        **({"rows not known": int(unknown)} if (unknown := np.count_nonzero(np.isnan(ideal.distance_m))) else {}),
        "rows by material": {str(material): int(count) for material, count in zip(materials, rows, strict=True)},
    }


def _rows_per_beam(layer: Column, point: Column) -> npt.NDArray[np.int64]:
    """How many rows each known beam has, shape (n_beams,)."""
    return np.asarray(np.unique(beam_keys(layer, point), return_counts=True)[1], dtype=np.int64)


def beam_keys(layer: Column, point: Column) -> npt.NDArray[np.int64]:
    """A whole number for the beam of each row whose beam is known."""
    known = (layer >= 0) & (point >= 0)
    return np.asarray((layer[known].astype(np.int64) << 32) | point[known])


def _summary(name: str, column: Column) -> ColumnSummary:
    low, high, mean = _span(column) or (None, None, None)
    missing = int(np.count_nonzero(np.isnan(column))) if column.dtype.kind == "f" else 0
    return ColumnSummary(name, str(column.dtype), low, high, mean, missing)


def _span(column: Column) -> tuple[float, float, float] | None:
    if column.dtype.kind == "f":
        column = column[np.isfinite(column)]
    if not len(column):
        return None
    # Divided before it is summed up: a sum of finite numbers may overflow.
    mean = float((column.astype(np.float64) / len(column)).sum())
    return column.min().item(), column.max().item(), mean


def _limits(column: Column) -> list[float]:
    span = _span(column)
    return [] if span is None else [span[0], span[1]]


def _describe_lut(path: str | os.PathLike[str]) -> FileDescription:
    from lidarcheck.formats.lut import load_lut

    facts = {
        f"{axis} LUT": {"points": len(table), "x": _limits(table.x), "y": _limits(table.y)}
        for axis, table in load_lut(path).tables.items()
    }
    return FileDescription(str(Path(path)), "INI", "lut", facts=facts)


def _describe_settings(path: str | os.PathLike[str]) -> FileDescription:
    from lidarcheck.formats.settings import load_settings

    settings = load_settings(path)
    facts = {"axis": settings.axis, "distances": [entry.distance_m for entry in settings.entries]}
    return FileDescription(str(Path(path)), "JSON", "settings", facts=facts)


def _describe_model(path: str | os.PathLike[str], model: Any) -> FileDescription:
    facts: dict[str, Any] = {}
    if model.external is not None:
        facts["external"] = list(model.external.command) or [model.external.module]
    if model.external is None or model.materials or model.effects:
        facts["variant"] = model.sensor.variant
        facts["sensor"] = model.sensor.overrides()
        facts["materials"] = {str(number): material.name for number, material in model.materials.items()}
        facts["effects"] = [effect.name for effect in model.effects if not effect.empirical]
        terms = [effect for effect in model.effects if effect.empirical]
        if terms:
            facts["empirical terms"] = {term.name: term.settings() for term in terms}
    return FileDescription(str(Path(path)), "TOML", "model", facts=facts)
