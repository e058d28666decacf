"""Point Cloud Data files (PCD 0.7) in their three encodings: ascii, binary and binary_compressed (LZF).

The header is lines of text; the body is rows of text, packed little-endian records, or the columns one after the other,
compressed. A field with COUNT above 1 becomes the columns `name_0`, `name_1`, ...; fields called `_`, or with COUNT 0,
are padding and dropped. An organised cloud (HEIGHT above 1) is read row after row. NaN is a value: what it means is not
for a format to say.

Source: "The PCD (Point Cloud Data) file format", Point Cloud Library documentation.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.limits import scan_bytes
from lidarcheck.formats.pcd_header import ENCODINGS, Encoding, PcdHeader, compose_header, read_header
from lidarcheck.formats.records import HEADER_BYTES, MOST_PADDING, RecordLayout, packed_columns, text_columns, writable
from lidarcheck.formats.source import first_bytes, read_lines, read_source, size_of
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import rows_as_text

__all__ = ["ENCODINGS", "read_pcd", "write_pcd"]

Column = npt.NDArray[Any]
LZF_BEST_RATIO = 88  # a back reference of 3 bytes stands for at most 264
SIZES = struct.Struct("<II")  # of the compressed block, and of what it holds
LARGEST_BLOCK = 2**32 - 1
RECORDS_AT_ONCE = 8192


def read_pcd(path: str | Path) -> Table:
    """The kept fields of a PCD file, as columns in its order, spelling and types.

    `InputError` with the line of a faulty header or row of text: unknown or repeated keys, TYPE and SIZE that do not go
    together, POINTS other than WIDTH times HEIGHT, a body that is cut off, or LZF data that do not unpack to what the
    header says.
    """
    file = Path(path)
    header = _checked_header(file)
    rows = header.rows
    content = read_lines(file) if header.encoding == "ascii" else read_source(file, most=scan_bytes())
    body = memoryview(content)[header.start :]
    if header.encoding == "ascii":
        return Table(text_columns(rows, content, header.start, header.first_line), file, height=header.height)
    if header.encoding == "binary":
        columns = packed_columns(rows, body)
        _check_rest(body[rows.count * rows.dtype.itemsize :], rows)
    else:
        columns = _unpack(body, rows)
    return Table(columns, file, height=header.height)


def write_pcd(table: Table, path: str | Path, encoding: Encoding = "binary_compressed") -> None:
    """Write the columns as PCD fields of the same names and types; whole or not at all.

    Text carries each float in the fewest digits that read back the same. `InputError` for a table beyond 4 GiB in
    `binary_compressed`, `UsageError` for an unknown encoding.
    """
    if encoding not in ENCODINGS:
        raise UsageError(f"there is no PCD encoding {encoding!r}", fix=f"use one of {', '.join(ENCODINGS)}")
    columns = writable(table, path, _plain_name)
    head = compose_header(columns, len(table), encoding, table.height)
    body = _body(columns, encoding, path)
    with atomic_write(path) as stream:
        stream.write(head)
        for part in body:
            stream.write(part)


def _checked_header(file: Path) -> PcdHeader:
    """The header, once it is known that what it claims can be: nothing but the beginning of the file is read."""
    head = first_bytes(file, HEADER_BYTES)
    header = read_header(head, file)
    size = size_of(file) - header.start
    if header.encoding == "binary_compressed":
        _check_sizes(head[header.start : header.start + SIZES.size], size, header.rows)
    else:
        header.rows.check_claim(size, packed=header.encoding == "binary")
    return header


def _check_sizes(sizes: bytes, there: int, rows: RecordLayout) -> None:
    """Hold the size that a compressed block says of itself against the `there` bytes that the file has for it."""
    if len(sizes) < SIZES.size:
        if rows.count:
            raise rows.miscounted("the bytes end before the two sizes of the compressed block")
        return
    rest = there - SIZES.size - SIZES.unpack(sizes)[0]
    if rest > MOST_PADDING:
        raise rows.miscounted(f"but {rest} bytes follow the last")


def _unpack(body: memoryview, rows: RecordLayout) -> dict[str, Column]:
    """The columns of a binary_compressed body: each field's numbers of all points, one field after the other."""
    if rows.count == 0 and len(body) < SIZES.size:
        return packed_columns(rows, memoryview(b""))
    packed_size, size = SIZES.unpack_from(body)
    fields = [f for f in rows.fields if f.kept]
    sizes = {rows.count * sum(f.dtype.itemsize * f.count for f in some): some for some in (rows.fields, fields)}
    if size not in sizes:
        raise rows.miscounted(f"the compressed block holds {size} bytes instead of {next(iter(sizes))}")
    end = SIZES.size + packed_size
    if len(body) < end:
        raise rows.miscounted(f"of {packed_size} compressed bytes there are {len(body) - SIZES.size}")
    _check_rest(body[end:], rows)
    plain = memoryview(_inflate(bytes(body[SIZES.size : end]), size, rows))
    columns: dict[str, Column] = {}
    offset = 0
    for field in sizes[size]:
        block = np.frombuffer(plain, field.dtype, rows.count * field.count, offset).reshape(rows.count, field.count)
        offset += block.nbytes
        if field.kept:
            native = field.dtype.newbyteorder("=")
            columns |= {name: np.array(block[:, i], dtype=native) for i, name in enumerate(field.names)}
    return columns


def _inflate(packed: bytes, size: int, rows: RecordLayout) -> bytes:
    import lzf

    plain: bytes | None = b"" if size == 0 else None
    if 0 < size <= LZF_BEST_RATIO * len(packed):
        rows.check_limit()
        try:
            plain = lzf.decompress(packed, size)
        except ValueError:
            plain = None
    if plain is None or len(plain) != size:
        raise InputError("the compressed data are damaged", file=rows.path, fix="write the file again")
    return plain


def _check_rest(rest: memoryview, rows: RecordLayout) -> None:
    """Refuse bytes behind the last point, but for the zeros or blanks that some writers pad with."""
    if bytes(rest).strip(b"\0 \t\r\n"):
        raise rows.miscounted(f"but {len(rest)} bytes follow the last")


def _plain_name(name: str) -> bool:
    return name != "_" and name.isprintable() and name.split() == [name]


def _body(columns: Mapping[str, Column], encoding: str, path: str | Path) -> Iterable[bytes | memoryview]:
    """What follows the header, part by part; `InputError` before the first where it cannot be."""
    if encoding == "ascii":
        return [rows_as_text(Table(columns), " ")]
    little = {name: column.astype(column.dtype.newbyteorder("<"), copy=False) for name, column in columns.items()}
    if encoding == "binary":
        return _records(little)
    size = sum(column.nbytes for column in little.values())
    if size > LARGEST_BLOCK:
        what = f"binary_compressed holds at most 4 GiB, these columns are {size} bytes"
        raise InputError(what, file=path, fix="write binary instead")
    packed = _deflate(b"".join(column.data.cast("B") for column in little.values() if len(column)))
    return [SIZES.pack(len(packed), size), packed]


def _records(columns: Mapping[str, Column]) -> Iterator[memoryview]:
    """Packed records, as many at a time as stay in the processor's cache."""
    rows = len(next(iter(columns.values())))
    records = np.empty(min(rows, RECORDS_AT_ONCE), [(name, column.dtype) for name, column in columns.items()])
    for start in range(0, rows, RECORDS_AT_ONCE):
        some = records[: rows - start]
        for name, column in columns.items():
            some[name] = column[start : start + len(some)]
        yield some.view(np.uint8).data


def _deflate(plain: bytes) -> bytes:
    """LZF, with room to grow: noise gets a byte longer for every 32."""
    import lzf

    if not plain:
        return b""
    packed: bytes = lzf.compress(plain, len(plain) + len(plain) // 16 + 64)
    return packed
