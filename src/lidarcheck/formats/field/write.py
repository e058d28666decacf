"""Frames written one after the other into one file: PointCloud2 in MCAP or a ROS 1 bag, OSI, CSV and text.

The bags are written by the package rosbags (extra `bags`), OSI by osi-python (extra `osi`).
"""

from __future__ import annotations

import contextlib
import shutil
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.atomic import atomic_path
from lidarcheck.formats.columns import missing
from lidarcheck.formats.convert import converted
from lidarcheck.formats.field.describe import said_once
from lidarcheck.formats.field.extras import needed
from lidarcheck.formats.field.message import cloud_message
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.recognise import FORMATS
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import rows_as_text
from lidarcheck.formats.times import TimeUnit, frame_of
from lidarcheck.sensor import Sensor

__all__ = ["STREAM_SUFFIXES", "FrameToWrite", "is_stream", "write_frames"]

_TOPIC, _FRAME_ID = "/points", "lidar"
_INVALID = 2
STREAM_SUFFIXES = {".mcap": "mcap", ".bag": "rosbag", ".osi": "osi"}
"""Suffixes of files that hold any number of frames and nothing else can write."""
_AS_TABLE = {".csv": ",", **dict.fromkeys(FORMATS["text"].suffixes, " ")}


class FrameToWrite(NamedTuple):
    """A frame's rows, its number, when it was measured, and how it is read."""

    table: Table
    number: int
    time_ns: int
    placement: Placement = AS_IT_IS
    sensor: Sensor | None = None


class _Writer(Protocol):
    def add(self, table: Table, frame: FrameToWrite) -> None:
        """Write a frame."""


def is_stream(target: Path) -> bool:
    """Whether frames go into such a file one by one."""
    return target.suffix.lower() in STREAM_SUFFIXES


def write_frames(
    frames: Iterable[FrameToWrite], target: Path, *, drop_empty: bool = False, time_unit: TimeUnit | None = None
) -> int:
    """Write frames one after the other, as `formats.convert.convert` writes one; how many there were.

    `UsageError` for a format that holds one frame, `InputError` for what is wrong with a frame; nothing is written
    then.
    """
    suffix = target.suffix.lower()
    form = STREAM_SUFFIXES.get(suffix, "csv" if suffix == ".csv" else "text")
    if suffix not in STREAM_SUFFIXES and suffix not in _AS_TABLE:
        known = ", ".join((*STREAM_SUFFIXES, *_AS_TABLE))
        what = f"there are several frames, and a {suffix or 'nameless'} file holds one"
        raise UsageError(what, file=target, fix=f"split them: lidarcheck split, or write one of {known}")
    count = 0
    with atomic_path(target) as place, _writer(suffix, place, target) as writer:
        for frame in said_once(frames):
            table = converted(frame.table, form, frame.placement, drop_empty, time_unit, frame.sensor)
            writer.add(table, frame)
            count += 1
        if not count:
            raise InputError("there is no frame to write", file=target, fix="name frames")
    return count


@contextlib.contextmanager
def _writer(suffix: str, place: Path, target: Path) -> Iterator[_Writer]:
    """What writes into the file `place`; `target`: its name in messages."""
    if suffix in _AS_TABLE:
        with place.open("wb") as stream:
            yield _Rows(stream, _AS_TABLE[suffix], target)
    elif suffix == ".osi":
        needed("osi3", "osi", "to write an OSI trace", target)
        with place.open("wb") as stream:
            yield _Osi(stream, target)
    elif suffix == ".bag":
        with _ros1(place, target) as writer:
            yield writer
    else:
        with _mcap(place, target) as writer:
            yield writer


@contextlib.contextmanager
def _ros1(place: Path, target: Path) -> Iterator[_Writer]:
    bags, stores = (needed(f"rosbags.{name}", "bags", "to write a bag", target) for name in ("rosbag1", "typesys"))
    place.unlink()  # made so that nobody else takes the name; the package wants to make it itself
    with bags.Writer(place) as bag:
        store = stores.get_typestore(stores.Stores.ROS1_NOETIC)
        connection = bag.add_connection(_TOPIC, "sensor_msgs/msg/PointCloud2", typestore=store)
        yield _Clouds(bag, connection, "ros1", target)


@contextlib.contextmanager
def _mcap(place: Path, target: Path) -> Iterator[_Writer]:
    bags, stores = (needed(f"rosbags.{name}", "bags", "to write a bag", target) for name in ("rosbag2", "typesys"))
    folder = place.with_name(f"{place.name}.d")
    try:
        with bags.Writer(folder, version=9, storage_plugin=bags.StoragePlugin.MCAP) as bag:
            store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
            connection = bag.add_connection(_TOPIC, "sensor_msgs/msg/PointCloud2", typestore=store)
            yield _Clouds(bag, connection, "cdr", target)
        (folder / f"{folder.name}.mcap").replace(place)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class _Clouds:
    """PointCloud2, a message a frame."""

    def __init__(self, bag: Any, connection: Any, encoding: str, target: Path) -> None:
        self.bag, self.connection, self.encoding, self.target = bag, connection, encoding, target

    def add(self, table: Table, frame: FrameToWrite) -> None:
        """Write a frame."""
        message = cloud_message(table, self.encoding, frame.time_ns, _FRAME_ID, self.target)
        self.bag.write(self.connection, frame.time_ns, message)


class _Rows:
    """Rows of all frames, told apart by a column Frame."""

    def __init__(self, stream: Any, delimiter: str, target: Path) -> None:
        self.stream, self.delimiter, self.target = stream, delimiter, target
        self.names: tuple[str, ...] = ()

    def add(self, table: Table, frame: FrameToWrite) -> None:
        """Write a frame."""
        own = frame_of(table.columns) is not None
        columns = dict(table.columns) if own else {**table.columns, "Frame": np.full(len(table), frame.number)}
        names = tuple(name for name in columns)
        if not self.names:
            self.names = names
            for name in names:
                if any(sign in name for sign in ',;" \t\r\n'):
                    raise InputError(f"a column is called {name!r}", file=self.target, fix="split the frames instead")
            head = self.delimiter.join(names)
            self.stream.write(f"{'//' if self.delimiter == ' ' else ''}{head}\n".encode())
        if names != self.names:
            what = f"frame {frame.number} has the columns {', '.join(names)}, the first {', '.join(self.names)}"
            raise InputError(what, file=table.path, fix="split the frames instead: lidarcheck split")
        self.stream.write(rows_as_text(Table(columns), self.delimiter))


class _Osi:
    """`SensorData` with the detections of one lidar, a message a frame."""

    def __init__(self, stream: Any, target: Path) -> None:
        self.stream, self.target = stream, target

    def add(self, table: Table, frame: FrameToWrite) -> None:
        """Write a frame; a detection's `beam_id` is its beam's row in the sensor's table, layer by layer."""
        from osi3.osi_sensordata_pb2 import SensorData

        if missing(table, "XYZ"):
            raise table.fault("has no X, Y, Z", fix="name a scan")
        data = SensorData()
        data.timestamp.seconds, data.timestamp.nanos = divmod(frame.time_ns, 10**9)
        lidar = data.feature_data.lidar_sensor.add()
        lidar.header.measurement_time.CopyFrom(data.timestamp)
        empty = no_returns(table)
        none = np.zeros(len(table), dtype=np.bool_) if empty is None else empty
        axes = [np.asarray(table.get(name), dtype=np.float64) for name in "XYZ"]
        x, y, z = (np.where(none, 0.0, axis) for axis in axes)
        flat = np.hypot(x, y)
        columns = [np.hypot(flat, z), np.arctan2(y, x), np.arctan2(z, flat), none, *self._others(table, frame)]
        for distance, azimuth, elevation, lost, strength, beam in zip(*(c.tolist() for c in columns), strict=True):
            one = lidar.detection.add()
            one.position.distance, one.position.azimuth, one.position.elevation = distance, azimuth, elevation
            if lost:
                one.classification = _INVALID
            if strength == strength:  # not NaN
                one.intensity = strength
            if beam >= 0:
                one.beam_id.value = beam
        lidar.header.number_of_valid_detections = int(np.count_nonzero(~none))
        content = data.SerializeToString()
        self.stream.write(struct.pack("<I", len(content)) + content)

    def _others(self, table: Table, frame: FrameToWrite) -> tuple[Any, Any]:
        """The intensity of each row, NaN where there is none, and the number of its beam, -1 where not known."""
        strength, nothing = table.get("INTENSITY"), np.full(len(table), np.nan)
        layer, point = table.get("Layer"), table.get("Point")
        beams = None if frame.sensor is None else frame.sensor.beams
        if layer is None or point is None or beams is None:
            own = table.get("beam_id")
            number = np.full(len(table), -1) if own is None else own.astype(np.int64)
        else:
            number = layer.astype(np.int64) * beams.points + point.astype(np.int64)
        return (nothing if strength is None else strength.astype(np.float64)), number
