"""Bags and clouds as other programs write them: by the package rosbags, or byte by byte with struct."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.formats.field.clouds import DATATYPES

__all__ = ["Message", "cdr_cloud", "custom_message", "ros1_cloud", "transforms_message", "write_ros1", "write_ros2"]

CLOUD = "sensor_msgs/msg/PointCloud2"
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 100_000_000
Columns = Mapping[str, npt.NDArray[Any]]


class Message(NamedTuple):
    """What goes into a bag: the topic, its type, the time and the message's bytes."""

    topic: str
    kind: str
    time_ns: int
    content: bytes


class _Packed:
    """Values one after the other, aligned as CDR has it or not at all."""

    def __init__(self, cdr: bool, big: bool = False) -> None:
        self.cdr, self.order, self.content = cdr, ">" if big else "<", bytearray()

    def add(self, kind: str, *values: Any) -> _Packed:
        for value in values:
            size = struct.calcsize(kind)
            if self.cdr:
                self.content += bytes(-len(self.content) % size)
            self.content += struct.pack(self.order + kind, value)
        return self

    def text(self, text: str) -> _Packed:
        own = text.encode() + (b"\0" if self.cdr else b"")
        self.add("I", len(own))
        self.content += own
        return self

    def head(self, stamp_ns: int, frame: str) -> _Packed:
        if not self.cdr:
            self.add("I", 0)
        return self.add("I", *divmod(stamp_ns, 10**9)).text(frame)

    def bytes(self) -> bytes:
        return (b"\0\1\0\0" if self.order == "<" else b"\0\0\0\0") * self.cdr + bytes(self.content)


def _cloud(
    cdr: bool, columns: Columns, height: int, big: bool, padding: int, stamp_ns: int, frame: str, rest: int
) -> bytes:
    rows = len(next(iter(columns.values())))
    numbers = {np.dtype(name): number for number, name in DATATYPES.items()}
    offsets, at = [], padding
    for column in columns.values():
        offsets.append(at)
        at += column.dtype.itemsize + padding
    width = rows // height
    order = ">" if big else "<"
    record = np.dtype(
        {
            "names": list(columns),
            "formats": [column.dtype.newbyteorder(order) for column in columns.values()],
            "offsets": offsets,
            "itemsize": at,
        }
    )
    cells = np.zeros((height, width), record)
    for name, column in columns.items():
        cells[name] = column.reshape(height, width)
    packed = _Packed(cdr).head(stamp_ns, frame).add("I", height, width, len(columns))
    for (name, column), offset in zip(columns.items(), offsets, strict=True):
        packed.text(name).add("I", offset).add("B", numbers[column.dtype]).add("I", 1)
    data = b"".join(row.tobytes() + b"\xaa" * rest for row in cells)
    packed.add("B", int(big)).add("I", at, width * at + rest, len(data))
    packed.content += data
    return packed.add("B", 0).bytes()


def cdr_cloud(
    columns: Columns,
    *,
    height: int = 1,
    big: bool = False,
    padding: int = 0,
    stamp_ns: int = START_NS,
    frame: str = "lidar",
    rest: int = 0,
) -> bytes:
    """A PointCloud2 of ROS 2. `padding`: bytes around each field, `rest`: behind each row, `big`: order of the data."""
    return _cloud(True, columns, height, big, padding, stamp_ns, frame, rest)


def ros1_cloud(columns: Columns, *, height: int = 1, stamp_ns: int = START_NS, frame: str = "lidar") -> bytes:
    """The same of ROS 1."""
    return _cloud(False, columns, height, False, 0, stamp_ns, frame, 0)


def transforms_message(
    transforms: Iterable[tuple[str, str, Sequence[float], Sequence[float]]], *, cdr: bool = True
) -> bytes:
    """A TFMessage of (parent, child, x y z, quaternion x y z w)."""
    listed = list(transforms)
    packed = _Packed(cdr).add("I", len(listed))
    for parent, child, move, turn in listed:
        packed.head(START_NS, parent).text(child).add("d", *move, *turn)
    return packed.bytes()


def custom_message(rows: Sequence[tuple[float, ...]], *, cdr: bool = True, base_ns: int = START_NS) -> bytes:
    """A Livox CustomMsg of rows (offset_time, x, y, z, reflectivity, tag, line)."""
    packed = _Packed(cdr).head(base_ns, "livox_frame").add("Q", base_ns).add("I", len(rows))
    packed.add("B", 1, 0, 0, 0).add("I", len(rows))
    for offset, x, y, z, *others in rows:
        packed.add("I", int(offset)).add("f", x, y, z).add("B", *(int(other) for other in others))
    return packed.bytes()


def write_ros2(path: Path, messages: Iterable[Message], *, storage: str = "mcap", compression: str = "") -> Path:
    """A ROS 2 bag by rosbags; its one data file. `compression`: `storage` or `message`, both Zstandard."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[{"mcap": "MCAP", "db3": "SQLITE3"}[storage]])
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        known: dict[str, Any] = {}
        for one in messages:
            if one.topic not in known:
                told = (
                    {"typestore": store} if one.kind in store.fielddefs else {"msgdef": "uint8 x", "rihs01": "RIHS01_0"}
                )
                known[one.topic] = writer.add_connection(one.topic, one.kind, **told)
            writer.write(known[one.topic], one.time_ns, one.content)
    return next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))


def write_ros1(path: Path, messages: Iterable[Message], *, compression: str = "") -> Path:
    """A ROS 1 bag by rosbags; `compression`: `bz2` or `lz4`."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if compression:
        writer.set_compression(writer.CompressionFormat[compression.upper()])
    with writer:
        known: dict[str, Any] = {}
        for one in messages:
            if one.topic not in known:
                told = (
                    {"typestore": store} if one.kind in store.fielddefs else {"msgdef": "uint8 x", "md5sum": "0" * 32}
                )
                known[one.topic] = writer.add_connection(one.topic, one.kind, **told)
            writer.write(known[one.topic], one.time_ns, one.content)
    return path
