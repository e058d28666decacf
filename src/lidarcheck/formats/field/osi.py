"""ASAM OSI traces: the lidar detections of `SensorData`, from `.osi`, `.txth` and MCAP (extra `osi`).

A detection is a distance, an azimuth (positive to the left) and an elevation (positive upward) in the sensor's frame;
one that is marked invalid is no return. Ground truth is not needed and not read. A `.osi` file is a length of four
bytes and a message, over and over; one that was cut short is read as far as it is whole.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.field.choice import chosen
from lidarcheck.formats.field.container import SENSOR_DATA, Container, Place
from lidarcheck.formats.field.extras import needed
from lidarcheck.formats.field.packing import CHUNK_BYTES
from lidarcheck.formats.field.recording import Recording
from lidarcheck.formats.limits import CONFIG_BYTES, check_rows
from lidarcheck.formats.source import read_text
from lidarcheck.formats.table import Table, counted, quoted

__all__ = ["is_osi", "open_osi", "open_osi_channel"]

_INVALID = 2
"""`DETECTION_CLASSIFICATION_INVALID`."""
_NUMBERS = ("intensity", "reflectivity", "echo_pulse_width", "existence_probability", "radial_velocity")
_SENSOR = re.compile(r"(.*?):?([0-9]{1,4})")


@dataclass
class _Trace(Recording):
    """`message`: gives the bytes of a frame's `SensorData`; `sensor`: which of its lidars is read."""

    count: int = 0
    sensor: int | None = None
    message: Callable[[int], bytes] = bytes

    def __len__(self) -> int:
        return self.count

    def table(self, number: int) -> Table:
        """The detections of a frame."""
        data = _sensor_data(self.message(number), self.path)
        return _table(_lidar(data, self.sensor, self.path).detection, self.path)


@dataclass
class _Messages:
    """Places of messages in a file of lengths and messages."""

    path: Path
    places: Sequence[tuple[int, int]]

    def __call__(self, number: int) -> bytes:
        at, size = self.places[number]
        with self.path.open("rb") as stream:
            stream.seek(at)
            return stream.read(size)


@dataclass
class _Channel:
    """Messages of a channel of MCAP."""

    bag: Container
    places: Sequence[Place]

    def __call__(self, number: int) -> bytes:
        return self.bag.message(self.places[number])


def is_osi(path: Path) -> bool:
    """Whether a file without a mark is a trace, by its suffix."""
    return path.suffix.lower() in (".osi", ".txth")


def open_osi(path: Path, topic: str = "") -> Recording:
    """The frames of a trace; `topic`: the number of a lidar, where `SensorData` has several.

    `InputError` where it holds no `SensorData` with lidar detections, or several lidars of which none is chosen.
    """
    if path.suffix.lower() == ".txth":
        contents, lost = _text_messages(path), ""
        message: Callable[[int], bytes] = _Held(contents)
        count = len(contents)
    else:
        places, lost = _places(path)
        message, count = _Messages(path, places), len(places)
    if not count:
        raise InputError("the trace holds no whole message", file=path, fix="was it written completely?")
    return _opened(path, "OSI trace", topic, message, count, [lost] if lost else [])


@dataclass
class _Held:
    contents: Sequence[bytes]

    def __call__(self, number: int) -> bytes:
        return self.contents[number]


def open_osi_channel(bag: Container, topic: str = "") -> Recording:
    """The frames of a channel of `SensorData` in MCAP, with a lidar's number behind a colon where it has several."""
    from lidarcheck.formats.field.bags import choose_topic

    found = bag.of_kind(SENSOR_DATA)
    name = topic or chosen().topic
    match = _SENSOR.fullmatch(name)
    number = ""
    if match and name not in [one.name for one in found]:
        name, number = match[1], match[2]
    own = choose_topic(bag, found, name)
    places = bag.places.get(own.number, [])
    notes = [bag.lost] if bag.lost else []
    opened = _opened(bag.path, "OSI trace (MCAP)", number, _Channel(bag, places), len(places), notes)
    opened.topic = f"{own.name}:{number}" if number else own.name
    opened.topics = tuple((one.name, bag.counts[one.number]) for one in found)
    return opened


def _opened(
    path: Path, title: str, topic: str, message: Callable[[int], bytes], count: int, notes: Sequence[str]
) -> Recording:
    first, last = (_sensor_data(message(number), path) for number in (0, count - 1))
    if topic and not topic.isdecimal():
        raise InputError(f"a trace has no topic {quoted(topic)}", file=path, fix="give the number of a lidar, from 0")
    sensor = int(topic) if topic else None
    _lidar(first, sensor, path)
    span = _seconds(last) - _seconds(first)
    times = tuple(span * number / max(count - 1, 1) for number in range(count)) if span > 0 else None
    start_ns = first.timestamp.seconds * 10**9 + first.timestamp.nanos
    return _Trace(
        path, title, topic, times, tuple(notes), start_ns=start_ns, count=count, sensor=sensor, message=message
    )


def _places(path: Path) -> tuple[list[tuple[int, int]], str]:
    """First byte and size of each whole message, and what is lost."""
    size, at, places = path.stat().st_size, 0, []
    with path.open("rb") as stream:
        while at + 4 <= size:
            stream.seek(at)
            (length,) = struct.unpack("<I", stream.read(4))
            if length > CHUNK_BYTES and at + 4 + length <= size:
                fix = f"the limit is {CHUNK_BYTES} bytes"
                raise InputError(f"a message says that it has {length} bytes", file=path, fix=fix)
            if at + 4 + length > size:
                break
            places.append((at + 4, length))
            at += 4 + length
    lost = f"cut short: its last {size - at} bytes are no whole message" if at < size else ""
    return places, lost


def _text_messages(path: Path) -> list[bytes]:
    """The messages of a trace as text, which begin with the same line."""
    if path.stat().st_size > 16 * CONFIG_BYTES:
        what = f"the trace is text of {path.stat().st_size} bytes"
        raise InputError(what, file=path, fix="write it as .osi, which is read message by message")
    text = read_text(path) if path.stat().st_size <= CONFIG_BYTES else path.read_text("utf-8", "replace")
    lines = [line for line in text.split("\n") if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        return []
    first = re.match(r"\w+", lines[0])
    starts = [i for i, line in enumerate(lines) if first and re.match(rf"{first[0]}\b", line)] or [0]
    needed("osi3", "osi", "an OSI trace", path)
    from google.protobuf import text_format
    from osi3.osi_sensordata_pb2 import SensorData

    found = []
    for begin, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        try:
            found.append(text_format.Parse("\n".join(lines[begin:end]), SensorData()).SerializeToString())
        except (text_format.ParseError, ValueError, RecursionError) as error:
            said = " ".join(str(error).split())[:200]
            raise InputError(f"the text is no SensorData: {said}", file=path, fix="write it as .osi") from None
    return found


def _sensor_data(content: bytes, path: Path) -> Any:
    needed("osi3", "osi", "an OSI trace", path)
    from google.protobuf.message import DecodeError
    from osi3.osi_sensordata_pb2 import SensorData

    try:
        return SensorData.FromString(content)
    except (DecodeError, ValueError) as error:
        what = f"a message is no SensorData: {' '.join(str(error).split())[:200]}"
        raise InputError(what, file=path, fix="record SensorData, whose files have _sd_ in their names") from None


def _seconds(data: Any) -> float:
    return float(data.timestamp.seconds) + 1e-9 * float(data.timestamp.nanos)


def _lidar(data: Any, sensor: int | None, path: Path) -> Any:
    """The detections of the lidar that is asked for."""
    lidars = data.feature_data.lidar_sensor
    if not len(lidars):
        what = "the trace holds no lidar detections (feature_data.lidar_sensor of SensorData)"
        raise InputError(what, file=path, fix="record the SensorData of a lidar model")
    if sensor is None and len(lidars) > 1:
        said = ", ".join(f"{i} ({counted(len(one.detection), 'detection')})" for i, one in enumerate(lidars[:12]))
        raise InputError(f"holds {len(lidars)} lidars: {said}", file=path, fix=f"choose one: '{path}#0'")
    if sensor is not None and sensor >= len(lidars):
        raise InputError(f"has no lidar {sensor}", file=path, fix=f"use 0 to {len(lidars) - 1}")
    return lidars[sensor or 0]


def _table(detections: Any, path: Path) -> Table:
    check_rows(len(detections), len(_NUMBERS) + 6, path, says="a message holds")
    place = [one.position for one in detections]
    distance, azimuth, elevation = (
        np.array([getattr(one, name) for one in place], dtype=np.float64)
        for name in ("distance", "azimuth", "elevation")
    )
    flat = distance * np.cos(elevation)
    xyz = (flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation))
    columns: dict[str, Any] = {**dict(zip("XYZ", xyz, strict=True)), "RANGE": distance}
    for name in _NUMBERS:
        if any(one.HasField(name) for one in detections):
            columns[name] = np.array([getattr(one, name) for one in detections], dtype=np.float64)
    if all(one.HasField("beam_id") for one in detections):
        numbers = np.array([one.beam_id.value for one in detections], dtype=np.uint64)
        columns["beam_id"] = np.minimum(numbers, np.uint64(2**62)).astype(np.int64)
    invalid = np.array([one.classification == _INVALID for one in detections], dtype=np.uint8)
    if invalid.any():
        columns["invalid"] = invalid
    return Table(columns, path)
