"""The frames that a command is given: files, files of several frames, folders, patterns; and which belong together.

A scan may be named by a file, a file of several frames (`formats.frames` tells them apart), a folder with a frame a
file, or a pattern such as `drive/*.pcd`. Frames of several sources are paired by name, else by number, time or order.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.frames import Frames, SeveralFrames, frames_of, one_frame
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.ideals import ideal_from_table
from lidarcheck.formats.recognise import FORMATS, read_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.table import Table
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = [
    "FrameFile",
    "Named",
    "PathLike",
    "each_frame",
    "files_in",
    "frames_in",
    "frames_of_file",
    "ideal_of",
    "natural",
    "scan_of",
]

PathLike = str | os.PathLike[str]
SUFFIXES = tuple(suffix for form in FORMATS.values() for suffix in form.suffixes)
BESIDE = (".toml", ".json", ".ini", ".md", ".html", ".png", ".jpg", ".jpeg", ".svg", ".pdf")
"""What people and lidarcheck keep beside frames: descriptions, settings, results, pictures."""
PATTERN = "*?["
MOST_LOOKED_INTO = 8
"""So many files named one by one are looked into for several frames, and kept in memory until they are used; of more,
each is one frame, and is refused when it is read and is not: to read a thousand files twice takes too long."""


@dataclass(frozen=True, eq=False)
class FrameFile:
    """A frame: a file of its own, or with `frames` the one of number `index` in a file of several.

    `held`: the file's table, where it was read already; of a file of its own it is handed out once.
    """

    path: Path
    frames: Frames = field(default_factory=Frames)
    index: int = 0
    held: list[Table] = field(default_factory=list, repr=False)

    def __fspath__(self) -> str:
        return str(self.path)

    def __str__(self) -> str:
        return f"{self.path}#{self.label}" if len(self.frames) > 1 else str(self.path)

    @property
    def label(self) -> int:
        """The frame's number in a file of several: the file's own, else counted from 0."""
        return self.frames.labels()[self.index]

    @property
    def stem(self) -> str:
        """The name without suffix; in a file of several with the frame's number, as `split` names it."""
        return f"{self.path.stem}_{self.label:06d}" if len(self.frames) > 1 else self.path.stem

    @property
    def name(self) -> str:
        """The name, as `stem`, with the file's suffix."""
        return f"{self.stem}{self.path.suffix}"

    @property
    def value(self) -> float | None:
        """The value of the column that tells the frame apart, of times its first one; None where none does."""
        return self.frames.values[self.index] if self.frames.values else None

    @property
    def how(self) -> str:
        """How the frames of the file were told apart, in words."""
        return self.frames.how

    def read(self) -> Table:
        """The frame's rows. `InputError` where the file cannot be read, or holds several frames unasked."""
        if len(self.frames) > 1:
            return self.frames.take(self.held[0], self.index)
        return self.held.pop() if self.held else one_frame(read_table(self.path))


Named = FrameFile | Path
"""A frame as functions take it that read it: a path is a file of one frame."""


def scan_of(frame: FrameFile | PathLike, placement: Placement = AS_IT_IS, sensor: Sensor | None = None) -> Scan:
    """The echoes of a frame, placed as declared; `sensor`: what measured, a built-in one where None."""
    return scan_from_table(_table(frame), placement, sensor)


def ideal_of(frame: FrameFile | PathLike, sensor: Sensor | None = None) -> IdealScan:
    """The ideal scan of a frame; `sensor`: whose beams they are, a built-in one's where None."""
    table = _table(frame)
    return ideal_from_table(ideal_table(table, sensor) if is_semantic(table) else table, sensor)


def _table(frame: FrameFile | PathLike) -> Table:
    return frame.read() if isinstance(frame, FrameFile) else one_frame(read_table(frame))


def files_in(*given: PathLike) -> list[Path]:
    """The files that are named: by themselves, by a folder, or by a pattern; none of them read."""
    return [file for one in given for file in _files(Path(one))]


def frames_in(given: PathLike) -> list[FrameFile]:
    """The frames of a file, which may hold several, of a folder or of a pattern, in their order."""
    return each_frame([given])[0]


def each_frame(given: Iterable[PathLike]) -> list[list[FrameFile]]:
    """The frames of each thing that is named, as `frames_in` gives them."""
    places = [Path(one) for one in given]
    files = [_files(place) for place in places]
    alone = [found == [place] for place, found in zip(places, files, strict=True)]
    look = sum(alone) <= MOST_LOOKED_INTO
    return [
        _looked_into(found[0]) if single and look else [FrameFile(file) for file in found]
        for found, single in zip(files, alone, strict=True)
    ]


def frames_of_file(file: Path, by: str | None = None) -> list[FrameFile]:
    """The frames of a file, which is read for it; `by`: what tells them apart, as `formats.frames.frames_of` has it."""
    held = [read_table(file)]
    frames = frames_of(held[0], by)
    return [FrameFile(file, frames, index, held) for index in range(len(frames))]


def _looked_into(file: Path) -> list[FrameFile]:
    """The frames of a file; what is wrong with it is for its reader to say, behind what is wrong with the command."""
    try:
        return frames_of_file(file)
    except SeveralFrames:
        raise
    except InputError:
        return [FrameFile(file)]


def natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sorts names as people count: frame_2 before frame_10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (0, part.casefold()) for part in parts], path.name


def _files(place: Path) -> list[Path]:
    if place.is_dir():
        return _in_folder(place)
    if not place.exists() and set(PATTERN) & set(str(place)):
        start = Path(place.anchor)
        files = sorted((file for file in start.glob(str(place.relative_to(start))) if file.is_file()), key=natural)
        if not files:
            raise InputError("no file matches", file=place, fix="check the pattern and the directory")
        return files
    return [place]


def _in_folder(folder: Path) -> list[Path]:
    """The folder's scans in the order of their numbers; what is neither scan nor known beside scans is refused."""
    try:
        there = sorted((file for file in folder.iterdir() if not file.name.startswith(".")), key=natural)
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror or error}", file=folder, fix="check its permissions"
        ) from error
    found: dict[str, Path] = {}
    for file in there:
        suffix = file.suffix.lower()
        if file.is_dir() or suffix in BESIDE:
            continue
        if suffix not in SUFFIXES:
            fix = f"take it out of the folder, or name a pattern, as '{folder / '*.pcd'}'"
            raise InputError("stands among frames and is no scan by its name", file=file, fix=fix)
        if other := found.get(file.stem):
            raise InputError(f"is named as {other.name}", file=file, fix="keep one of the two")
        found[file.stem] = file
    if not found:
        raise InputError("holds no frame", file=folder, fix=f"name a folder of {', '.join(SUFFIXES)} files")
    return list(found.values())
