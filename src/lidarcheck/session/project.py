"""What is in a project's directory: scenarios, goldens, models, LUTs, settings, measurements; and what is wrong there.

Files are recognised by what is in them. One that has a fault is named with it, and the others can still be used.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError, LidarcheckError

__all__ = ["KINDS", "Entry", "Project", "read_project"]

KINDS = ("scenario", "golden", "model", "case", "scene", "lut", "settings", "profile", "ideal", "scan", "recording")
"""What a file can be."""

_SKIPPED = {"node_modules", "__pycache__", "build", "dist"}
_CASE = "case.toml"
_DEEPEST, _MOST = 5, 5000
_SCANS = {".txt", ".csv", ".asc", ".xyz", ".pcd", ".ply", ".las", ".laz", ".parquet", ".pq"}
_TABLES = {".ini", ".cfg", ".conf"}
_RECORDINGS = {".mcap", ".bag", ".db3", ".e57", ".osi", ".txth"}
_LUT = re.compile(rb"^[ \t]*PostPro\.LUT_bloom", re.IGNORECASE | re.MULTILINE)
_PROFILE = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\r\n]*\b(?:offset_(?:spad_rows|columns|layers|points)|feature[ \t]*,[ \t]*y_m)\b",
    re.I,
)
_IDEAL = re.compile(rb"\bMaterialID\b|\bObjTag\b", re.IGNORECASE)
_SCAN = re.compile(
    rb"\b(?:Layer|EchoNumber|AREA|PEAK|INTENSITY|REFLECTIVITY|SIGNAL)\b|\bX\b.*\bY\b.*\bZ\b", re.IGNORECASE
)
_SETTINGS = re.compile(r"Blooming_Calibration_[VH]_", re.IGNORECASE)


@dataclass(frozen=True)
class Entry:
    """A file: its path, one of `KINDS`, its name within the project, and its fault, empty where none is known.

    A directory that cannot be read is one of the kind `directory`.
    """

    path: Path
    kind: str
    name: str
    fault: str = ""


@dataclass(frozen=True)
class Project:
    """A directory and the files that were recognised in it, in the order of their names.

    `cut`: there are more files than are looked at.
    """

    root: Path
    entries: tuple[Entry, ...] = ()
    cut: bool = False

    def of(self, kind: str, *, sound: bool = True) -> list[Entry]:
        """The entries of a kind; only those without a fault where `sound`."""
        return [entry for entry in self.entries if entry.kind == kind and not (sound and entry.fault)]

    @property
    def faults(self) -> list[Entry]:
        """The entries with a fault."""
        return [entry for entry in self.entries if entry.fault]

    def inside(self, text: str) -> str:
        """A text without the project's own path in front of its files."""
        for root in (os.path.realpath(self.root), str(self.root)):
            text = text.replace(f"{root}{os.sep}", "") if root != os.curdir else text
        return text

    def in_words(self) -> str:
        """How many files of each kind there are."""
        counts = [(kind, sum(entry.kind == kind for entry in self.entries)) for kind in KINDS]
        return ", ".join(f"{n} {kind}{'s' if n > 1 and kind != 'settings' else ''}" for kind, n in counts if n)


def read_project(root: Path) -> Project:
    """Look at the files of a directory. `InputError` when it is none or cannot be read."""
    if not root.is_dir():
        what = "is not a directory" if root.exists() else "there is no such directory"
        raise InputError(what, file=root, fix="give the directory with scenarios, models and tables")
    files: list[Path] = []
    closed: list[Entry] = []
    cut = False
    for file in _files(root, closed):
        if len(files) == _MOST:
            cut = True
            break
        files.append(file)
    found = (_entry(file, file.relative_to(root).as_posix()) for file in files)
    entries = [*(entry for entry in found if entry is not None), *closed]
    return Project(root, tuple(sorted(entries, key=lambda entry: entry.name)), cut)


def _files(root: Path, closed: list[Entry]) -> Iterator[Path]:
    """The files that may be of use; `closed` gets the directories that cannot be read."""

    def refused(error: OSError) -> None:
        if error.filename is None or Path(error.filename) == root:
            raise InputError(f"cannot read: {error.strerror}", file=root, fix="check its permissions") from error
        path = Path(error.filename)
        fault = f"{path}: the directory cannot be read: {error.strerror}; check its permissions"
        closed.append(Entry(path, "directory", path.relative_to(root).as_posix(), fault))

    for directory, below, names in os.walk(root, onerror=refused):
        deep = len(Path(directory).relative_to(root).parts) >= _DEEPEST
        below[:] = [] if deep else sorted(d for d in below if not d.startswith(".") and d not in _SKIPPED)
        yield from (Path(directory) / name for name in sorted(names) if not name.startswith("."))


def _entry(path: Path, name: str) -> Entry | None:
    """What a file is; None for what is no business of ours."""
    suffix = path.suffix.lower()
    if suffix not in {".toml", ".json", *_SCANS, *_TABLES, *_RECORDINGS}:
        return None
    kind = _expected(name, suffix)
    try:
        return _recognised(path, name, suffix)
    except LidarcheckError as error:
        fault = error.lines()[0].removeprefix("error: ")
    except OSError as error:
        fault = f"{path}: cannot be read: {error.strerror or error}"
    except Exception as error:  # noqa: BLE001 - no file may keep the others from being used
        fault = f"{path}: cannot be looked at, {type(error).__name__}: {error}"
    return None if kind is None else Entry(path, kind, name, fault)


def _expected(name: str, suffix: str) -> str | None:
    """What a file is meant to be, by its name, where its content does not tell."""
    parts = Path(name).parts
    if suffix == ".toml" and parts[-1] == _CASE:
        return "case"
    if suffix == ".toml":
        return "scenario" if "scenarios" in parts[-2:-1] else "golden" if "goldens" in parts else "model"
    if suffix == ".json":
        return "settings" if _SETTINGS.search(parts[-1]) else None
    if suffix in _TABLES:
        return "lut" if "lut" in parts[-1].lower() else None
    return "recording" if suffix in _RECORDINGS else "scan"


def _recognised(path: Path, name: str, suffix: str) -> Entry | None:
    if suffix == ".toml":
        return _toml(path, name)
    if suffix == ".json":
        return _settings(path, name) if _SETTINGS.search(path.name) else None
    if suffix in _RECORDINGS:
        return _recording(path, name)
    from lidarcheck.formats.source import first_bytes

    start = first_bytes(path, 8192)
    if _LUT.search(start):
        from lidarcheck.formats.lut import load_lut

        load_lut(path)
        return Entry(path, "lut", name)
    if suffix in _TABLES:
        if "lut" in path.name.lower():
            raise InputError("the file has no blooming table", file=path, fix="it needs PostPro.LUT_blooming_X and _Y")
        return None
    return _scan(path, name, suffix, start)


def _scan(path: Path, name: str, suffix: str, start: bytes) -> Entry | None:
    if suffix == ".csv" and _PROFILE.match(start):
        return Entry(path, "profile", name)
    if suffix in (".parquet", ".pq"):
        with path.open("rb") as stream:  # its columns are named at its end
            stream.seek(max(path.stat().st_size - 65536, 0))
            start = stream.read()
    if _IDEAL.search(start):
        return Entry(path, "ideal", name)
    from lidarcheck.formats.recognise import FORMATS, recognise

    form = recognise(path)
    if form not in FORMATS:
        return None
    if form in ("text", "csv") and not _SCAN.search(start.split(b"\n", 1)[0]):
        return None  # notes, logs: a text like any other
    return Entry(path, "scan", name)


def _recording(path: Path, name: str) -> Entry:
    """By how it begins: what it holds is looked at by commands alone, as it may be large."""
    from lidarcheck.formats.field.recording import RECORDINGS
    from lidarcheck.formats.recognise import recognise

    if recognise(path) not in RECORDINGS:
        raise InputError("is no recording by its content", file=path, fix="is it whole?")
    return Entry(path, "recording", name)


def _settings(path: Path, name: str) -> Entry:
    from lidarcheck.formats.settings import load_settings

    load_settings(path)
    return Entry(path, "settings", name)


def _toml(path: Path, name: str) -> Entry | None:
    from lidarcheck.config.toml_text import toml_of
    from lidarcheck.formats.source import decode_text, read_source

    data = toml_of(decode_text(read_source(path), path), path)
    kind = "case" if path.name == _CASE else _kind_of_toml(data)
    return None if kind is None else Entry(path, kind, name)


def _kind_of_toml(data: dict[str, Any]) -> str | None:
    if "provenance" in data and "format" in data:
        return "golden"
    if "kpis" in data:
        return "scenario"
    if "frames" in data and "model" in data:
        return "case"
    if "variant" in data or "external" in data:
        return "model"
    return "scene" if "objects" in data else None
