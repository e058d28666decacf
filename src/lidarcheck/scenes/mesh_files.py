"""What stands in a mesh file, made ready for trimesh: one encoding, one way to end a line, nothing cut off.

trimesh decodes text by a package that need not be there when it is not UTF-8, takes a name for numbers and passes over
what is cut off; so text is cleaned, and sizes and counts are checked, before it reads them.
"""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.limits import MESH_CORNERS, RESULT_BYTES, check_bytes
from lidarcheck.reading import note

__all__ = ["check_glb", "mesh_content"]

_STL_HEADER, _STL_FACE = 84, 50
_BINARY = b"\x00"
_COMPLETE = "was it written completely? export it again"
_HEADER_COMMENT = re.compile(rb"^(?:comment|obj_info)\b[^\r\n]*\r?\n", re.MULTILINE)
_ASCII_PLY = re.compile(rb"^format +ascii\b", re.MULTILINE)
_ELEMENT = re.compile(rb"^element +\w+ +([0-9]{1,12})\b", re.MULTILINE)
_CONTINUED = re.compile(r"\\[ ]*\n")
_REMARK = re.compile(r"#[^\n]*")
_EDGES = re.compile(r"^ +| +$", re.MULTILINE)
_VERTEX = re.compile(r"^v ", re.MULTILINE)
_SOLID = re.compile(r"^ *(end *solid|solid)\b[^\n]*", re.MULTILINE | re.IGNORECASE)
_FACETS = re.compile(r"^ *facet\b", re.MULTILINE | re.IGNORECASE)
_FACET_ENDS = re.compile(r"^ *end *facet\b", re.MULTILINE | re.IGNORECASE)
_VERTICES = re.compile(r"^ *vertex\b", re.MULTILINE | re.IGNORECASE)


def mesh_content(path: Path, kind: str) -> bytes:
    """The file's content as trimesh can read it; `kind`: stl, obj, ply or glb.

    `InputError` with the file for what is cut off, or is of another format than `kind`.
    """
    note(path)
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path, fix="check its permissions") from None
    if kind == "stl":
        return _stl(raw, path)
    if kind == "obj":
        return _obj(raw, path)
    return _ply(raw, path) if kind == "ply" else raw


def check_glb(path: Path) -> None:
    """Count the corners that a GLB file comes down to, before they are made: the same ones may stand in many places.

    `InputError` for more than `MESH_CORNERS`, or more in one list than the file has bytes. What is no GLB passes.

    Source: Khronos Group, "glTF 2.0 Specification", 2021: binary files, accessors, primitives, nodes.
    """
    note(path)
    with path.open("rb") as stream:
        head = stream.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            return
        length: int = struct.unpack_from("<I", head, 12)[0]
        check_bytes(length, path, RESULT_BYTES)
        text = stream.read(length)
    try:
        document = json.loads(text)
        counts = [int(accessor.get("count", 0)) for accessor in document.get("accessors", [])]
        corners = _corners(document, counts)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
        return  # for its reader to say
    size = path.stat().st_size
    if max(counts, default=0) > size:
        what = f"not a whole GLB mesh: it says that it holds {max(counts)} numbers in a row, it has {size} bytes"
        raise InputError(what, file=path, fix=_COMPLETE)
    if corners > MESH_CORNERS:
        what = f"the mesh comes down to {corners} corners of triangles"
        raise InputError(what, file=path, fix=f"the limit is {MESH_CORNERS}: name a coarser mesh, or parts of it")


def _corners(document: dict[str, Any], counts: list[int]) -> int:
    """Of all meshes, each as often as nodes place it, or once."""
    of_mesh: list[int] = [
        sum(max(counts[at] for at in [*one["attributes"].values(), *_indices(one)]) for one in mesh["primitives"])
        for mesh in document.get("meshes", [])
    ]
    placed: list[int] = [of_mesh[node["mesh"]] for node in document.get("nodes", []) if "mesh" in node]
    return max(sum(placed), sum(of_mesh))


def _indices(primitive: dict[str, Any]) -> list[int]:
    return [primitive["indices"]] if "indices" in primitive else []


def _text(raw: bytes) -> str:
    """UTF-8, else Latin-1, in which every byte is a letter; without byte order mark, tabs and returns."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ")


def _obj(raw: bytes, path: Path) -> bytes:
    if _BINARY in raw:
        raise InputError("not an OBJ mesh: its content is binary", file=path, fix="give it the suffix of its format")
    text = _EDGES.sub("", _REMARK.sub("", _CONTINUED.sub(" ", _text(raw))))
    if not _VERTEX.search(text):
        what = "not an OBJ mesh: it has no line `v X Y Z`"
        raise InputError(what, file=path, fix="give it the suffix of its format, or export it again")
    return text.encode()


def _stl(raw: bytes, path: Path) -> bytes:
    faces = struct.unpack_from("<I", raw, _STL_HEADER - 4)[0] if len(raw) >= _STL_HEADER else 0
    if len(raw) == _STL_HEADER + _STL_FACE * faces:
        return raw
    text = _text(raw)
    if _BINARY not in raw and _SOLID.search(text):
        return _stl_text(text, path)
    if len(raw) < _STL_HEADER:
        raise InputError(f"not an STL mesh: it ends after {len(raw)} bytes", file=path, fix=_COMPLETE)
    room = (len(raw) - _STL_HEADER) / _STL_FACE
    what = f"not an STL mesh: its header says {faces} triangles, there is room for {room:.10g}"
    raise InputError(what, file=path, fix=_COMPLETE)


def _stl_text(text: str, path: Path) -> bytes:
    begun, ended, corners = (len(pattern.findall(text)) for pattern in (_FACETS, _FACET_ENDS, _VERTICES))
    solids = [match.group(1).lower() for match in _SOLID.finditer(text)]
    if begun != ended or corners != 3 * begun or solids[-1] == "solid":
        what = f"not a whole STL mesh: {begun} facets begin and {ended} end, with {corners} corners"
        what += " and no endsolid" if solids[-1] == "solid" else ""
        raise InputError(what, file=path, fix=_COMPLETE)
    # Names may hold words that trimesh looks for.
    return _SOLID.sub(lambda match: "endsolid" if match.group(1).lower() != "solid" else "solid", text).encode()


def _ply(raw: bytes, path: Path) -> bytes:
    """Without the header's comments, which may be in any encoding, or name a texture."""
    raw = raw.removeprefix(b"\xef\xbb\xbf")
    end = raw.find(b"end_header")
    if end < 0:
        return raw
    header, data = _HEADER_COMMENT.sub(b"", raw[:end]), raw[end:]
    if _ASCII_PLY.search(header):
        announced = sum(int(count) for count in _ELEMENT.findall(header))
        rows = sum(1 for line in data.splitlines()[1:] if line.strip())
        if rows < announced:
            what = f"not a whole PLY mesh: its header says {announced} rows, the file has {rows}"
            raise InputError(what, file=path, fix=_COMPLETE)
    return header + data
