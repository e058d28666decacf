"""From a sensor file's values to a sensor."""

from __future__ import annotations

import difflib
import functools
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.sensor.beams_document import Columns, beams_missing, beams_of_table, read_columns
from lidarcheck.sensor.faults import KeyFault
from lidarcheck.sensor.feature import LAWS, Feature
from lidarcheck.sensor.overrides import overridden, whole_tables
from lidarcheck.sensor.sensor import RANGE_KEYS, Sensor
from lidarcheck.sensor.sweep import Sweep

__all__ = ["own", "sensor_of", "shipped", "shipped_names", "stated_numbers"]

_DEFAULTS = {"min_range_m": 0.0, "max_range_m": 300.0, "range_resolution_m": 0.01, "range_offset_m": 0.0}
_RATE_HZ = 10.0
"""Stands for the rate of a file that does not say it; the sensor's `missing` does."""
_PULSE_NS = {"spad_array": 5.0, "linear": 5.0, "photon_histogram": 1.0}


def shipped_names() -> tuple[str, ...]:
    """The sensors that come with lidarcheck, in order of their names, the built-in reference sensors first."""
    folder = resources.files("lidarcheck").joinpath("sensors")
    names = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    return tuple(sorted(names, key=lambda name: (name not in ("SMART", "SLIM"), name != "SMART", name)))


@functools.cache
def _shipped_document(name: str) -> dict[str, Any]:
    if name not in shipped_names():
        known = {other.upper(): other for other in shipped_names()}
        near = difflib.get_close_matches(name.upper(), known, n=1)
        fix = f"did you mean {known[near[0]]}? " if near else ""
        fix += f"use one of {', '.join(shipped_names())}, or the path of a sensor file (*.toml)"
        raise UsageError(f"there is no sensor variant {name!r}", fix=fix)
    text = resources.files("lidarcheck").joinpath(f"sensors/{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@functools.cache
def _shipped_columns(name: str) -> Mapping[str, npt.NDArray[Any]]:
    lines = resources.files("lidarcheck").joinpath(f"sensors/{name}").read_text(encoding="utf-8").split("\n")
    rows = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
    return {key.strip(): rows[:, k] for k, key in enumerate(lines[0].split(","))}


@functools.cache
def _plain(name: str) -> Sensor:
    return sensor_of(_shipped_document(name), name, columns=_shipped_columns)


def shipped(name: str, overrides: Mapping[str, Any] = MappingProxyType({})) -> Sensor:
    """A sensor that comes with lidarcheck, with numbers and tables replaced as a model's `[sensor]` does."""
    plain = _plain(name)
    if all(key in plain.numbers() for key in overrides):
        return replace(plain, **overrides)
    document = overridden(_shipped_document(name), overrides)
    return sensor_of(document, name, columns=_shipped_columns, tables=whole_tables(overrides))


def own(sensor: Sensor) -> Sensor:
    """The variant of a sensor without overrides."""
    return sensor.plain if sensor.plain is not None else _plain(sensor.variant)


def stated_numbers(sensor: Sensor) -> frozenset[str]:
    """The detector's numbers and words that the sensor's file says; all others are defaults, or missing."""
    if sensor.file:
        document: Mapping[str, Any] = tomllib.loads(Path(sensor.file).read_text(encoding="utf-8-sig"))
    else:
        document = _shipped_document(sensor.variant)
    return frozenset(document.get(sensor.detector) or {})


def sensor_of(
    document: Mapping[str, Any],
    variant: str = "",
    *,
    columns: Columns | None = None,
    tables: Mapping[str, Any] | None = None,
) -> Sensor:
    """The sensor that a file's values describe; `UsageError` for what is wrong beyond a single key.

    `columns` reads the tables that the file names. Keys and types have been checked (`lidarcheck.sensor.schema`), or
    are checked here. Where only required numbers are absent, the sensor has them in `missing`.
    """
    from lidarcheck.sensor.schema import DETECTORS

    table = _validated(document)
    kind = DETECTORS[table.detector]
    others = [name for name in DETECTORS if name != table.detector and getattr(table, name) is not None]
    if others:
        what = f'[{others[0]}] stands beside detector = "{table.detector}"'
        raise KeyFault(what, fix=f"remove [{others[0]}], or name its detector", at=(others[0],))
    numbers, missing = _numbers(table, kind, columns)
    sweep = _sweep(table)
    beams = beams_of_table(table.beams, sweep, columns)
    wide = table.beams.footprint_deg
    rays = table.beams.sub_rays
    narrow = wide.horizontal == 0.0 and wide.vertical == 0.0
    return kind(
        variant=variant or table.name,
        name=table.name,
        source=(table.source,) if isinstance(table.source, str) and table.source else tuple(table.source),
        beams=beams,
        sweep=sweep,
        features=tuple(_feature(name, entry, columns) for name, entry in table.features.items()),
        frame_rate_hz=table.frame_rate_hz or _RATE_HZ,
        max_echoes=table.returns,
        **{name: getattr(table, name) for name in ("keep", "strength", "return_order", "duplicate_return")},
        **{name: getattr(table, name) for name in ("handedness", "time_unit", "time_zero", "deskewed")},
        footprint_deg=(wide.horizontal, wide.vertical),
        footprint=table.beams.footprint,
        sub_rays=(1, 1) if narrow else (rays.horizontal, rays.vertical),
        tables=dict(tables or {}),
        missing=(*missing, *beams_missing(table.beams)),
        **numbers,
    )


def _validated(document: Mapping[str, Any]) -> Any:
    from lidarcheck.config.schema import LineIndex, validate
    from lidarcheck.errors import ConfigError
    from lidarcheck.sensor.schema import SensorTable

    try:
        return validate(dict(document), LineIndex(Path("sensor.toml")), SensorTable)
    except ConfigError as error:
        raise UsageError(error.faults[0].what, fix=error.faults[0].fix) from None


def _numbers(table: Any, kind: type[Sensor], columns: Columns | None) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The detector's numbers and the gate's, and the names of required ones that are absent."""
    given = getattr(table, kind.detector)
    values = {} if given is None else {key: value for key, value in given.model_dump().items() if value is not None}
    values.setdefault("pulse_fwhm_ns", _PULSE_NS[kind.detector])
    gate = {RANGE_KEYS[key]: value for key, value in table.range.model_dump().items() if value is not None}
    values = {**_DEFAULTS, **gate, **values}
    if values.get("pulse_file"):
        values["pulse"] = _pulse(values["pulse_file"], columns)
    required = [f for f in kind.__dataclass_fields__.values() if f.name in kind.numbers() and f.default is _NO_DEFAULT]
    missing = tuple(f.name for f in required if f.name not in values and f.name not in ("frame_rate_hz", "max_echoes"))
    law = {"power": "range_at_threshold_m", "distance": "range_base_m"}.get(values.get("range_law", ""), "")
    missing += (law,) if law and law not in values else ()
    missing += () if table.frame_rate_hz is not None else ("frame_rate_hz",)
    return {
        **{name: _stand_in(kind, name) for name in missing if name not in (law, "frame_rate_hz")},
        **values,
    }, missing


_NO_DEFAULT = Sensor.__dataclass_fields__["variant"].default


def _stand_in(kind: type[Sensor], name: str) -> float:
    """A number in the place of one that the file lacks; the sensor is not simulated with it."""
    bound = kind.numbers()[name]
    return max(bound.low, min(1.0, bound.high))


def _pulse(file: str, columns: Columns | None) -> tuple[float, ...]:
    found = read_columns(columns, file)
    values = np.asarray(list(found.values())[-1], dtype=np.float64)
    if not len(values) or not np.all(np.isfinite(values)) or values.min() < 0.0 or values.sum() <= 0.0:
        what, fix = f"pulse_file = {file}: no pulse", "give counts of 0 or more, a row each bin"
        raise KeyFault(what, fix=fix, at=("photon_histogram", "pulse_file"))
    return tuple(float(value) for value in values / values.sum())


def _sweep(table: Any) -> Sweep:
    sweep = table.sweep
    flash = sweep.order == "flash"
    return Sweep(
        order=sweep.order,
        duration_s=sweep.duration_s if sweep.duration_s is not None else 1.0 / (table.frame_rate_hz or _RATE_HZ),
        direction=sweep.direction,
        common_receiver=flash if sweep.common_receiver is None else sweep.common_receiver,
        fire_time_in_azimuth=sweep.fire_time_in_azimuth,
    )


def _feature(name: str, entry: Any, columns: Columns | None) -> Feature:
    if entry.law not in LAWS:
        near = difflib.get_close_matches(entry.law, LAWS, n=1)
        fix = f"did you mean {near[0]}?" if near else f"use one of {', '.join(LAWS)}"
        raise KeyFault(f"features.{name}: there is no law {entry.law!r}", fix=fix, at=("features", name, "law"))
    numbers = {
        key: getattr(entry, key)
        for key in ("gain", "offset", "knee", "above", "top_percent", "per_m", "snr_full", "file")
        if getattr(entry, key) is not None
    }
    for key in numbers:
        if key not in LAWS[entry.law]:
            fix = f"its own numbers are {', '.join(LAWS[entry.law]) or 'none'}"
            what = f"features.{name}: {key} means nothing to the law {entry.law}"
            raise KeyFault(what, fix=fix, at=("features", name, key))
    for key in ("per_m", "file"):
        if key in LAWS[entry.law] and key not in numbers:
            what = f"features.{name}: the law {entry.law} needs {key}"
            raise KeyFault(what, fix=f"give {key}", at=("features", name, "law"))
    if entry.min is not None and entry.max is not None and entry.min >= entry.max:
        what = f"features.{name}: min = {entry.min:g} is not below max = {entry.max:g}"
        raise KeyFault(what, fix="exchange them", at=("features", name, "min"))
    step = entry.step if entry.step is not None else (1.0 if entry.bits is not None else 0.0)
    curve = None
    if entry.law == "table":
        curve = _curve(name, read_columns(columns, numbers["file"]))
    words = {"unit": entry.unit, "log": entry.log, "aliases": entry.aliases}
    return Feature(
        name,
        entry.law,
        step=step,
        low=entry.min,
        high=entry.max,
        bits=entry.bits,
        numbers=numbers,
        table=curve,
        **words,
    )


def _curve(name: str, found: Mapping[str, npt.NDArray[Any]]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Amplitude and value of a feature's table, amplitudes rising."""
    if len(found) != 2:
        what = f"features.{name}: its table has {len(found)} columns"
        raise KeyFault(what, fix="give amplitude and value", at=("features", name, "file"))
    a, value = (np.asarray(column, dtype=np.float64) for column in found.values())
    if len(a) < 2 or not np.all(np.diff(a) > 0.0) or a[0] <= 0.0 or not np.all(np.isfinite(value)):
        what = f"features.{name}: its table's amplitudes do not rise from above 0"
        raise KeyFault(what, fix="sort the rows", at=("features", name, "file"))
    return tuple(a.tolist()), tuple(value.tolist())
