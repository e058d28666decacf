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
from lidarcheck.formats.table import Table
from lidarcheck.sensor import Sensor, sensor_of, shipped, shipped_names
from lidarcheck.sensor.faults import KeyFault, RowFault
from lidarcheck.sensor.overrides import overridden, place_of_number, whole_tables
from lidarcheck.sensor.sensor import RANGE_KEYS
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
    return _with_itself(_built(document, lines, file.name, _Tables(file)), file)


def sensor_of_model(variant: str, overrides: Mapping[str, Any], lines: LineIndex) -> Sensor:
    """The sensor of a model's `variant` and `[sensor]`; faults name the line in the model's or the sensor's file."""
    if not is_sensor_file(variant):
        try:
            return shipped(variant, overrides)
        except UsageError as error:
            raise _fault(error, overrides, variant, lines) from None
    file = named_file(lines.file.absolute(), variant, lines.line(("variant",)))
    document, own_lines = _read(file)
    tables = _Tables(file)
    plain = _with_itself(_built(document, own_lines, variant, tables), file)
    if not overrides:
        return plain
    try:
        changed = overridden(document, overrides)
        found = sensor_of(changed, variant, columns=tables, tables=whole_tables(overrides))
    except RowFault as error:
        raise tables.fault(error) from None
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


def _built(document: Mapping[str, Any], lines: LineIndex, variant: str, tables: _Tables) -> Sensor:
    try:
        return sensor_of(document, variant, columns=tables)
    except RowFault as error:
        raise tables.fault(error) from None
    except UsageError as error:
        what = re.sub("|".join(RANGE_KEYS.values()), _in_file, error.what)
        raise ConfigError([lines.fault(_place(error, document), what, fix=error.fix)]) from None


def _in_file(name: re.Match[str]) -> str:
    return ".".join(place_of_number(name[0], ""))


def _place(error: UsageError, document: Mapping[str, Any]) -> tuple[str, ...]:
    """The key of the file that holds what is wrong; a number out of its bounds begins the message."""
    if isinstance(error, KeyFault):
        return error.at
    return place_of_number(error.what.split(" ", 1)[0], str(document.get("detector")))


class _Tables:
    """Reads the tables that a sensor file names, CSV or Parquet, from the sensor file's project."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.read: dict[str, Table] = {}

    def __call__(self, name: str) -> Mapping[str, npt.NDArray[Any]]:
        """The columns of a table."""
        table = self.read[name] = read_table(named_file(self.file.absolute(), name))
        if not len(table):
            raise InputError("has no rows", file=table.path, fix="write a row for each entry")
        return table.columns

    def fault(self, error: RowFault) -> InputError:
        """The same with the line of the table; of a fault of its header the first."""
        table = self.read[error.table]
        if error.row is not None:
            return table.fault(error.plain, row=error.row, fix=error.fix)
        return InputError(error.plain, file=table.path, line=None if table.layout is None else 1, fix=error.fix)


def _fault(error: UsageError, overrides: Mapping[str, Any], variant: str, lines: LineIndex) -> ConfigError:
    """The fault at the override that the error is about, else at `[sensor]` or the variant."""
    word = error.what.split(" ", 1)[0]
    at = error.at if isinstance(error, KeyFault) else place_of_number(word, "")
    named = [name for name in overrides if re.search(rf"\b{re.escape(name)}\b", error.what)]
    places = [("sensor", *at), ("sensor", at[-1]), ("sensor", word), *(("sensor", name) for name in named)]
    place = next((place for place in places if place in lines.lines), ("sensor",) if overrides else ("variant",))
    return ConfigError([lines.fault(place, error.what, fix=error.fix)])
