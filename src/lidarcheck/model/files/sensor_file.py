"""Sensor files: read, held against their schema, and what a model's `[sensor]` changes of them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy.typing as npt

from lidarcheck.config.schema import LineIndex, validate
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.recognise import read_table
from lidarcheck.sensor import Sensor, sensor_of, shipped, shipped_names
from lidarcheck.sensor.document import Columns, overridden
from lidarcheck.trust.places import named_file

__all__ = ["is_sensor_file", "load_sensor", "sensor_of_model"]


def is_sensor_file(variant: str) -> bool:
    """Whether a variant names a file, rather than a sensor that comes with lidarcheck."""
    return variant not in shipped_names() and (variant.endswith(".toml") or "/" in variant)


def load_sensor(variant: str | os.PathLike[str]) -> Sensor:
    """A sensor by the name of a shipped one, or by the path of its file.

    `InputError` when the file cannot be read, `ConfigError` with its faults, each with line and fix; `UsageError` for a
    name that no shipped sensor has.
    """
    name = os.fspath(variant)
    if not is_sensor_file(name):
        return shipped(name)
    file = Path(name)
    document, lines = _read(file)
    return _with_itself(_built(document, lines, file.name, _columns_of(file)), file)


def sensor_of_model(variant: str, overrides: Mapping[str, Any], lines: LineIndex) -> Sensor:
    """The sensor of a model's `variant` and `[sensor]`; faults name the line in the model's or the sensor's file."""
    if not is_sensor_file(variant):
        try:
            return shipped(variant, overrides)
        except UsageError as error:
            raise _fault(error, overrides, variant, lines) from None
    file = named_file(lines.file.absolute(), variant, lines.line(("variant",)))
    document, own_lines = _read(file)
    plain = _with_itself(_built(document, own_lines, variant, _columns_of(file)), file)
    if not overrides:
        return plain
    try:
        changed = overridden(document, overrides)
        tables = {name: overrides[name] for name in ("beams", "sweep", "features") if overrides.get(name)}
        found = sensor_of(changed, variant, columns=_columns_of(file), tables=tables)
    except UsageError as error:
        raise _fault(error, overrides, variant, lines) from None
    return replace(found, file=str(file), plain=plain)


def _with_itself(sensor: Sensor, file: Path) -> Sensor:
    named = replace(sensor, file=str(file))
    return replace(named, plain=named)


def _read(file: Path) -> tuple[dict[str, Any], LineIndex]:
    from lidarcheck.sensor.schema import SensorTable

    document, lines = parse_toml(file)
    validate(document, lines, SensorTable)
    return document, lines


def _built(document: Mapping[str, Any], lines: LineIndex, variant: str, columns: Columns) -> Sensor:
    try:
        return sensor_of(document, variant, columns=columns)
    except UsageError as error:
        raise ConfigError([lines.fault(_place(error.what, document), error.what, fix=error.fix)]) from None


def _columns_of(file: Path) -> Columns:
    """Reads a table that the sensor file names, CSV or Parquet, from the project of the sensor file."""

    def columns(name: str) -> Mapping[str, npt.NDArray[Any]]:
        table = read_table(named_file(file.absolute(), name))
        if not len(table):
            raise InputError("has no rows", file=table.path, fix="write a row for each entry")
        return table.columns

    return columns


def _place(what: str, document: Mapping[str, Any]) -> tuple[str, ...]:
    """The key of the file that a message names: the longest one, else the table that it belongs to."""
    named: list[tuple[str, ...]] = []

    def look(table: Mapping[str, Any], at: tuple[str, ...]) -> None:
        for key, value in table.items():
            if re.search(rf"(?<![\w-]){re.escape(key)}(?![\w-])", what):
                named.append((*at, key))
            if isinstance(value, Mapping):
                look(value, (*at, key))

    look(document, ())
    return max(named, key=len, default=())


def _fault(error: UsageError, overrides: Mapping[str, Any], variant: str, lines: LineIndex) -> ConfigError:
    """The fault at the override that the error names, else at the variant."""
    named = [name for name in overrides if re.search(rf"\b{re.escape(name)}\b", error.what)]
    place = ("sensor", *named[:1]) if overrides and (named or "variant" not in error.what) else ("variant",)
    return ConfigError([lines.fault(place, error.what, fix=error.fix)])
