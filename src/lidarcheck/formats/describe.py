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

from lidarcheck.errors import InputError
from lidarcheck.formats.geometry import AS_IT_IS, Placement, words
from lidarcheck.formats.ideals import ideal_from_table, is_ideal
from lidarcheck.formats.recognise import FORMATS, read_table, recognise
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import IdealScan, Scan

__all__ = ["ColumnSummary", "FileDescription", "describe"]


@dataclass(frozen=True, slots=True)
class ColumnSummary:
    """One column as the file holds it; `low`, `high` and `mean` are None where there are no rows."""

    name: str
    dtype: str
    low: float | None
    high: float | None
    mean: float | None


@dataclass(frozen=True, slots=True)
class FileDescription:
    """What `describe` found in a file.

    `kind`: `scan`, `ideal`, `model`, `lut`, `settings`. `beams`: distinct (layer, point) pairs; None where not known.
    `range_m`: low, high and mean of the echoes' (or hits') ranges. `echoes_per_beam`: how many beams have 1, 2, ...
    echoes (of an ideal scan: rows). `defaulted`: standard columns that the file lacks. `facts`: what else there is to
    say, by its name.
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
        lines = [f"{'column'.ljust(width)}  {'type':8}{'low':>14}{'high':>14}{'mean':>14}"]
        for column in self.columns:
            numbers = ["-" if value is None else f"{value:.6g}" for value in (column.low, column.high, column.mean)]
            lines.append(f"{column.name.ljust(width)}  {column.dtype:8}" + "".join(f"{text:>14}" for text in numbers))
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
) -> FileDescription:
    """What a file is and what is in it: scans and ideal scans in any format, LUTs, settings, models.

    `load_model`: what reads a model (`lidarcheck.model.load_model`); a TOML file is refused without it. `placement`:
    what is declared of a scan. `InputError` or
    `ConfigError` when the file is none of these or has faults.
    """
    name = recognise(path)
    if name in FORMATS:
        return _describe_table(read_table(path), FORMATS[name].title, placement)
    if name == "lut":
        return _describe_lut(path)
    if name == "settings":
        return _describe_settings(path)
    if load_model is None:
        raise InputError("the file is TOML, and nothing was given to read it with", file=path, fix="name a scan")
    return _describe_model(path, load_model(path))


def _describe_table(table: Table, form: str, placement: Placement) -> FileDescription:
    rows: Scan | IdealScan
    if is_semantic(table):
        rows = ideal_from_table(ideal_table(table))
    else:
        rows = ideal_from_table(table) if is_ideal(table) else scan_from_table(table, placement)
    if isinstance(rows, Scan):
        kind, range_m = "scan", rows.range_m
    else:
        kind, range_m = "ideal", rows.distance_m[rows.distance_m > 0]
    counts = _rows_per_beam(rows.layer, rows.point)
    return FileDescription(
        path=str(table.path),
        format=form,
        kind=kind,
        rows=len(rows),
        columns=tuple(_summary(name, column) for name, column in table.columns.items()),
        beams=len(counts),
        range_m=_span(range_m),
        echoes_per_beam={str(number): int(np.count_nonzero(counts == number)) for number in np.unique(counts)},
        defaulted=rows.defaulted,
        facts=_scan_facts(rows) if isinstance(rows, Scan) else _ideal_facts(rows),
    )


def _scan_facts(scan: Scan) -> dict[str, Any]:
    return {"geometry": words(scan.geometry).removeprefix("geometry ")}


def _ideal_facts(ideal: IdealScan) -> dict[str, Any]:
    materials, rows = np.unique(ideal.material_id[ideal.distance_m > 0], return_counts=True)
    return {
        "rows with no hit": int(np.count_nonzero(ideal.distance_m == 0)),
        "rows by material": {str(material): int(count) for material, count in zip(materials, rows, strict=True)},
    }


def _rows_per_beam(layer: Column, point: Column) -> npt.NDArray[np.int64]:
    """How many rows each known beam has, shape (n_beams,)."""
    known = (layer >= 0) & (point >= 0)
    beam = (layer[known].astype(np.int64) << 32) | point[known]
    return np.asarray(np.unique(beam, return_counts=True)[1], dtype=np.int64)


def _summary(name: str, column: Column) -> ColumnSummary:
    low, high, mean = _span(column) or (None, None, None)
    return ColumnSummary(name, str(column.dtype), low, high, mean)


def _span(column: Column) -> tuple[float, float, float] | None:
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
        facts["external"] = list(model.external.command)
    else:
        facts["variant"] = model.sensor.variant
        facts["sensor"] = model.sensor.overrides()
        facts["materials"] = {str(number): material.name for number, material in model.materials.items()}
        facts["effects"] = [effect.name for effect in model.effects if not effect.empirical]
        terms = [effect for effect in model.effects if effect.empirical]
        if terms:
            facts["empirical terms"] = {term.name: term.settings() for term in terms}
    return FileDescription(str(Path(path)), "TOML", "model", facts=facts)
