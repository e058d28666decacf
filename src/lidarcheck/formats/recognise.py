"""Which format a file has, told from its content, and which one to write, told from the suffix."""

from __future__ import annotations

import importlib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.field.packets import packet_file
from lidarcheck.formats.field.place import named
from lidarcheck.formats.field.recording import RECORDINGS, open_recording
from lidarcheck.formats.names import with_known_names
from lidarcheck.formats.source import first_bytes
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import delimiter_of

__all__ = ["FORMATS", "Format", "read_table", "recognise", "target_format", "write_table"]


@dataclass(frozen=True, slots=True)
class Format:
    """A file format: the module that reads and writes it, and the suffixes that ask for it.

    `title`: its name in messages. `suffixes`: in lower case.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]

    def read(self, path: str | os.PathLike[str]) -> Table:
        """The file's columns; `InputError` for whatever is wrong with it."""
        table: Table = self._function("read")(Path(path))
        return table

    def write(self, table: Table, path: str | os.PathLike[str]) -> None:
        """Write the columns, whole or not at all."""
        self._function("write")(table, Path(path))

    def _function(self, verb: str) -> Any:
        # Formats import heavy libraries, or are large themselves, so that only the one in use is loaded.
        return getattr(importlib.import_module(f"lidarcheck.formats.{self.name}"), f"{verb}_{self.name}")


FORMATS = {
    form.name: form
    for form in (
        Format("text", "CloudCompare text", (".txt", ".asc", ".xyz")),
        Format("csv", "CSV", (".csv",)),
        Format("parquet", "Parquet", (".parquet", ".pq")),
        Format("pcd", "PCD", (".pcd",)),
        Format("las", "LAS/LAZ", (".las", ".laz")),
        Format("ply", "PLY", (".ply",)),
    )
}
"""Every format of scans and ideal scans, by name."""

_FOREIGN = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive or an office document",
    b"\x1f\x8b": "gzip-compressed",
    b"BZh": "bzip2-compressed",
    b"\xfd7zXZ": "xz-compressed",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"7z\xbc\xaf": "a 7z archive",
    b"\x89HDF": "HDF5",
    b"\x93NUMPY": "a numpy array",
    b"#ROSBAG": "a ROS bag of another version than 2.0",
    b"\x89MCAP": "MCAP of another version than 0",
    b"ARROW1": "Arrow IPC",
    b"\x7fELF": "a program",
    b"\xff\xfe": "UTF-16 text",
    b"\xfe\xff": "UTF-16 text",
}
_MAGIC = {
    b"\x89MCAP0\r\n": "mcap",
    b"#ROSBAG V2.0\n": "rosbag",
    b"SQLite format 3\x00": "db3",
    b"ASTM-E57": "e57",
}
"""How recordings begin that say what they are."""
_BY_SUFFIX = {".osi": "osi", ".txth": "osi", ".bin": "bins"}
"""Of recordings that do not."""
_PCD_LINE = re.compile(rb"(?:#[^\n]*\n|[ \t]*\r?\n)*(?:VERSION|FIELDS|COLUMNS)[ \t]", re.IGNORECASE)
_BINARY_BODY = re.compile(rb"^(?:DATA|format)[ \t]+binary", re.IGNORECASE | re.MULTILINE)
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
_LUT_LINE = re.compile(rb"^[ \t]*PostPro\.", re.IGNORECASE | re.MULTILINE)
_INI_LINE = re.compile(rb"^[ \t]*(?:\[++[^\]\r\n]*+\]++|[A-Za-z_][\w.\"-]*[ \t]*=)", re.MULTILINE)
_JSON_LIST = re.compile(rb"\[\s*+(?:\{|\]\s*+\Z|\[\s*+\[)")  # no TOML has three brackets
_COMMENTS = re.compile(rb"(?:[ \t]*(?:[#;][^\n]*)?\r?\n)*")


def recognise(path: str | os.PathLike[str]) -> str:
    """The name of a file's format, by content: one of `FORMATS`, `RECORDINGS`, or `model`, `lut`, `settings`.

    A topic or frame behind the file's name does not matter. `model` stands for any TOML, `settings` for any JSON; their
    loaders judge them. `InputError` when the file cannot be read, is of a known foreign format, or is binary without
    being one that can be read.
    """
    path = named(path).file
    start = first_bytes(path)
    name = _by_magic(start)
    suffix = Path(path).suffix.lower()
    if name is not None:
        _refuse_binary_as_text(name, start, Path(path))
        return name
    recorded = next((kind for magic, kind in _MAGIC.items() if start.startswith(magic)), _BY_SUFFIX.get(suffix))
    if recorded is not None:
        return recorded
    packets = packet_file(start, Path(path))
    if packets is not None:
        raise packets
    _refuse_foreign(start, Path(path), suffix)
    return _by_text(start)


def _by_magic(start: bytes) -> str | None:
    if start.startswith(b"PAR1"):
        return "parquet"
    if start.startswith(b"LASF"):
        return "las"
    if re.match(rb"ply[ \t]*\r?\n", start):
        return "ply"
    if start.startswith(b"# .PCD") or _PCD_LINE.match(start):
        return "pcd"
    return None


def _refuse_binary_as_text(name: str, start: bytes, path: Path) -> None:
    """A binary file under a text file's name has been mislabelled; reading it on would hide that."""
    text_suffixes = (*FORMATS["text"].suffixes, *FORMATS["csv"].suffixes)
    if path.suffix.lower() in text_suffixes and (name in ("parquet", "las") or _BINARY_BODY.search(start)):
        form = FORMATS[name]
        what = f"the file is binary, its content is {form.title}, its name says text"
        raise InputError(what, file=path, fix=f"rename it to {path.stem}{form.suffixes[0]}")


def _refuse_foreign(start: bytes, path: Path, suffix: str) -> None:
    for magic, title in _FOREIGN.items():
        if start.startswith(magic):
            raise InputError(f"the file is {title}, not a scan", file=path, fix=f"use one of {_titles()}")
    if not _is_binary(start):
        return
    named = next((form for form in FORMATS.values() if suffix in form.suffixes), None)
    if named is not None and named.name not in ("text", "csv"):
        what = f"the file is binary but does not begin as {named.title} does"
        raise InputError(what, file=path, fix="was it damaged or cut off?")
    _refuse_other_encoding(start, path)
    raise InputError("the file is binary, in no format that is known", file=path, fix=f"use one of {_titles()}")


def _refuse_other_encoding(start: bytes, path: Path) -> None:
    """Text of an older encoding holds no control characters and is mostly of ASCII."""
    odd = len(start) - len(start.translate(None, bytes(range(128, 256))))
    if _CONTROL.search(start) or odd > len(start) / 3:
        return
    try:
        start.decode("utf-8")
    except UnicodeDecodeError as error:
        line = start.count(b"\n", 0, error.start) + 1
        what = f"the line is not UTF-8: byte 0x{start[error.start]:02x}"
        raise InputError(what, file=path, line=line, fix="save the file as UTF-8") from None


def _is_binary(start: bytes) -> bool:
    """Whether the first line holds control characters, or a twentieth of all bytes are not of UTF-8 text."""
    first = start[:4096].splitlines()[0]
    odd = len(_CONTROL.findall(start)) + start[:-3].decode("utf-8", "replace").count("\ufffd")
    return _CONTROL.search(first) is not None or odd > len(start) / 20


def _by_text(start: bytes) -> str:
    text = start.removeprefix(b"\xef\xbb\xbf")
    first = text.lstrip(b" \t\r\n")
    if first.startswith(b"{") or _JSON_LIST.match(first):
        return "settings"
    if _LUT_LINE.search(text):
        return "lut"
    comments = _COMMENTS.match(text)
    if comments and _INI_LINE.match(text, comments.end()):
        return "model"
    return "csv" if delimiter_of(start) in ",;" else "text"


def read_table(path: str | os.PathLike[str]) -> Table:
    """The columns of a scan or ideal scan in any format, by our names; of a recording, of its only frame or the named.

    `InputError` when the file is none, or a recording of several frames.
    """
    name = recognise(path)
    if name in RECORDINGS:
        recording, frame = open_recording(path, name), named(path).frame
        if frame is None:
            return recording.only()
        if frame >= len(recording):
            what = f"has no frame {frame}: it holds {len(recording)}"
            raise InputError(what, file=recording.path, fix=f"name one of 0 to {len(recording) - 1}")
        return recording.read(frame)
    if name not in FORMATS:
        title = {"model": "TOML", "lut": "a table of LUTs", "settings": "JSON"}[name]
        raise InputError(f"the file is {title}, not a scan", file=path, fix=f"use one of {_titles()}")
    return with_known_names(FORMATS[name].read(path))


def target_format(path: str | os.PathLike[str]) -> Format:
    """The format that a suffix asks for, in any case; `UsageError` lists the known ones."""
    suffix = Path(path).suffix.lower()
    for form in FORMATS.values():
        if suffix in form.suffixes:
            return form
    known = ", ".join(suffix for form in FORMATS.values() for suffix in form.suffixes)
    what = f"cannot write {suffix!r} files" if suffix else "cannot tell the format to write: the name has no suffix"
    raise UsageError(what, file=path, fix=f"use one of {known}")


def write_table(table: Table, path: str | os.PathLike[str]) -> None:
    """Write the columns in the format that the suffix asks for, whole or not at all."""
    target_format(path).write(table, path)


def _titles() -> str:
    return ", ".join(form.title for form in FORMATS.values())
