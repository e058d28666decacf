"""ROS 1 bags, version 2.0: records with a head of named values; chunks of messages, and an index behind each chunk.

As of MCAP only heads and indices are read to find the messages, and a bag without its last index is read as far as it
is whole: what a crashed recorder leaves as `.active` needs no reindexing.

Source: the ROS wiki, "Bags/Format/2.0".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, NamedTuple

from lidarcheck.errors import InputError
from lidarcheck.formats.field.container import Container, Place, Topic, cut_words, plain_kind
from lidarcheck.formats.field.packing import CHUNK_BYTES, unpacked

__all__ = ["MAGIC", "read_rosbag"]

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG, _INDEX, _CHUNK, _CONNECTION = 2, 3, 4, 5, 7
_MOST_HEAD = 1 << 20
"""Bytes of a record's head, and of a connection's description."""


class _Record(NamedTuple):
    """`at`: its first byte; `head`: the values in front; `start`, `size`: of its data."""

    at: int
    head: Mapping[bytes, bytes]
    start: int
    size: int

    @property
    def kind(self) -> int:
        return (self.head.get(b"op") or b"\0")[0]

    def number(self, name: bytes, size: int = 4) -> int:
        """A whole number of the head, -1 where there is none of that size."""
        value = self.head.get(name, b"")
        return int.from_bytes(value, "little") if len(value) == size else -1


class _Bag(Container):
    def __init__(self, path: Path) -> None:
        super().__init__(path, "ROS 1 bag")
        self._chunk: tuple[int, bytes] = (-1, b"")

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_chunk": (-1, b"")}

    def message(self, place: Place) -> bytes:
        """The data of a message's record."""
        if place.within < 0:
            with self.path.open("rb") as stream:
                record = next(_records(stream, place.at, self.path.stat().st_size), None)
                if record is None or record.kind != _MESSAGE or record.size > CHUNK_BYTES:
                    raise self.damaged("an index names what is no message")
                stream.seek(record.start)
                return stream.read(record.size)
        chunk = self.chunk(place.at)
        found = next(_inside(chunk, place.within), None)
        if found is None or found.kind != _MESSAGE or found.number(b"conn") != place.topic:
            raise self.damaged("an index names what is no message of its connection")
        return chunk[found.start : found.start + found.size]

    def chunk(self, at: int) -> bytes:
        """The records of a chunk, unpacked; the last one is kept, since its frames are asked for one by one."""
        if self._chunk[0] != at:
            self._chunk = (-1, b"")
            with self.path.open("rb") as stream:
                record = next(_records(stream, at, self.path.stat().st_size), None)
                if record is None or record.kind != _CHUNK:
                    raise self.damaged("an index names what is no chunk")
                if record.size > CHUNK_BYTES:
                    raise self.damaged(f"a chunk of {record.size} bytes, where {CHUNK_BYTES} is the most")
                stream.seek(record.start)
                content = stream.read(record.size)
            name = record.head.get(b"compression", b"none").decode("utf-8", "replace")
            self._chunk = (at, unpacked(content, name, record.number(b"size"), self.path))
        return self._chunk[1]

    def define(self, record: _Record, data: bytes) -> None:
        """Note a connection: its topic is in the record's head, its type in the data."""
        number, told = record.number(b"conn"), _values(data)
        if number < 0 or told is None:
            raise self.damaged("a connection that is cut off")
        name = (record.head.get(b"topic") or told.get(b"topic", b"")).decode("utf-8", "replace")
        kind = plain_kind(told.get(b"type", b"").decode("utf-8", "replace"))
        self.topics.setdefault(number, Topic(number, name, kind, "ros1"))


def read_rosbag(path: Path) -> Container:
    """The topics of a bag and the places of their messages.

    `InputError` for a damaged or encrypted bag; one that was cut short says so in `lost`.
    """
    bag = _Bag(path)
    size = path.stat().st_size
    with path.open("rb") as stream:
        first = next(_records(stream, len(MAGIC), size), None)
        if first is None or first.kind != _BAG:
            raise bag.damaged("it has no head")
        if first.head.get(b"encryptor"):
            raise InputError("the bag is encrypted", file=path, fix="decrypt it with the recorder's key")
        _read_connections(bag, stream, first.number(b"index_pos", 8), size)
        end = _walk(bag, stream, size)
    if end < size:
        bag.lost = cut_words(size, end, bag.counts.values())
    return bag


def _values(content: bytes) -> dict[bytes, bytes] | None:
    """The named values of a head; None where they do not fit into it."""
    found, at = {}, 0
    while at < len(content):
        if at + 4 > len(content):
            return None
        size = int.from_bytes(content[at : at + 4], "little")
        name, equals, value = content[at + 4 : at + 4 + size].partition(b"=")
        if at + 4 + size > len(content) or not equals:
            return None
        found[name] = value
        at += 4 + size
    return found


def _records(stream: IO[bytes], start: int, end: int) -> Iterator[_Record]:
    """The records that are whole; it ends at one whose head is not."""
    at = start
    while at + 8 <= end:
        stream.seek(at)
        size = int.from_bytes(stream.read(4), "little")
        if size > min(_MOST_HEAD, end - at - 8):
            return
        head = _values(stream.read(size))
        length = int.from_bytes(stream.read(4), "little")
        if head is None or at + 8 + size + length > end:
            return
        yield _Record(at, head, at + 8 + size, length)
        at += 8 + size + length


def _inside(content: bytes, start: int = 0) -> Iterator[_Record]:
    """The records of an unpacked chunk, from a byte of it on."""
    at, end = start, len(content)
    while 0 <= at <= end - 8:
        size = int.from_bytes(content[at : at + 4], "little")
        head = _values(content[at + 4 : at + 4 + size]) if size <= min(_MOST_HEAD, end - at - 8) else None
        if head is None:
            return
        length = int.from_bytes(content[at + 4 + size : at + 8 + size], "little")
        if at + 8 + size + length > end:
            return
        yield _Record(at, head, at + 8 + size, length)
        at += 8 + size + length


def _read_connections(bag: _Bag, stream: IO[bytes], start: int, size: int) -> None:
    """The connections that the last index lists, where the bag has one."""
    if not len(MAGIC) < start < size:
        return
    for record in _records(stream, start, size):
        if record.kind == _CONNECTION:
            _define(bag, stream, record)


def _define(bag: _Bag, stream: IO[bytes], record: _Record) -> None:
    if record.size > _MOST_HEAD:
        raise bag.damaged(f"a connection of {record.size} bytes")
    stream.seek(record.start)
    bag.define(record, stream.read(record.size))


def _walk(bag: _Bag, stream: IO[bytes], size: int) -> int:
    """Note all messages; where what is whole ends."""
    chunk, indexed, end = -1, False, len(MAGIC)
    for record in _records(stream, len(MAGIC), size):
        if record.kind == _INDEX and chunk >= 0:
            indexed = True
            _note_index(bag, stream, record, chunk)
        else:
            if chunk >= 0 and not indexed:
                _note_chunk(bag, chunk)
            chunk, indexed = (record.at, False) if record.kind == _CHUNK else (-1, False)
            if record.kind == _CONNECTION:
                _define(bag, stream, record)
            elif record.kind == _MESSAGE:
                bag.note(_time(record), record.number(b"conn"), record.at, -1)
        end = record.start + record.size
    if chunk >= 0 and not indexed:
        _note_chunk(bag, chunk)
    return end


def _note_index(bag: _Bag, stream: IO[bytes], record: _Record, chunk: int) -> None:
    """The messages of one connection in a chunk, as the index behind it lists them."""
    connection = record.number(b"conn")
    if record.size % 12 or connection < 0:
        raise bag.damaged("an index that is no list of times and places")
    if connection not in bag.topics:
        _define_inside(bag, chunk)
    if connection in bag.topics and not bag.topics[connection].kept:
        bag.counts[connection] = bag.counts.get(connection, 0) + record.size // 12
        return
    stream.seek(record.start)
    for seconds, nanoseconds, within in struct.iter_unpack("<III", stream.read(record.size)):
        bag.note(seconds * 10**9 + nanoseconds, connection, chunk, within)


def _define_inside(bag: _Bag, chunk: int) -> None:
    content = bag.chunk(chunk)
    for record in _inside(content):
        if record.kind == _CONNECTION:
            bag.define(record, content[record.start : record.start + record.size])


def _note_chunk(bag: _Bag, chunk: int) -> None:
    """The messages of a chunk that has no index."""
    _define_inside(bag, chunk)
    for record in _inside(bag.chunk(chunk)):
        if record.kind == _MESSAGE:
            bag.note(_time(record), record.number(b"conn"), chunk, record.at)


def _time(record: _Record) -> int:
    value = record.head.get(b"time", b"")
    if len(value) != 8:
        return 0
    seconds, nanoseconds = struct.unpack("<II", value)
    return int(seconds * 10**9 + nanoseconds)
