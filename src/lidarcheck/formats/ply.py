"""Polygon files (PLY 1.0) as point clouds: the element `vertex`, ascii or binary of either byte order.

Other elements, such as faces, are passed over. PLY has no 64-bit integers: such columns are written as 32-bit ones
where they fit, else as float64 where that is exact.

Source: G. Turk, "The PLY Polygon File Format", 1994; the type names with a width (`float32`) as in common use.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.formats.limits import scan_bytes
from lidarcheck.formats.records import HEADER_BYTES, Field, RecordLayout, packed_columns, text_columns, writable
from lidarcheck.formats.source import first_bytes, read_lines, read_source, size_of
from lidarcheck.formats.table import Table, quoted
from lidarcheck.formats.text import rows_as_text

__all__ = ["ENCODINGS", "read_ply", "write_ply"]

logger = logging.getLogger(__name__)

Column = npt.NDArray[Any]
Encoding = Literal["ascii", "binary_little_endian", "binary_big_endian"]
BYTE_ORDERS: dict[str, Literal["=", "<", ">"]] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
ENCODINGS = tuple(BYTE_ORDERS)
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
TYPE_NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"} | {
    "f4": "float",
    "f8": "double",
}
MAX_HEADER_LINES = 20_000
MAX_LINE = 1 << 16
MAX_DIGITS = 15
KEYWORD_FIX = "it has format, element, property and comment lines, then end_header before the points"
TYPE_FIX = f"the types are {', '.join(TYPES)}"
EXACT_IN_FLOAT = 2**53


@dataclass(slots=True)
class _Element:
    """One element of the header while it is read; `has_list` where a row's length is not known beforehand."""

    name: str
    count: int
    line: int
    fields: list[Field] = field(default_factory=list)
    has_list: int = 0
    field_lines: list[int] = field(default_factory=list)


@dataclass(slots=True)
class _Header:
    """The header: its encoding, its elements, where the body begins, and in which line."""

    encoding: str = ""
    elements: list[_Element] = field(default_factory=list)
    start: int = 0
    first_line: int = 0


def read_ply(path: str | Path) -> Table:
    """The properties of `vertex`, as columns in the file's order, spelling and types.

    NaN is a value. `InputError` with the line of a faulty header or row of text: no `end_header`,
    unknown types, no `vertex`, list properties in or before it, or fewer or more rows than the header says.
    """
    file = Path(path)
    header = _header(first_bytes(file, HEADER_BYTES), file)
    before, vertex, last = _find_vertex(header, file)
    rows = _rows(vertex, file)
    if header.encoding == "ascii":
        rows.check_claim(size_of(file) - header.start, packed=False)
        content = read_lines(file)
        start, line = _skip_lines(content, header, sum(element.count for element in before), rows)
        return Table(text_columns(rows, content, start, line, last=last), file)
    skipped = sum(element.count * _size(element) for element in before)
    rows.check_claim(max(size_of(file) - header.start - skipped, 0), packed=True, last=last)
    content = read_source(file, most=scan_bytes())
    body_view = memoryview(content)[header.start :][skipped:]
    columns = packed_columns(rows, body_view)
    rest = bytes(body_view[rows.count * rows.dtype.itemsize :])
    if last and rest.strip(b"\0 \t\r\n"):
        raise rows.miscounted(f"but {len(rest)} bytes follow the last")
    return Table(columns, file)


def write_ply(table: Table, path: str | Path, encoding: Encoding = "binary_little_endian") -> None:
    """Write the columns as properties of `vertex`, with the same names; whole or not at all.

    Text carries each float in the fewest digits that read back the same. `InputError` for a column name beyond ASCII
    and for integers that no PLY type holds exactly, `UsageError` for an unknown encoding.
    """
    if encoding not in ENCODINGS:
        raise UsageError(f"there is no PLY encoding {encoding!r}", fix=f"use one of {', '.join(ENCODINGS)}")
    columns = writable(table, path, _plain_name)
    columns = {name: _without_64_bits(name, column, path) for name, column in columns.items()}
    lines = ["ply", f"format {encoding} 1.0", "comment point cloud in metres: X forward, Y left, Z up"]
    lines.append(f"element vertex {len(table)}")
    lines += [f"property {TYPE_NAMES[column.dtype.str[1:]]} {name}" for name, column in columns.items()]
    head = ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")
    if encoding == "ascii":
        write_bytes(path, head + rows_as_text(Table(columns), " "))
        return
    order = BYTE_ORDERS[encoding]
    records = np.empty(len(table), [(name, column.dtype.newbyteorder(order)) for name, column in columns.items()])
    for name, column in columns.items():
        records[name] = column
    write_bytes(path, head + records.tobytes())


def _header(content: bytes, path: Path) -> _Header:
    header = _Header()
    for line in range(1, MAX_HEADER_LINES + 1):
        end = content.find(b"\n", header.start, header.start + MAX_LINE)
        raw = content[header.start : end if end >= 0 else header.start + MAX_LINE]
        if end < 0 and raw.strip() != b"end_header":
            break
        header.start = end + 1 if end >= 0 else len(content)
        words = _words(raw, path, line)
        if line == 1 and words != ["ply"]:
            raise InputError(f"{quoted(raw)} is not the word 'ply'", file=path, line=1, fix="this is no PLY file")
        if words == ["end_header"]:
            header.first_line = line + 1
            return header
        if line > 1:
            _header_line(header, words, path, line)
    fix = "the file is cut off or no PLY: write it again"
    raise InputError("the header has no end_header line", file=path, line=line, fix=fix)


def _words(raw: bytes, path: Path, line: int) -> list[str]:
    """The words of a header line; comments, in any encoding, have none."""
    if raw.split(maxsplit=1)[:1] in ([b"comment"], [b"obj_info"]):
        return []
    try:
        return raw.decode("ascii").split()
    except UnicodeDecodeError:
        raise InputError(f"{quoted(raw)} is no PLY header line", file=path, line=line, fix="write it again") from None


def _header_line(header: _Header, words: list[str], path: Path, line: int) -> None:
    """Add one line of the header to what is known of it."""
    if words and words[0] != "format" and not header.encoding:
        fix = f"add it behind the first line, with one of {', '.join(ENCODINGS)} and version 1.0"
        raise InputError("the format line is missing before this one", file=path, line=line, fix=fix)
    match words:
        case []:
            return
        case ["format", encoding, "1.0"] if encoding in ENCODINGS and not header.encoding:
            header.encoding = encoding
        case ["format", *_]:
            what = "the format is said twice" if header.encoding else f"the format {quoted(' '.join(words[1:]))}"
            fix = f"use one format line, with one of {', '.join(ENCODINGS)} and version 1.0"
            raise InputError(f"{what} cannot be read", file=path, line=line, fix=fix)
        case ["element", name, count] if count.isascii() and count.isdecimal() and len(count) <= MAX_DIGITS:
            header.elements.append(_Element(name, int(count), line))
        case ["element", *_]:
            what = f"{quoted(' '.join(words))} is not a name and a whole number"
            fix = f"write 'element NAME COUNT' with at most {MAX_DIGITS} digits"
            raise InputError(what, file=path, line=line, fix=fix)
        case ["property", *rest] if header.elements:
            _property(header, rest, path, line)
        case _:
            what = f"{quoted(' '.join(words))} does not belong here in a PLY header"
            raise InputError(what, file=path, line=line, fix=KEYWORD_FIX)


def _property(header: _Header, words: list[str], path: Path, line: int) -> None:
    element = header.elements[-1]
    match words:
        case [kind, name] if kind in TYPES:
            element.fields.append(Field(name, np.dtype(BYTE_ORDERS[header.encoding] + TYPES[kind])))
            element.field_lines.append(line)
        case ["list", kind, of, _] if kind in TYPES and of in TYPES:
            element.has_list = line
        case _:
            what = f"{quoted('property ' + ' '.join(words))} has no known type"
            raise InputError(what, file=path, line=line, fix=TYPE_FIX)


def _find_vertex(header: _Header, path: Path) -> tuple[list[_Element], _Element, bool]:
    """The elements before `vertex`, `vertex` itself, and whether it is the last."""
    names = [element.name for element in header.elements]
    if names.count("vertex") != 1:
        what = f"the header has {names.count('vertex')} elements called vertex"
        fix = "points are the one element called vertex"
        raise InputError(what, file=path, line=header.first_line - 1, fix=fix)
    at = names.index("vertex")
    for element in header.elements[: at + 1]:
        if element.has_list and (element.name == "vertex" or header.encoding != "ascii"):
            what = f"element {quoted(element.name)} has a list property"
            fix = "write the points without lists, as the first element"
            raise InputError(what, file=path, line=element.has_list, fix=fix)
    others = [name for name in names if name != "vertex"]
    if others:
        logger.warning("%s: passed over the elements %s; only vertex holds points", path, ", ".join(others))
    return header.elements[:at], header.elements[at], at + 1 == len(names)


def _rows(vertex: _Element, path: Path) -> RecordLayout:
    rows = RecordLayout(
        tuple(vertex.fields), vertex.count, path, vertex.line, "element vertex says", tuple(vertex.field_lines)
    )
    rows.check()
    return rows


def _size(element: _Element) -> int:
    return sum(f.dtype.itemsize for f in element.fields)


def _skip_lines(content: bytes, header: _Header, lines: int, rows: RecordLayout) -> tuple[int, int]:
    """Where the first row of `vertex` begins, and that row's line."""
    start = header.start
    for _ in range(lines):
        start = content.find(b"\n", start) + 1
        if start == 0:
            raise rows.miscounted("the file ends before the first")
    return start, header.first_line + lines


def _plain_name(name: str) -> bool:
    return name.isascii() and name.isprintable() and name.split() == [name]


def _without_64_bits(name: str, column: Column, path: str | Path) -> Column:
    """Integers that 32 bits do not hold as float64, where that is exact."""
    if column.dtype.kind == "f" or column.dtype.itemsize < 8:
        return column
    if max(-int(column.min()), int(column.max())) > EXACT_IN_FLOAT:
        what = f"column {quoted(name)} holds integers beyond ±2^53, which no PLY type keeps"
        raise InputError(what, file=path, fix="write PCD or Parquet instead")
    return column.astype(np.float64)
