"""What a model's `[sensor]` changes of a sensor file."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from lidarcheck.errors import UsageError
from lidarcheck.sensor.sensor import RANGE_KEYS

__all__ = ["overridden", "place_of_number", "whole_tables"]

_ALIASES = {
    "max_echoes": ("returns",),
    "max_range_m": ("range", "max_m"),
    "range_resolution_m": ("range", "step_m"),
} | {name: ("range", key) for key, name in RANGE_KEYS.items()}
_OF_SENSOR = ("frame_rate_hz", "returns", "keep", "strength", "return_order", "duplicate_return")
_TABLES = ("range", "beams", "sweep", "features")


def place_of_number(name: str, detector: str) -> tuple[str, ...]:
    """Where a number stands in a sensor file, by the name that it has in a model's `[sensor]`."""
    return (name,) if name in _OF_SENSOR else _ALIASES.get(name, (detector, name))


def whole_tables(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """What a model changes of tables whose values are no numbers of the detector."""
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
        else:
            found.append((((name,), place_of_number(name, kind)), value))
    return found


def _leaves(at: tuple[str, ...], value: Any) -> list[tuple[tuple[tuple[str, ...], tuple[str, ...]], Any]]:
    deep = (at[0] == "features" and len(at) < 2) or len(at) < 1 + (at[0] == "features") + 1
    if isinstance(value, Mapping) and deep and (at[0] != "beams" or len(at) == 1):
        return [leaf for key, entry in value.items() for leaf in _leaves((*at, key), entry)]
    return [((at, at), value)]
