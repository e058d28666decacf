"""ASAM OSI: a `LidarSensorViewConfiguration` in the JSON form of its protobuf, names in either spelling.

Directions are unit vectors with times in us after the frame's start; where there are none, rays fill a field of view.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.words import dotted
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, linear_lacks, rate_lacks, rounded
from lidarcheck.formats.sensors.values import MOST_BEAMS, Values

__all__ = ["import_osi", "is_osi"]

_HOLDER = "lidar_sensor_view_configuration"
_KEYS = ("directions", "number_of_rays_horizontal", "num_of_pixels")
_UNIT = 1e-3
"""How far a direction's length may be from 1."""


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name).lower()


def _spelled(data: Any) -> Any:
    """Keys in the spelling of the protobuf; lists and numbers as they are."""
    return {_snake(key): value for key, value in data.items()} if isinstance(data, dict) else data


def _places(data: Any) -> list[tuple[str | int, ...]]:
    """Where the configurations stand: the document itself, or entries of a sensor view's configuration."""
    if not isinstance(data, dict):
        return []
    holder = next((key for key in data if _snake(key) == _HOLDER), None)
    if holder is None:
        return [()]
    held = data[holder]
    return [(holder, index) for index in range(len(held))] if isinstance(held, list) else [(holder,)]


def is_osi(data: Any) -> bool:
    """Whether JSON is such a configuration, or a sensor view's with one."""
    found = [_spelled(Values(data, LineIndex(Path())).find(*place)) for place in _places(data)]
    return any(isinstance(entry, dict) and any(key in entry for key in _KEYS) for entry in found)


def _view(values: Values, place: tuple[str | int, ...]) -> Values:
    """The configuration there, keys in the protobuf's spelling, with their lines."""
    lines = {
        tuple(_snake(part) if isinstance(part, str) else part for part in path[len(place) :]): line
        for path, line in values.lines.lines.items()
        if path[: len(place)] == place
    }
    data = _spelled(values.find(*place))
    return Values(data, LineIndex(values.lines.file, lines), as_text=True)  # JSON spells 64-bit numbers as text


def import_osi(values: Values, given: Given) -> Imported:
    """The sensor of the configuration; `InputError` where it is none, or its lists do not fit together."""
    places = _places(values.data)
    if len(places) != 1:
        raise values.fault((), f"the file has {len(places)} lidar configurations", "keep one of them")
    view = _view(values, places[0])
    document: dict[str, Any] = {
        "name": "OSI lidar",
        "source": [f"{values.lines.file.name}: LidarSensorViewConfiguration"],
        "detector": "linear",
    }
    lacking: list[Lacking] = []
    rate_hz = given.rate_hz or (_rate(view) if view.find("update_cycle_time") else None)
    if rate_hz is None:
        lacking.append(rate_lacks("1 / update_cycle_time"))
    else:
        document["frame_rate_hz"] = rate_hz
    echoes = view.maybe("max_number_of_interactions", low=0, high=16)
    if echoes and echoes > 1:
        lacking.append(Lacking("returns", int(echoes), "max_number_of_interactions of a ray, if each is an echo"))
    remarks: list[str] = []
    table: dict[str, Sequence[float]] = {}
    if view.find("directions"):
        table = _directions(view)
        timed = "time_s" in table
        document["sweep"] = {"order": "table"} if timed else {"order": "flash", "common_receiver": False}
        document["beams"] = {"kind": "table"}
        remarks.append("beam_id of a LidarDetection is the row of the table: Layer 0, Point beam_id.")
    else:
        document["sweep"] = {"order": "flash", "common_receiver": False}
        document["beams"] = _grid(view, remarks)
    document["linear"] = {}
    example = {"law": "calibrated_reflectivity", "max": 100, "above": "clip", "aliases": ["intensity"]}
    lacking += [*linear_lacks(), Lacking("features.INTENSITY", example, "`intensity` of a detection is in percent")]
    return Imported(document, tuple(lacking), tuple(remarks), table)


def _rate(view: Values) -> float | None:
    parts = [view.maybe("update_cycle_time", key, low=0, high=1e9) or 0.0 for key in ("seconds", "nanos")]
    seconds = parts[0] + parts[1] * 1e-9
    return rounded(1.0 / seconds, "deg") if seconds else None


def _directions(view: Values) -> dict[str, Sequence[float]]:
    rows = view.entries("directions")
    count = view.maybe("num_of_pixels", low=0)
    if count is not None and count != len(rows):
        raise view.fault(("num_of_pixels",), f"num_of_pixels = {count:g}, there are {len(rows)} directions")
    elevation, azimuth = [], []
    for index in range(len(rows)):
        # JSON leaves a number out that is 0
        x, y, z = (view.maybe("directions", index, axis, low=-2, high=2) or 0.0 for axis in "xyz")
        length = math.sqrt(x * x + y * y + z * z)
        if abs(length - 1.0) > _UNIT:
            what = f"{dotted(('directions', index))} has the length {length:g}"
            raise view.fault(("directions", index), what, "use unit vectors")
        elevation.append(rounded(math.degrees(math.atan2(z, math.hypot(x, y))), "deg"))
        azimuth.append(rounded(math.degrees(math.atan2(y, x)), "deg"))
    table: dict[str, Sequence[float]] = {
        "Layer": [0] * len(rows), "Point": list(range(len(rows))), "elevation_deg": elevation, "azimuth_deg": azimuth,
    }  # fmt: skip
    if view.find("timings"):
        times = view.numbers("timings", count=len(rows))
        if min(times) < 0 or max(times) > 1e7:
            raise view.fault(("timings",), f"timings of {min(times):g} to {max(times):g} us", "use us after the start")
        table["time_s"] = [rounded(time * 1e-6, "m") for time in times]
    return table


def _grid(view: Values, remarks: list[str]) -> dict[str, Any]:
    counts, angles = [], []
    for axis, most in (("horizontal", 2 * math.pi), ("vertical", math.pi)):
        count = view.whole(f"number_of_rays_{axis}", low=1, high=MOST_BEAMS)
        span = view.number(f"field_of_view_{axis}", low=0)
        if span > most * (1 + 1e-4):
            what = f"field_of_view_{axis} = {span:g} looks like degrees, and radians are expected"
            raise view.fault((f"field_of_view_{axis}",), what, "divide it by 57.29578")
        full = span > 2 * math.pi * (1 - 1e-4)
        step = math.degrees(span) / (count if full else max(count - 1, 1)) or 1.0
        first = -math.degrees(span) / 2 + (step / 2 if full else 0.0) if count > 1 else 0.0
        counts.append(count)
        angles.append({"first": first, "step": step})
    if counts[0] * counts[1] > MOST_BEAMS:
        raise view.fault(("number_of_rays_horizontal",), f"{counts[0]} x {counts[1]} rays, {MOST_BEAMS} are read")
    remarks.append("Rays are taken to fill the field of view evenly, its ends included, first to the right and below: "
                   "unverified.")  # fmt: skip
    return {
        "kind": "grid",
        "layers": counts[1],
        "points": counts[0],
        "elevation_deg": angles[1],
        "azimuth_deg": angles[0],
    }
