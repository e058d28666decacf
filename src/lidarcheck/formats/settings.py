"""Per-distance settings of the blooming calibration: `Blooming_Calibration_{V,H}_{SMART,SLIM}.json`.

A file is a list of objects, one a distance. Vertical: `Distance` [m]; `IndexVerMin`, `IndexVerMax`, the target's SPAD
rows (0 ... 1559, three a layer); `SegVerCenter`, the layer of its centre (0 ... 519); `SegHor`, the point column of the
cut (0 ... 959). Horizontal: `Distance`; `IndexHorMin`, `IndexHorMax`, the target's columns of 0.05 deg (0 ... 2399);
`SegHorCenter`, the point column of its centre; `SegVer`, the layer of the cut. Unknown keys are kept.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from lidarcheck.config.schema import Config, LineIndex, validate
from lidarcheck.config.words import dotted, kind_of, shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.formats.json_lines import locate_json
from lidarcheck.formats.json_text import json_of, too_deep
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.source import decode_text, read_source
from lidarcheck.sensor import reference_beams

__all__ = [
    "SETTINGS_VARIANTS",
    "Setting",
    "Settings",
    "check_settings",
    "default_settings",
    "find_settings",
    "limits_of",
    "load_settings",
    "parse_settings",
    "save_settings",
    "settings_content",
    "settings_name",
]

SETTINGS_VARIANTS = ("SMART", "SLIM")
"""The sensors that have such settings: they count SPAD rows and columns of 0.05 deg."""
_LETTERS: dict[Axis, str] = {"vertical": "V", "horizontal": "H"}
_NAMES: dict[Axis, tuple[str, ...]] = {
    "vertical": ("Distance", "IndexVerMin", "IndexVerMax", "SegVerCenter", "SegHor"),
    "horizontal": ("Distance", "IndexHorMin", "IndexHorMax", "SegHorCenter", "SegVer"),
}
_BEAMS = reference_beams()
_ROW_MAX = 3 * _BEAMS.layers - 1
_COLUMN_MAX = 2399
_FILE_NAME = re.compile(r"Blooming_Calibration_([VH])_", re.IGNORECASE)

_Distance = Field(ge=0.0, le=300.0, json_schema_extra={"unit": "m"})
_Row = Field(ge=0, le=_ROW_MAX, json_schema_extra={"unit": "SPAD rows"})
_Column = Field(ge=0, le=_COLUMN_MAX, json_schema_extra={"unit": "columns of 0.05 deg"})
_Layer = Field(ge=0, le=_BEAMS.layers - 1, json_schema_extra={"unit": "layers"})
_Point = Field(ge=0, le=_BEAMS.points - 1, json_schema_extra={"unit": "points"})


class _Entry(Config):
    model_config = ConfigDict(extra="allow")
    Distance: float = _Distance

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        low, high = (name for name in type(self).model_fields if name.startswith("Index"))
        first, last = getattr(self, low), getattr(self, high)
        if first > last:
            raise ValueError(f"{low} = {first} is above {high} = {last}; swap them")
        return self


class _Vertical(_Entry):
    IndexVerMin: int = _Row
    IndexVerMax: int = _Row
    SegVerCenter: int = _Layer
    SegHor: int = _Point


class _Horizontal(_Entry):
    IndexHorMin: int = _Column
    IndexHorMax: int = _Column
    SegHorCenter: int = _Point
    SegVer: int = _Layer


class _VerticalFile(Config):
    settings: tuple[_Vertical, ...]


class _HorizontalFile(Config):
    settings: tuple[_Horizontal, ...]


@dataclass(frozen=True)
class Setting:
    """Where the target stands at one distance.

    Vertical: `index_min` ... `index_max` are SPAD rows, `center` a layer, `across` the point column of the cut.
    Horizontal: columns of 0.05 deg, `center` a point column, `across` the layer of the cut. `source` is the object as
    it was read, with keys that lidarcheck does not know.
    """

    distance_m: float
    index_min: int
    index_max: int
    center: int
    across: int
    source: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)


@dataclass(frozen=True)
class Settings:
    """The settings along one axis, in the file's order. `content` are the file's bytes; None for defaults."""

    axis: Axis
    entries: tuple[Setting, ...]
    file: Path | None = field(default=None, compare=False)
    content: bytes | None = field(default=None, compare=False, repr=False)

    def document(self) -> list[dict[str, Any]]:
        """The objects to write: keys in the order they were read, unknown ones included."""
        return [self._object(entry) for entry in self.entries]

    def _object(self, entry: Setting) -> dict[str, Any]:
        values = (entry.distance_m, entry.index_min, entry.index_max, entry.center, entry.across)
        own = dict(zip(_NAMES[self.axis], values, strict=True))
        # A value that nobody changed keeps its spelling: 69 stays 69 and does not become 69.0.
        changed = {key: value for key, value in own.items() if entry.source.get(key) != value}
        return {**entry.source, **changed}


def settings_name(axis: Axis, variant: Literal["SMART", "SLIM"]) -> str:
    """The name of the settings file of a sensor variant."""
    if axis not in _LETTERS or variant not in SETTINGS_VARIANTS:
        raise UsageError(
            f"there are no settings {axis}, {variant}", fix="use vertical or horizontal, and SMART or SLIM"
        )
    return f"Blooming_Calibration_{_LETTERS[axis]}_{variant}.json"


def default_settings(axis: Axis) -> Settings:
    """What holds where there is no file.

    Vertical: a traffic sign at 69, 156.6 and 199 m, as calibrated on SLIM. Horizontal: a target of up to 2 m straight
    ahead at 20 m: 120 columns about the middle of the field of view, cut at the horizon.
    """
    if axis == "vertical":
        rows = [(69.0, 777, 873, 264, 440), (156.6, 770, 790, 260, 472), (199.0, 780, 800, 260, 482)]
        return Settings(axis, tuple(Setting(*row) for row in rows))
    return Settings(axis, (Setting(20.0, 1140, 1260, 480, 260),))


def load_settings(path: str | os.PathLike[str] | None, axis: Axis | None = None) -> Settings:
    """Read a settings file; without a path, the defaults of `axis` (vertical where that is not given either).

    The axis is told by the keys, or by the file's name where the list is empty. `InputError` when the file is not JSON
    or has settings of another axis than asked for, `ConfigError` with each fault, its line and the allowed range.
    """
    if path is None:
        return default_settings(axis or "vertical")
    file = Path(path)
    return parse_settings(read_source(file, pipes=True), file, axis)


def parse_settings(content: bytes, file: Path, axis: Axis | None = None) -> Settings:
    """The settings in a file's bytes; axis and errors as for `load_settings`."""
    data, lines = _parse(decode_text(content, file), file)
    found = _axis_of(data, file, axis)
    if axis is not None and found != axis:
        raise InputError(f"these are {found} settings", file=file, fix=f"name a file of {axis} ones")
    validate({"settings": data}, lines, _VerticalFile if found == "vertical" else _HorizontalFile)
    entries = tuple(_setting(entry, found) for entry in data)
    _check_distances(entries, lines)
    return Settings(found, entries, file, content)


def find_settings(directory: str | os.PathLike[str], axis: Axis, variant: Literal["SMART", "SLIM"]) -> Settings:
    """The settings of a sensor variant in a directory, the defaults where it has no such file; errors as above."""
    path = Path(directory) / settings_name(axis, variant)
    return load_settings(path if path.exists() else None, axis)


def check_settings(settings: Settings, path: str | os.PathLike[str]) -> None:
    """Refuse settings that a file could not hold, as `save_settings` would: `ConfigError`."""
    lines = LineIndex(Path(path))
    document = {"settings": settings.document()}
    validate(document, lines, _VerticalFile if settings.axis == "vertical" else _HorizontalFile)
    _check_distances(settings.entries, lines)


def save_settings(settings: Settings, path: str | os.PathLike[str]) -> None:
    """Write settings with an indent of 2, atomic; unedited ones get the bytes of the file they were read from.

    `ConfigError` when a value is out of range.
    """
    write_bytes(path, settings_content(settings, Path(path)))


def settings_content(settings: Settings, file: Path) -> bytes:
    """The bytes that `save_settings` writes to a file; errors as there."""
    check_settings(settings, file)
    document = settings.document()
    if settings.content is not None and json_of(settings.content.decode("utf-8-sig"), file) == document:
        return settings.content
    return (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode("utf-8")


def limits_of(axis: Axis) -> dict[str, tuple[float, float]]:
    """The smallest and the largest value that each key of a file may have, in the order of the keys."""
    fields = (_Vertical if axis == "vertical" else _Horizontal).model_fields
    found = {}
    for name in _NAMES[axis]:
        ends = {type(limit).__name__: limit for limit in fields[name].metadata}
        found[name] = (float(ends["Ge"].ge), float(ends["Le"].le))
    return found


def _parse(text: str, file: Path) -> tuple[list[Any], LineIndex]:
    """The list in the file and its lines; every key once, every number finite, every text writable."""
    data = json_of(text, file)
    try:
        found, repeated = locate_json(text)
    except RecursionError:
        raise too_deep(file) from None
    if not isinstance(data, list):
        raise InputError(f"the file holds {kind_of(data)}", file=file, line=1, fix="use a list [...] of objects {...}")
    lines = LineIndex(file, {("settings", *path): line for path, line in found.items()})
    faults = [
        InputError(f"{shown(path[-1])} stands twice in one object", file=file, line=line, fix="remove one")
        for path, line in repeated
    ]
    faults += _unwritable(data, ("settings",), lines)
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return data, lines


def _unwritable(value: object, path: tuple[str | int, ...], lines: LineIndex) -> list[InputError]:
    """Values that JSON text cannot hold: numbers too large for a float, halves of surrogate pairs."""
    if isinstance(value, float) and not math.isfinite(value):
        return [lines.fault(path, f"{dotted(path)} is too large a number", fix="use a smaller one")]
    if isinstance(value, str) and any("\ud800" <= c <= "\udfff" for c in value):
        return [lines.fault(path, f"{dotted(path)} holds half a surrogate pair", fix="remove the \\ud... escape")]
    if isinstance(value, dict):
        keys = [fault for key in value for fault in _unwritable(key, path, lines)]
        return keys + [fault for key, entry in value.items() for fault in _unwritable(entry, (*path, key), lines)]
    entries = enumerate(value) if isinstance(value, list) else ()
    return [fault for index, entry in entries for fault in _unwritable(entry, (*path, index), lines)]


def _axis_of(data: list[Any], file: Path, wanted: Axis | None) -> Axis:
    keys = [key for entry in data if isinstance(entry, dict) for key in entry]
    vertical, horizontal = (sum(key in _NAMES[axis][1:] for key in keys) for axis in _LETTERS)
    if vertical != horizontal:
        return "vertical" if vertical > horizontal else "horizontal"
    match = _FILE_NAME.match(file.name)
    if wanted is None and match is None:
        what = "neither vertical nor horizontal settings"
        raise InputError(what, file=file, line=1, fix=f"use the keys {', '.join(_NAMES['vertical'])}")
    return wanted or ("vertical" if match and match.group(1).upper() == "V" else "horizontal")


def _setting(entry: Mapping[str, Any], axis: Axis) -> Setting:
    distance, low, high, center, across = (entry[name] for name in _NAMES[axis])
    return Setting(float(distance), low, high, center, across, entry)


def _check_distances(entries: tuple[Setting, ...], lines: LineIndex) -> None:
    """Refuse a distance that stands twice: which of the two would hold?"""
    seen: set[float] = set()
    faults = []
    for index, entry in enumerate(entries):
        if entry.distance_m in seen:
            what = f"the distance {entry.distance_m:g} m stands twice"
            faults.append(lines.fault(("settings", index, "Distance"), what, fix="remove one"))
        seen.add(entry.distance_m)
    if faults:
        raise ConfigError(faults)
