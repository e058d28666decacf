"""The header of a PCD file: lines of text that say what each point holds, how many there are, and how they are stored.

Source: "The PCD (Point Cloud Data) file format", Point Cloud Library documentation.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError
from lidarcheck.formats.records import Field, RecordLayout
from lidarcheck.formats.table import quoted

__all__ = ["ENCODINGS", "Encoding", "PcdHeader", "compose_header", "read_header"]

logger = logging.getLogger(__name__)

Encoding = Literal["ascii", "binary", "binary_compressed"]
ENCODINGS: tuple[Encoding, ...] = get_args(Encoding)
VERSIONS = ("0.7", ".7", "0.6", ".6", "0.5", ".5")
KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
TYPES = {
    ("F", 4): "f4",
    ("F", 8): "f8",
    **{("I", size): f"i{size}" for size in (1, 2, 4, 8)},
    **{("U", size): f"u{size}" for size in (1, 2, 4, 8)},
}
MAX_HEADER_LINES = 1000
MAX_LINE = 1 << 20
MAX_DIGITS = 15
KEY_FIX = f"the keys are {', '.join(KEYS)}"


@dataclass(frozen=True, slots=True)
class PcdHeader:
    """`rows`: what the points hold; the body starts at byte `start`, in line `first_line` where it is text.

    `height`: rows of an organised cloud, 1 of any other.
    """

    rows: RecordLayout
    encoding: Encoding
    start: int
    first_line: int
    height: int


@dataclass(frozen=True, slots=True)
class _Word:
    """The values that stand behind a header key, and the line they stand in."""

    values: list[str]
    line: int


def read_header(content: bytes, path: Path) -> PcdHeader:
    """The header, checked against itself; `InputError` with the line of its first fault."""
    words, start, first_line = _header(content, path)
    rows = _rows(words, path)
    _warn_of_viewpoint(words, path)
    height = _whole(words["HEIGHT"], "HEIGHT", path, 1)[0] if "HEIGHT" in words else 1
    organised = height > 1 and rows.count > 0 and rows.count % height == 0
    return PcdHeader(rows, _encoding(words["DATA"], path), start, first_line, height if organised else 1)


def _header(content: bytes, path: Path) -> tuple[dict[str, _Word], int, int]:
    """The header's words by key, where the body begins, and in which line."""
    words: dict[str, _Word] = {}
    start = 0
    for line in range(1, MAX_HEADER_LINES + 1):
        end = content.find(b"\n", start)
        raw = content[start : end if end >= 0 else len(content)]
        key, values = _words(raw, path, line)
        if key in words:
            raise InputError(f"{key} stands twice in the header", file=path, line=line, fix="keep one of them")
        if key:
            words[key] = _Word(values, line)
        start = end + 1
        if end < 0:
            start = len(content)
        if key == "DATA" or end < 0:
            break
    if "DATA" not in words:
        raise InputError("the header has no DATA line", file=path, fix="the file is cut off or no PCD: write it again")
    return words, start, line + 1


def _words(raw: bytes, path: Path, line: int) -> tuple[str, list[str]]:
    """One header line: its key in capitals, and its values; no key where the line is blank or a comment."""
    try:
        text = raw[:MAX_LINE].decode("utf-8").strip()
    except UnicodeDecodeError:
        raise InputError(f"{quoted(raw)} is no PCD header line", file=path, line=line, fix=KEY_FIX) from None
    if not text or text.startswith("#"):
        return "", []
    key, *values = text.split()
    name = "FIELDS" if key.upper() == "COLUMNS" else key.upper()
    if name not in KEYS:
        raise InputError(f"{quoted(key)} is no PCD header key", file=path, line=line, fix=KEY_FIX)
    if not values:
        raise InputError(f"{name} has no value", file=path, line=line, fix="complete the line")
    return name, values


def _rows(words: Mapping[str, _Word], path: Path) -> RecordLayout:
    """What the header claims, checked against itself."""
    for key in ("FIELDS", "SIZE", "TYPE"):
        if key not in words:
            raise InputError(f"the header has no {key} line", file=path, line=words["DATA"].line, fix=f"add {key}")
    version = words.get("VERSION")
    if version and version.values[0] not in VERSIONS:
        what = f"PCD version {quoted(version.values[0])} is not known"
        raise InputError(what, file=path, line=version.line, fix="use 0.7")
    points, line, claim = _points(words, path)
    names = words["FIELDS"].values
    sizes = _whole(words["SIZE"], "SIZE", path, len(names))
    counts = _whole(words["COUNT"], "COUNT", path, len(names)) if "COUNT" in words else [1] * len(names)
    types = words["TYPE"].values
    _same_number(words["TYPE"], "TYPE", path, len(names))
    fields = [_field(*one, words, path) for one in zip(names, types, sizes, counts, strict=True)]
    rows = RecordLayout(tuple(fields), points, path, line, claim, (words["FIELDS"].line,) * len(fields))
    rows.check()
    return rows


def _field(name: str, kind: str, size: int, count: int, words: Mapping[str, _Word], path: Path) -> Field:
    code = TYPES.get((kind.upper(), size))
    if code is None:
        what = f"field {quoted(name)} has TYPE {quoted(kind)} with SIZE {size}"
        fix = "F goes with 4 or 8, I and U with 1, 2, 4 or 8"
        raise InputError(what, file=path, line=words["TYPE"].line, fix=fix)
    return Field(name, np.dtype("<" + code), count, kept=name != "_" and count > 0)


def _points(words: Mapping[str, _Word], path: Path) -> tuple[int, int, str]:
    """The number of points, the line that says so, and how it says so."""
    known = {key: _whole(words[key], key, path, 1)[0] for key in ("WIDTH", "HEIGHT", "POINTS") if key in words}
    area = known["WIDTH"] * known.get("HEIGHT", 1) if "WIDTH" in known else None
    if "POINTS" not in known:
        if area is None:
            what, line = "the header has no POINTS line", words["DATA"].line
            raise InputError(what, file=path, line=line, fix="add POINTS, the number of points")
        return area, words["WIDTH"].line, "WIDTH times HEIGHT is"
    points, line = known["POINTS"], words["POINTS"].line
    if area is not None and area != points:
        what = f"POINTS is {points}, but WIDTH times HEIGHT is {area}"
        raise InputError(what, file=path, line=line, fix="make them agree with the number of points in the file")
    return points, line, "POINTS says"


def _whole(word: _Word, key: str, path: Path, expected: int) -> list[int]:
    """The values of a key as whole numbers from 0, as many as expected."""
    _same_number(word, key, path, expected)
    for value in word.values:
        if not (value.isascii() and value.isdecimal() and len(value) <= MAX_DIGITS):
            what = f"{key} has {quoted(value)}, not a whole number"
            fix = f"use a number from 0 with at most {MAX_DIGITS} digits"
            raise InputError(what, file=path, line=word.line, fix=fix)
    return [int(value) for value in word.values]


def _same_number(word: _Word, key: str, path: Path, expected: int) -> None:
    if len(word.values) != expected:
        what = f"{key} has {len(word.values)} values, not {expected}"
        raise InputError(what, file=path, line=word.line, fix="FIELDS, SIZE, TYPE and COUNT need one value per field")


def _encoding(word: _Word, path: Path) -> Encoding:
    found = " ".join(word.values).lower()
    for encoding in ENCODINGS:
        if encoding == found:
            return encoding
    fix = f"use one of {', '.join(ENCODINGS)}"
    raise InputError(f"DATA {quoted(found)} is not known", file=path, line=word.line, fix=fix)


def _warn_of_viewpoint(words: Mapping[str, _Word], path: Path) -> None:
    """Say that a pose other than the identity is not applied: coordinates are taken as the sensor's own."""
    word = words.get("VIEWPOINT")
    if word is None:
        return
    _same_number(word, "VIEWPOINT", path, 7)
    try:
        pose = [float(value) for value in word.values]
    except ValueError:
        what = f"VIEWPOINT {quoted(' '.join(word.values))} is not seven numbers"
        raise InputError(what, file=path, line=word.line, fix="use 0 0 0 1 0 0 0") from None
    if pose != [0, 0, 0, 1, 0, 0, 0]:
        logger.warning("%s:%d: VIEWPOINT is not applied: X Y Z are taken as the sensor's own frame", path, word.line)


def compose_header(columns: Mapping[str, npt.NDArray[Any]], points: int, encoding: str, height: int = 1) -> bytes:
    """The header of a cloud of these columns, a field each; `height`: of an organised one, which divides `points`."""
    kinds = [column.dtype for column in columns.values()]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(columns)}",
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}",
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}",
        f"COUNT {' '.join('1' for _ in kinds)}",
        f"WIDTH {points // height}",
        f"HEIGHT {height}",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {points}",
        f"DATA {encoding}",
    ]
    return ("\n".join(lines) + "\n").encode("utf-8")
