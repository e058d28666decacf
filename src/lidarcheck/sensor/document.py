"""From a sensor file's values to a sensor."""

from __future__ import annotations

import difflib
import functools
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.sensor.beam_table import TableBeams
from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.channels import ChannelBeams, Channels
from lidarcheck.sensor.feature import LAWS, Feature
from lidarcheck.sensor.grid import Axis, GridBeams
from lidarcheck.sensor.sensor import RANGE_KEYS, Sensor
from lidarcheck.sensor.sweep import Sweep

__all__ = ["Columns", "overridden", "own", "sensor_of", "shipped", "shipped_names"]

Columns = Callable[[str], Mapping[str, npt.NDArray[Any]]]
"""What reads a table that a sensor file names: its columns by their names."""
_ALIASES = {
    "max_echoes": ("returns",),
    "max_range_m": ("range", "max_m"),
    "range_resolution_m": ("range", "step_m"),
} | {name: ("range", key) for key, name in RANGE_KEYS.items()}
_OF_SENSOR = ("frame_rate_hz", "returns", "keep", "strength", "return_order", "duplicate_return")
_TABLES = ("range", "beams", "sweep", "features")
_DEFAULTS = {"min_range_m": 0.0, "max_range_m": 300.0, "range_resolution_m": 0.01, "range_offset_m": 0.0}
_PULSE_NS = {"spad_array": 5.0, "linear": 5.0, "photon_histogram": 1.0}
_OF_KIND: Mapping[str, tuple[str, ...]] = {
    "grid": ("layers", "points", "elevation_deg", "azimuth_deg"),
    "channels": (
        "elevation_deg", "azimuth_deg", "azimuth_offset_deg", "origin_m", "side_m", "height_m", "range_offset_m",
        "fire_time_us", "ring", "column_shift", "columns", "azimuth_step_deg", "columns_repeat", "file",
    ),
    "table": ("file", "direction"),
}  # fmt: skip
_OF_ALL = ("kind", "footprint_deg", "footprint", "sub_rays")


def shipped_names() -> tuple[str, ...]:
    """The sensors that come with lidarcheck, in order of their names, the built-in reference sensors first."""
    folder = resources.files("lidarcheck").joinpath("sensors")
    names = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    return tuple(sorted(names, key=lambda name: (name not in ("SMART", "SLIM"), name != "SMART", name)))


@functools.cache
def _shipped_document(name: str) -> dict[str, Any]:
    if name not in shipped_names():
        near = difflib.get_close_matches(name.upper(), shipped_names(), n=1)
        fix = f"did you mean {near[0]}? " if near else ""
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
    return sensor_of(document, name, columns=_shipped_columns, tables=_tables_of(overrides))


def own(sensor: Sensor) -> Sensor:
    """The variant of a sensor without overrides."""
    return sensor.plain if sensor.plain is not None else _plain(sensor.variant)


def _tables_of(overrides: Mapping[str, Any]) -> dict[str, Any]:
    return {name: overrides[name] for name in _TABLES[1:] if overrides.get(name)}


def overridden(document: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A sensor file's values with those of a model's `[sensor]` in their place; `UsageError` for two names of one."""
    kind = str(document.get("detector"))
    found: dict[str, Any] = {key: dict(value) if isinstance(value, dict) else value for key, value in document.items()}
    written: dict[tuple[str, ...], str] = {}
    for key, value in _flat(overrides, kind):
        name = ".".join(key[0])
        if key[1] in written and written[key[1]] != name:
            raise UsageError(f"{name} and {written[key[1]]} are one number", fix="give one of them")
        written[key[1]] = name
        table = found
        for part in key[1][:-1]:
            table[part] = dict(table.get(part) or {})
            table = table[part]
        table[key[1][-1]] = value
    return found


def _flat(overrides: Mapping[str, Any], kind: str) -> list[tuple[tuple[tuple[str, ...], tuple[str, ...]], Any]]:
    """Each override: the name that it was given by, its place in the sensor file, its value."""
    from lidarcheck.sensor.schema import DETECTORS, overrides_table

    known = overrides_table(DETECTORS[kind]).model_fields
    found: list[tuple[tuple[tuple[str, ...], tuple[str, ...]], Any]] = []
    for name, value in overrides.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            raise UsageError(
                f"a sensor has no number {name!r}",
                fix=f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}",
            )
        if name in _TABLES:
            found += _leaves((name,), value)
        elif name in _OF_SENSOR:
            found.append((((name,), (name,)), value))
        else:
            found.append((((name,), _ALIASES.get(name, (kind, name))), value))
    return found


def _leaves(at: tuple[str, ...], value: Any) -> list[tuple[tuple[tuple[str, ...], tuple[str, ...]], Any]]:
    deep = (at[0] == "features" and len(at) < 2) or len(at) < 1 + (at[0] == "features") + 1
    if isinstance(value, Mapping) and deep and (at[0] != "beams" or len(at) == 1):
        return [leaf for key, entry in value.items() for leaf in _leaves((*at, key), entry)]
    return [((at, at), value)]


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
        raise UsageError(f"[{others[0]}] stands beside detector = {table.detector!r}", fix=f"remove [{others[0]}]")
    numbers, missing = _numbers(table, kind, columns)
    sweep = _sweep(table)
    beams = _beams(table.beams, sweep, columns)
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
        frame_rate_hz=table.frame_rate_hz,
        max_echoes=table.returns,
        **{name: getattr(table, name) for name in ("keep", "strength", "return_order", "duplicate_return")},
        **{name: getattr(table, name) for name in ("handedness", "time_unit", "time_zero", "deskewed")},
        footprint_deg=(wide.horizontal, wide.vertical),
        footprint=table.beams.footprint,
        sub_rays=(1, 1) if narrow else (rays.horizontal, rays.vertical),
        tables=dict(tables or {}),
        missing=missing,
        **numbers,
    )


def _validated(document: Mapping[str, Any]) -> Any:
    from pathlib import Path

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
    return {**{name: _stand_in(kind, name) for name in missing if name != law}, **values}, missing


_NO_DEFAULT = Sensor.__dataclass_fields__["variant"].default


def _stand_in(kind: type[Sensor], name: str) -> float:
    """A number in the place of one that the file lacks; the sensor is not simulated with it."""
    bound = kind.numbers()[name]
    return max(bound.low, min(1.0, bound.high))


def _pulse(file: str, columns: Columns | None) -> tuple[float, ...]:
    found = _read(columns, file)
    values = np.asarray(list(found.values())[-1], dtype=np.float64)
    if not len(values) or not np.all(np.isfinite(values)) or values.min() < 0.0 or values.sum() <= 0.0:
        raise UsageError(f"pulse_file = {file}: no pulse", fix="give counts of 0 or more, a row each bin")
    return tuple(float(value) for value in values / values.sum())


def _read(columns: Columns | None, file: str) -> Mapping[str, npt.NDArray[Any]]:
    if columns is None:
        raise UsageError(f"the table {file} cannot be read here", fix="load the sensor from its file")
    return columns(file)


def _sweep(table: Any) -> Sweep:
    sweep = table.sweep
    flash = sweep.order == "flash"
    return Sweep(
        order=sweep.order,
        duration_s=sweep.duration_s if sweep.duration_s is not None else 1.0 / table.frame_rate_hz,
        direction=sweep.direction,
        common_receiver=flash if sweep.common_receiver is None else sweep.common_receiver,
        fire_time_in_azimuth=sweep.fire_time_in_azimuth,
    )


def _beams(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    given = [name for name in table.model_fields_set if getattr(table, name) is not None]
    for name in given:
        if name not in (*_OF_ALL, *_OF_KIND[table.kind]):
            kinds = ", ".join(kind for kind, names in _OF_KIND.items() if name in names)
            raise UsageError(
                f'beams.{name} means nothing with kind = "{table.kind}"', fix=f"remove it; it is for {kinds}"
            )
    return {"grid": _grid, "channels": _channels, "table": _table}[table.kind](table, sweep, columns)


def _grid(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    for name in _OF_KIND["grid"]:
        if getattr(table, name) is None:
            raise UsageError(f"beams.{name} is missing", fix='kind = "grid" needs ' + ", ".join(_OF_KIND["grid"]))
    for name in ("elevation_deg", "azimuth_deg"):
        if not hasattr(getattr(table, name), "step"):
            raise UsageError(f"beams.{name} has no step", fix="give {first = …, step = …}")
    up, aside = table.elevation_deg, table.azimuth_deg
    highest = max(abs(up.first), abs(up.first + (table.layers - 1) * up.step))
    if highest > 90.0 + 1e-9:
        raise UsageError(f"the last of {table.layers} layers is {highest:g} degrees steep", fix="correct first or step")
    return GridBeams(sweep, Axis(table.layers, up.first, up.step), Axis(table.points, aside.first, aside.step))


def _channels(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    given = {name: getattr(table, name) for name in Channels.__dataclass_fields__ if getattr(table, name) is not None}
    if table.file is not None:
        read = _read(columns, table.file)
        strange = [name for name in read if name not in Channels.__dataclass_fields__]
        if strange:
            fix = f"known: {', '.join(Channels.__dataclass_fields__)}"
            raise UsageError(f"{table.file} has a column {strange[0]!r}", fix=fix)
        both = [name for name in read if name in given]
        if both:
            raise UsageError(f"beams.{both[0]} stands in the sensor file and in {table.file}", fix="give it once")
        given |= {name: tuple(values.tolist()) for name, values in read.items()}
    if not isinstance(given.get("elevation_deg"), tuple):
        raise UsageError("beams.elevation_deg is no list", fix="give one elevation a channel")
    n = len(given["elevation_deg"])
    if not n:
        raise UsageError("beams.elevation_deg is empty", fix="give one elevation a channel")
    lists = {name: _channel_values(name, given.get(name, 0), n) for name in Channels.__dataclass_fields__}
    lists["ring"] = tuple(int(ring) for ring in given.get("ring", range(n)))
    lists["column_shift"] = tuple(int(shift) for shift in lists["column_shift"])
    _check_lists(lists)
    return _turning(table, Channels(**lists), sweep)


def _channel_values(name: str, value: Any, n: int) -> tuple[Any, ...]:
    values = tuple(value) if isinstance(value, Sequence) else (value,) * n
    if len(values) != n:
        what = f"beams.{name} has {len(values)} values, elevation_deg has {n}"
        raise UsageError(what, fix=f"give {n}, one a channel, or one number for all")
    return values


def _check_lists(lists: Mapping[str, tuple[Any, ...]]) -> None:
    elevation = np.asarray(lists["elevation_deg"], dtype=np.float64)
    n = len(elevation)
    if n > 1 and not elevation.any():
        raise UsageError("beams.elevation_deg is 0 throughout", fix="give each channel's elevation")
    if len(lists["ring"]) != n or len(set(lists["ring"])) != n:
        raise UsageError(f"beams.ring needs {n} numbers, each once", fix="give the file's ring number of each channel")
    if n >= 8 and np.ptp(elevation) < 1.6 and np.abs(elevation).max() < 0.8:
        what = f"beams.elevation_deg spans {np.ptp(elevation):.3g} degrees over {n} channels: these look like radians"
        raise UsageError(what, fix="write degrees")


def _turning(table: Any, channels: Channels, sweep: Sweep) -> ChannelBeams:
    turn = table.azimuth_deg
    first = 0.0 if turn is None else turn.first
    way = 1.0 if sweep.direction == "left" else -1.0
    if turn is not None and hasattr(turn, "step") and not hasattr(turn, "last"):
        raise UsageError("beams.azimuth_deg has a step", fix='with kind = "channels" give {first = …, last = …}')
    last = first + way * 360.0 if turn is None or turn.last is None else turn.last
    span = last - first
    if span == 0.0 or abs(span) > 360.0 + 1e-9:
        raise UsageError(f"beams.azimuth_deg spans {span:g} degrees", fix="last is one step past the last column")
    if span * way < 0.0:
        what = f'beams.azimuth_deg goes {"left" if span > 0 else "right"}, sweep.direction is "{sweep.direction}"'
        raise UsageError(what, fix=f"let last be {first + way * abs(span):g}, or direction the other one")
    if (table.columns is None) == (table.azimuth_step_deg is None):
        what = "beams needs columns or azimuth_step_deg" + ("" if table.columns is None else ", and has both")
        raise UsageError(what, fix="give one of them")
    step = span / table.columns if table.columns is not None else np.copysign(table.azimuth_step_deg, span)
    repeats = True if table.columns_repeat is None else table.columns_repeat
    columns = span / step
    if repeats and abs(columns - round(columns)) > 1e-3:
        what = f"azimuth_step_deg = {abs(step):g} gives {columns:.3f} columns"
        raise UsageError(what, fix="give a step that divides the span, or columns_repeat = false")
    return ChannelBeams(sweep, channels, first, span, float(step), repeats)


def _table(table: Any, sweep: Sweep, columns: Columns | None) -> Beams:
    if table.direction == "from_scan" and table.file is None:
        return TableBeams(sweep, np.full((1, 1, 2), np.nan), np.zeros((1, 1)), None, from_scan=True)
    if table.file is None:
        raise UsageError("beams.file is missing", fix='kind = "table" needs the file of the beam table')
    return TableBeams.of_columns(sweep, _read(columns, table.file), from_scan=table.direction == "from_scan")


def _feature(name: str, entry: Any, columns: Columns | None) -> Feature:
    if entry.law not in LAWS:
        near = difflib.get_close_matches(entry.law, LAWS, n=1)
        fix = f"did you mean {near[0]}?" if near else f"use one of {', '.join(LAWS)}"
        raise UsageError(f"features.{name}: there is no law {entry.law!r}", fix=fix)
    numbers = {
        key: getattr(entry, key)
        for key in ("gain", "offset", "knee", "above", "top_percent", "per_m", "snr_full", "file")
        if getattr(entry, key) is not None
    }
    for key in numbers:
        if key not in LAWS[entry.law]:
            fix = f"its own numbers are {', '.join(LAWS[entry.law]) or 'none'}"
            raise UsageError(f"features.{name}: {key} means nothing to the law {entry.law}", fix=fix)
    for key in ("per_m", "file"):
        if key in LAWS[entry.law] and key not in numbers:
            raise UsageError(f"features.{name}: the law {entry.law} needs {key}", fix=f"give {key}")
    step = entry.step if entry.step is not None else (1.0 if entry.bits is not None else 0.0)
    curve = None
    if entry.law == "table":
        curve = _curve(name, _read(columns, numbers["file"]))
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
        raise UsageError(f"features.{name}: its table has {len(found)} columns", fix="give amplitude and value")
    a, value = (np.asarray(column, dtype=np.float64) for column in found.values())
    if len(a) < 2 or not np.all(np.diff(a) > 0.0) or a[0] <= 0.0 or not np.all(np.isfinite(value)):
        raise UsageError(f"features.{name}: its table's amplitudes do not rise from above 0", fix="sort the rows")
    return tuple(a.tolist()), tuple(value.tolist())
