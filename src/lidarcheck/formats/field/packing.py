"""Compressed chunks of a bag, unpacked within what they say that they hold and what a chunk may hold."""

from __future__ import annotations

import bz2
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.table import quoted

__all__ = ["CHUNK_BYTES", "is_zstd", "unpacked", "zstd_message"]

CHUNK_BYTES = 256 << 20
"""Of a chunk, or of a message: eight million points of 32 bytes. Recorders begin a new chunk after a few MB."""
_PIECE_BYTES = 4 << 20
_NONE = ("", "none")
_ARROW = ("lz4", "zstd")
"""What Arrow unpacks: frames of LZ4, and Zstandard."""
_ZSTD = b"\x28\xb5\x2f\xfd"
_DAMAGED = "the bag is damaged: record it again, or cut it there"


def unpacked(content: bytes, compression: str, size: int, path: Path) -> bytes:
    """What a chunk holds, `size` bytes by its own account.

    `InputError` for another compression than lz4, zstd, bz2 and none, before anything is unpacked where it says that it
    holds more than a chunk may, and where it holds something else.
    """
    if compression not in (*_NONE, *_ARROW, "bz2"):
        what = f"the chunks are compressed with {quoted(compression)}, which is not known"
        raise InputError(what, file=path, fix="write it again with zstd, lz4, bz2 or none")
    if size > CHUNK_BYTES:
        what = f"a chunk says that it holds {size} bytes"
        raise InputError(what, file=path, fix=f"the limit is {CHUNK_BYTES} bytes: record it in smaller chunks")
    found = content if compression in _NONE else _unpacked(content, compression, size, path)
    if len(found) != size:
        more = "more" if len(found) > size else f"{len(found)}"
        raise InputError(f"a chunk says that it holds {size} bytes and holds {more}", file=path, fix=_DAMAGED)
    return found


def is_zstd(content: bytes) -> bool:
    """Whether a message begins as Zstandard does; no encoding of messages begins so."""
    return content.startswith(_ZSTD)


def zstd_message(content: bytes, path: Path) -> bytes:
    """A message that was compressed by itself, which does not say how long it is."""
    found = _unpacked(content, "zstd", CHUNK_BYTES, path)
    if len(found) > CHUNK_BYTES:
        raise InputError(f"a message holds more than {CHUNK_BYTES} bytes", file=path, fix=_DAMAGED)
    return found


def _unpacked(content: bytes, compression: str, size: int, path: Path) -> bytes:
    """At most a byte more than `size`, taken piece by piece: what is asked for at once takes memory at once."""
    try:
        if compression == "bz2":
            return bz2.BZ2Decompressor().decompress(content, size + 1)
        import pyarrow as pa

        found = bytearray()
        with pa.CompressedInputStream(pa.BufferReader(content), compression) as stream:
            while len(found) <= size and (piece := stream.read(min(size + 1 - len(found), _PIECE_BYTES))):
                found += piece
        return bytes(found)
    except (OSError, ValueError, EOFError) as error:  # Arrow's own are kinds of these
        raise InputError(f"a chunk does not unpack as {compression}: {error}", file=path, fix=_DAMAGED) from None
