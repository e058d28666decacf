"""MCAP: records of schemas, channels, messages and compressed chunks of these, with an index behind each chunk.

Only heads of records and indices are read to find the messages; a chunk is unpacked where its messages are asked for,
or where nothing else says which channels are in it. What has no summary, or was cut short, is read as far as it is
whole.

Source: MCAP format specification, `foxglove/mcap: website/docs/spec/index.md`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from lidarcheck.formats.field.container import Container, Place, Topic, cut_words, plain_kind
from lidarcheck.formats.field.packing import CHUNK_BYTES, unpacked

__all__ = ["MAGIC", "read_mcap"]

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _DATA_END = 2, 3, 4, 5, 6, 7, 15
_HEAD = 9
_MOST_TEXT = 1 << 20
"""Bytes of a schema's record and of the names in one; a definition of messages has a few kB."""


class _Record(NamedTuple):
    """`at`: its first byte; `start`, `size`: of its content."""

    kind: int
    at: int
    start: int
    size: int

    @property
    def end(self) -> int:
        return self.start + self.size


class _Mcap(Container):
    """The file, and the schemas that its channels name."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "MCAP")
        self.schemas: dict[int, str] = {}
        self._chunk: tuple[int, bytes] = (-1, b"")

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_chunk": (-1, b"")}

    def message(self, place: Place) -> bytes:
        """What stands behind the head of a message's record."""
        if place.within < 0:
            head = self.read(place.at, _HEAD)
            content = self.read(place.at + _HEAD, self._length(head, place))
        else:
            chunk = self.chunk(place.at)
            length = self._length(chunk[place.within : place.within + _HEAD], place)
            start = place.within + _HEAD
            if start + length > len(chunk):
                raise self.damaged("a message reaches beyond its chunk")
            content = chunk[start : start + length]
        if int.from_bytes(content[:2], "little") != place.topic:
            raise self.damaged("an index names a message of another channel")
        return content[22:]

    def _length(self, head: bytes, place: Place) -> int:
        if len(head) < _HEAD or head[0] != _MESSAGE:
            raise self.damaged("an index names what is no message")
        length = int.from_bytes(head[1:], "little")
        if not 22 <= length <= CHUNK_BYTES:
            raise self.damaged(f"a message of {length} bytes")
        return length

    def chunk(self, at: int) -> bytes:
        """The records of a chunk, unpacked; the last one is kept, since its frames are asked for one by one."""
        if self._chunk[0] != at:
            self._chunk = (-1, b"")
            self._chunk = (at, self._unpacked(at))
        return self._chunk[1]

    def _unpacked(self, at: int) -> bytes:
        size = int.from_bytes(self.read(at, _HEAD)[1:], "little")
        head = self.read(at + _HEAD, min(size, 96))
        if len(head) < 40:
            raise self.damaged("a chunk without a head")
        (held,), (name_size,) = struct.unpack_from("<Q", head, 16), struct.unpack_from("<I", head, 28)
        if name_size > 32 or len(head) < 40 + name_size:
            raise self.damaged("a chunk without a head")
        name = head[32 : 32 + name_size].decode("utf-8", "replace")
        (packed,) = struct.unpack_from("<Q", head, 32 + name_size)
        if 40 + name_size + packed > size:
            raise self.damaged("a chunk's content reaches beyond it")
        if packed > CHUNK_BYTES:
            raise self.damaged(f"a chunk of {packed} packed bytes, where {CHUNK_BYTES} is the most")
        return unpacked(self.read(at + _HEAD + 40 + name_size, packed), name, held, self.path)

    def define(self, kind: int, content: bytes) -> None:
        """Note a schema or a channel."""
        try:
            if kind == _SCHEMA:
                number, name, _ = _text(content, 0)
                self.schemas[number] = name
            else:
                number, schema = struct.unpack_from("<HH", content)
                _, name, at = _text(content, 2)
                _, encoding, _ = _text(content, at - 2)
                kind_name = plain_kind(self.schemas.get(schema, ""))
                self.topics.setdefault(number, Topic(number, name, kind_name, encoding))
        except (struct.error, ValueError):
            raise self.damaged("a schema or channel that is cut off") from None


def _text(content: bytes, at: int) -> tuple[int, str, int]:
    """A number of two bytes, the text behind it, and where that ends."""
    number, size = struct.unpack_from("<HI", content, at)
    end = at + 6 + size
    if size > _MOST_TEXT or end > len(content):
        raise ValueError("text beyond the record")
    return number, content[at + 6 : end].decode("utf-8", "replace"), end


def read_mcap(path: Path) -> Container:
    """The topics of an MCAP file and the places of their messages.

    `InputError` for a damaged file; one that was cut short says so in `lost`.
    """
    bag = _Mcap(path)
    size = path.stat().st_size
    with path.open("rb") as stream:
        _read_summary(bag, stream, size)
        end = _walk(bag, stream, size)
    if end < size:
        bag.lost = cut_words(size, end, bag.counts.values())
    return bag


def _records(stream: IO[bytes], start: int, end: int) -> Iterator[_Record]:
    """The heads of the records that are whole."""
    at = start
    while at + _HEAD <= end:
        stream.seek(at)
        head = stream.read(_HEAD)
        size = int.from_bytes(head[1:], "little")
        if at + _HEAD + size > end:
            return
        yield _Record(head[0], at, at + _HEAD, size)
        at += _HEAD + size


def _read_summary(bag: _Mcap, stream: IO[bytes], size: int) -> None:
    """Schemas and channels from the file's end, where it has them there."""
    foot = 8 + _HEAD + 20
    if size < foot + 8:
        return
    stream.seek(size - foot)
    tail = stream.read(foot)
    if not tail.endswith(MAGIC) or tail[0] != _FOOTER:
        return
    (start,) = struct.unpack_from("<Q", tail, _HEAD)
    if not 8 <= start <= size - foot:
        return
    for record in _records(stream, start, size - foot):
        if record.kind in (_SCHEMA, _CHANNEL):
            bag.define(record.kind, _content(bag, stream, record))


def _content(bag: _Mcap, stream: IO[bytes], record: _Record) -> bytes:
    if record.size > _MOST_TEXT:
        raise bag.damaged(f"a schema or channel of {record.size} bytes")
    stream.seek(record.start)
    return stream.read(record.size)


def _walk(bag: _Mcap, stream: IO[bytes], size: int) -> int:
    """Note all messages; where what is whole ends."""
    chunk: _Record | None = None
    indexed = False
    end = 8
    for record in _records(stream, 8, size):
        if record.kind == _INDEX and chunk is not None:
            indexed = True
            _note_index(bag, stream, record, chunk)
            end = record.end
            continue
        if chunk is not None and not indexed:
            _note_chunk(bag, chunk)
        chunk, indexed = (record, False) if record.kind == _CHUNK else (None, False)
        if record.kind in (_SCHEMA, _CHANNEL):
            bag.define(record.kind, _content(bag, stream, record))
        elif record.kind == _MESSAGE:
            _note_message(bag, stream, record)
        end = record.end
        if record.kind in (_DATA_END, _FOOTER):
            return size  # what follows are summaries
    if chunk is not None and not indexed:
        _note_chunk(bag, chunk)
    return end


def _note_message(bag: _Mcap, stream: IO[bytes], record: _Record) -> None:
    stream.seek(record.start)
    head = stream.read(14)
    if record.size < 22:
        raise bag.damaged("a message without a head")
    bag.note(int.from_bytes(head[6:14], "little"), int.from_bytes(head[:2], "little"), record.at, -1)


def _note_index(bag: _Mcap, stream: IO[bytes], record: _Record, chunk: _Record) -> None:
    """The messages of one channel in a chunk, as the index behind it lists them."""
    stream.seek(record.start)
    head = stream.read(6)
    if record.size < 6:
        raise bag.damaged("an index that is cut off")
    channel, size = struct.unpack("<HI", head)
    if size % 16 or size + 6 > record.size:
        raise bag.damaged("an index that is no list of times and places")
    if channel not in bag.topics:
        for kind, at, length in _inside(bag, bag.chunk(chunk.at)):
            if kind in (_SCHEMA, _CHANNEL):
                bag.define(kind, bag.chunk(chunk.at)[at : at + length])
    if channel in bag.topics and not bag.topics[channel].kept:
        bag.counts[channel] = bag.counts.get(channel, 0) + size // 16
        return
    for time_ns, within in struct.iter_unpack("<QQ", stream.read(size)):
        bag.note(time_ns, channel, chunk.at, within)


def _note_chunk(bag: _Mcap, chunk: _Record) -> None:
    """The messages of a chunk that has no index."""
    content = bag.chunk(chunk.at)
    for kind, at, length in _inside(bag, content):
        if kind in (_SCHEMA, _CHANNEL):
            bag.define(kind, content[at : at + length])
        elif kind == _MESSAGE:
            if length < 22:
                raise bag.damaged("a message without a head")
            topic, _, time_ns = struct.unpack_from("<HIQ", content, at)
            bag.note(time_ns, topic, chunk.at, at - _HEAD)


def _inside(bag: _Mcap, content: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, first byte and size of each record's content in an unpacked chunk."""
    at = 0
    while at + _HEAD <= len(content):
        size = int.from_bytes(content[at + 1 : at + _HEAD], "little")
        if at + _HEAD + size > len(content):
            raise bag.damaged("a record reaches beyond its chunk")
        yield content[at], at + _HEAD, size
        at += _HEAD + size
