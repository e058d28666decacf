"""E57: the scans of a file, a frame each, by pye57 (extra `e57`).

Positions are the scanner's own: a scan's pose, which places it among others, is not applied. Row and column numbers
become `ring` and `column`; what a scan marks as invalid is no return.

Source: ASTM E2807.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.field.extras import needed
from lidarcheck.formats.field.recording import Recording
from lidarcheck.formats.limits import CONFIG_BYTES, check_rows
from lidarcheck.formats.table import Table, quoted

__all__ = ["open_e57"]

_NAMES = {
    "cartesianX": "X",
    "cartesianY": "Y",
    "cartesianZ": "Z",
    "intensity": "INTENSITY",
    "rowIndex": "ring",
    "columnIndex": "column",
    "cartesianInvalidState": "invalid",
    "sphericalInvalidState": "invalid",
}
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_PAGE, _PAGE_CONTENT = 1024, 1020
_DAMAGED = "was it written completely? export it again"


@dataclass
class _Scans(Recording):
    scans: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.scans)

    def table(self, number: int) -> Table:
        """The rows of a scan that pye57 reads; other fields are left out."""
        with _opened(self.path) as file:
            rows = _count(file, self.scans[number], self.path)
            check_rows(rows, len(_NAMES), self.path, says="a scan says that it holds")
            raw = file.read_scan_raw(self.scans[number], ignore_unsupported_fields=True)
        columns = {_NAMES[name]: column for name, column in raw.items() if name in _NAMES}
        if "X" not in columns and all(name in raw for name in _SPHERICAL):
            distance, azimuth, elevation = (raw[name] for name in _SPHERICAL)
            flat = distance * np.cos(elevation)
            xyz = (flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation))
            columns = {**dict(zip("XYZ", xyz, strict=True)), **columns}
        if not {"X", "Y", "Z"} <= set(columns):
            raise InputError("a scan has no positions", file=self.path, fix="export it with X, Y, Z")
        if "invalid" in columns:
            columns["invalid"] = (columns["invalid"] != 0).astype(np.uint8)
        return Table(columns, self.path)


def open_e57(path: Path, scan: str = "") -> Recording:
    """The scans of a file, or that of a number, from 0. `InputError` for a damaged file, or one without points."""
    _check_claims(path)
    with _opened(path) as file:
        scans = tuple(range(file.scan_count))
        moved = any(file.get_header(number).has_pose() for number in scans)
        fields = {name for number in scans for name in file.get_header(number).point_fields}
    if scan:
        if not scan.isdecimal() or int(scan[:9]) >= len(scans):
            fix = f"use 0 to {len(scans) - 1}"
            raise InputError(f"has no scan {quoted(scan)}", file=path, fix=fix)
        scans = (int(scan),)
    if not scans:
        raise InputError("the E57 file holds no scan", file=path, fix="export the point cloud, not only its images")
    lost = sorted(fields - set(_NAMES) - set(_SPHERICAL) - {"colorRed", "colorGreen", "colorBlue"})
    notes = ["each scan is in its scanner's frame: its pose is not applied"] if moved else []
    notes += [f"not read: {', '.join(lost)}"] if lost else []
    return _Scans(path, "E57", topic=scan, notes=tuple(notes), scans=scans)


def _check_claims(path: Path) -> None:
    """Hold the head against the file before the library opens it, and refuse XML with definitions of its own."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(48)
        if len(head) < 48:
            raise InputError("the E57 file ends in its head", file=path, fix=_DAMAGED)
        length, start, xml, page = struct.unpack_from("<QQQQ", head, 16)
        if length != size or page != _PAGE or start + xml > size:
            what = f"the E57 head says {length} bytes, the file has {size}" if length != size else "the E57 head is odd"
            raise InputError(what, file=path, fix=_DAMAGED)
        if xml > CONFIG_BYTES:
            raise InputError(f"the E57 file's XML has {xml} bytes", file=path, fix=f"the limit is {CONFIG_BYTES}")
        first = start // _PAGE * _PAGE
        stream.seek(first)
        pages = stream.read(xml // _PAGE_CONTENT * _PAGE + 3 * _PAGE)
    # The last four bytes of a page are its checksum, which may stand within a word.
    content = b"".join(pages[at : at + _PAGE_CONTENT] for at in range(0, len(pages), _PAGE))
    text = content[start - first :][:xml]
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError("the E57 file's XML defines entities", file=path, fix="export it again, without them")


def _count(file: Any, scan: int, path: Path) -> int:
    count = int(file.get_header(scan).point_count)
    if count < 0:
        raise InputError(f"a scan says that it holds {count} points", file=path, fix=_DAMAGED)
    return count


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file; what its library raises as a user is told."""
    pye57 = needed("pye57", "e57", "an E57 file", path)
    own = (
        pye57.libe57.E57Exception,
        RuntimeError,
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
        OSError,
    )
    try:
        with pye57.E57(str(path)) as file:
            yield file
    except InputError:
        raise
    except own as error:
        said = str(error).strip().partition("\n")[0][:200]
        raise InputError(f"the E57 file is damaged: {said}", file=path, fix=_DAMAGED) from None
