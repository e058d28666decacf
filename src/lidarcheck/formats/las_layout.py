"""What a LAS or LAZ file claims of its own layout, checked against its bytes before any library trusts it.

A false count or offset would otherwise be allocated before it is found out; in the LAZ library that ends the process.

Sources: ASPRS, "LAS Specification 1.4 - R15"; M. Isenburg, "LASzip: lossless compression of LiDAR data", 2013, and the
record layout of LASzip's open specification.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.limits import check_rows
from lidarcheck.formats.table import counted, quoted

__all__ = ["HEADER_BYTES", "LasLayout", "check_claims", "check_layout"]

HEADER_BYTES = 375
"""Bytes that hold the longest header."""
SMALLEST_HEADER = 227
HEADER_SIZES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}
POINT_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
BYTES_A_NUMBER = 8
"""What a number takes in memory; a point has fields of a bit as well as of eight bytes."""
MOST_BEHIND = 64 << 20
"""Bytes of what may stand behind the points, such as waveforms or extended records."""
RECORD_HEAD = 54
VARIABLE_CHUNKS = 2**32 - 1
POINT_BY_POINT, CHUNKED_POINTS, CHUNKED_LAYERS = 1, 2, 3
ITEM_SIZES = {
    CHUNKED_POINTS: {0: None, 6: 20, 7: 8, 8: 6, 9: 29},
    CHUNKED_LAYERS: {10: 30, 11: 6, 12: 8, 13: 29, 14: None},
}
"""Bytes of each kind of item, by compressor; extra bytes (0 and 14) are as many as there are."""
LAYERS_OF_ITEM = {10: 9, 11: 1, 12: 2, 13: 1}
EXTRA_BYTES = 14
FIX = "the file is damaged or cut off: write it again"


@dataclass(frozen=True, slots=True)
class LasLayout:
    """How many points there are, how long each is, where they begin, and the LASzip record of a compressed file."""

    points: int
    point_size: int
    start: int
    compressed: bool


@dataclass(frozen=True, slots=True)
class _Packing:
    """The LASzip record: how the points are compressed, in chunks of how many, and which items a point has."""

    compressor: int
    chunk_points: int
    items: tuple[tuple[int, int], ...]


def check_claims(start: bytes, size: int, path: Path) -> None:
    """What a header claims, against the `size` of its file and the limit; `start`: the file's first bytes.

    `InputError` before anything else is read. A point that is compressed takes no more than twice its own bytes.
    """
    layout, _, _ = _header(start, size, path)
    numbers = -(-layout.point_size // BYTES_A_NUMBER)
    check_rows(layout.points, numbers, path)
    most = layout.start + 2 * layout.points * layout.point_size + MOST_BEHIND
    if size > most:
        what = f"the header says {counted(layout.points, 'point')} of {layout.point_size} bytes, the file has {size}"
        raise _fault(path, what)


def check_layout(content: bytes, path: Path) -> LasLayout:
    """The layout, once the file has the bytes for it; `InputError` says which of its numbers cannot be."""
    layout, header_size, records = _header(content, len(content), path)
    packing = _records(content, header_size, layout.start, records, path)
    if layout.compressed and layout.points:
        _check_chunks(content, layout, packing, path)
    return layout


def _header(content: bytes, size: int, path: Path) -> tuple[LasLayout, int, int]:
    """The layout of a file of `size` bytes, as its header has it, that header's size, and how many records follow."""
    if content[:4] != b"LASF":
        what = f"{quoted(content[:4])} is not the signature 'LASF'"
        raise InputError(what, file=path, fix="this is no LAS or LAZ file")
    if size < SMALLEST_HEADER:
        raise _fault(path, f"the header needs {SMALLEST_HEADER} bytes, the file has {size}")
    major, minor = content[24], content[25]
    if major != 1 or minor not in HEADER_SIZES:
        fix = "versions 1.0 to 1.4 are read"
        raise InputError(f"LAS version {major}.{minor} is not known", file=path, fix=fix)
    header_size, start, records, format_byte, point_size, points = struct.unpack_from("<HIIBHI", content, 94)
    if header_size < HEADER_SIZES[minor] or not header_size <= start <= size:
        what = f"a header of {header_size} bytes and points from byte {start} do not fit {size} bytes"
        raise _fault(path, what)
    if minor == 4:
        (points,) = struct.unpack_from("<Q", content, 247)
    _check_point_size(format_byte, point_size, path)
    layout = LasLayout(points, point_size, start, compressed=bool(format_byte & 0x80))
    have = (size - start) // point_size
    if points > have and not layout.compressed:
        raise _fault(path, f"the header says {points} points, the bytes end after {have}")
    return layout, header_size, records


def _fault(path: Path, what: str) -> InputError:
    return InputError(what, file=path, fix=FIX)


def _check_point_size(format_byte: int, point_size: int, path: Path) -> None:
    number = format_byte & 0x3F
    if number >= len(POINT_SIZES):
        raise InputError(f"point format {number} is not known", file=path, fix="formats 0 to 10 are read")
    if point_size < POINT_SIZES[number]:
        what = f"a point of {point_size} bytes is too short for point format {number}, {POINT_SIZES[number]} bytes"
        raise _fault(path, what)


def _records(content: bytes, at: int, end: int, count: int, path: Path) -> _Packing | None:
    """Walk the variable length records between header and points; the LASzip record, if there is one."""
    packing = None
    for number in range(1, count + 1):
        if at + RECORD_HEAD > end:
            raise _fault(path, f"record {number} of {count} lies beyond byte {end}, where the points begin")
        user, kind, size = struct.unpack_from("<16sHH", content, at + 2)
        body = content[at + RECORD_HEAD : at + RECORD_HEAD + size]
        at += RECORD_HEAD + size
        if at > end:
            raise _fault(path, f"record {number} of {count} ends beyond byte {end}, where the points begin")
        if user.split(b"\0")[0] == b"laszip encoded" and kind == 22204:
            packing = _packing(body, path)
    return packing


def _packing(body: bytes, path: Path) -> _Packing:
    if len(body) < 34:
        raise _fault(path, f"the LASzip record has {len(body)} bytes, not 34 or more")
    compressor, chunk_points, items = (
        struct.unpack_from(code, body, at)[0] for code, at in (("<H", 0), ("<I", 12), ("<H", 32))
    )
    if len(body) < 34 + 6 * items:
        raise _fault(path, f"the LASzip record has {len(body)} bytes, too few for {items} items")
    pairs = tuple(struct.unpack_from("<HH", body, 34 + 6 * i) for i in range(items))
    return _Packing(compressor, chunk_points, tuple((kind, size) for kind, size in pairs))


def _check_items(packing: _Packing, layout: LasLayout, path: Path) -> None:
    if packing.compressor == POINT_BY_POINT:
        what = "the file is compressed point by point (LASzip compressor 1), which is not read"
        raise InputError(what, file=path, fix="write it again as LAS, or as LAZ with a chunk table, as LASzip 2 does")
    known = ITEM_SIZES.get(packing.compressor)
    if known is None or not packing.chunk_points:
        raise _fault(path, f"LASzip compressor {packing.compressor} in chunks of {packing.chunk_points} cannot be read")
    for kind, size in packing.items:
        if kind not in known or not size or known[kind] not in (None, size):
            raise _fault(path, f"LASzip item {kind} of {size} bytes cannot be read")
    if sum(size for _, size in packing.items) != layout.point_size:
        raise _fault(path, f"the LASzip items do not add up to a point of {layout.point_size} bytes")


def _check_chunks(content: bytes, layout: LasLayout, packing: _Packing | None, path: Path) -> None:
    """The chunk table and, where they say it themselves, every chunk's size, against the bytes that are there."""
    if packing is None:
        raise _fault(path, "the points are compressed, but there is no LASzip record")
    _check_items(packing, layout, path)
    begin = layout.start + 8
    if begin > len(content):
        raise _fault(path, "the bytes end before the compressed points")
    (table,) = struct.unpack_from("<q", content, layout.start)
    if table == -1:
        (table,) = struct.unpack_from("<q", content, len(content) - 8)
    if not begin <= table <= len(content) - 8:
        raise _fault(path, f"the table of chunks would be at byte {table}, outside the file")
    version, chunks = struct.unpack_from("<II", content, table)
    wanted = -(-layout.points // packing.chunk_points)
    fixed = packing.chunk_points != VARIABLE_CHUNKS
    if version or not chunks or chunks * layout.point_size > table - begin or (fixed and chunks != wanted):
        raise _fault(path, f"the table says {chunks} chunks, which do not hold {layout.points} points")
    if packing.compressor == CHUNKED_LAYERS:
        _walk_layers(content[:table], begin, chunks, layout, packing, path)


def _walk_layers(content: bytes, at: int, chunks: int, layout: LasLayout, packing: _Packing, path: Path) -> None:
    """Step from chunk to chunk: a raw point, the number of points, and the size of each layer that follows."""
    layers = sum(size if kind == EXTRA_BYTES else LAYERS_OF_ITEM.get(kind, 0) for kind, size in packing.items)
    head = struct.Struct(f"<{1 + layers}I")
    points = 0
    for chunk in range(1, chunks + 1):
        if at + layout.point_size + head.size > len(content):
            raise _fault(path, f"chunk {chunk} of {chunks} lies beyond the compressed points")
        inside, *sizes = head.unpack_from(content, at + layout.point_size)
        points += inside
        at += layout.point_size + head.size + sum(sizes)
        if at > len(content) or not 0 < inside <= packing.chunk_points:
            raise _fault(path, f"chunk {chunk} of {chunks} with {inside} points ends beyond the compressed points")
    if points != layout.points:
        raise _fault(path, f"the header says {layout.points} points, the chunks hold {points}")
