"""The frames that a command is given: files, recordings, folders, patterns, data sets; and which belong together.

A scan may be named by a file, a file of several frames (`formats.frames` tells them apart), a bag or trace as
`FILE#TOPIC`, whose frames are read one by one, a folder with a frame a file, a pattern such as `drive/*.pcd`, or a data
set. Frames of several sources are paired by name, else by number, time or order.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from lidarcheck.cases.dataset import Declared, dataset_file, load_dataset
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.field.place import named
from lidarcheck.formats.field.recording import RECORDING_SUFFIXES, RECORDINGS, Recording, open_recording
from lidarcheck.formats.frames import Frames, SeveralFrames, frames_of, one_frame
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.ideals import ideal_from_table
from lidarcheck.formats.recognise import FORMATS, read_table, recognise
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.table import Table
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = [
    "FrameFile",
    "Named",
    "PathLike",
    "Role",
    "each_frame",
    "files_in",
    "frames_in",
    "frames_of_file",
    "how_of",
    "ideal_of",
    "natural",
    "scan_of",
    "without_masked",
]

PathLike = str | os.PathLike[str]
Role = Literal["measured", "ideal"]
"""What a data set is asked for."""
SUFFIXES = tuple(suffix for form in FORMATS.values() for suffix in form.suffixes)
ALL_SUFFIXES = (*SUFFIXES, *RECORDING_SUFFIXES)
_OF_MANY = tuple(suffix for suffix in RECORDING_SUFFIXES if suffix != ".bin")
"""Of files that are opened to see their frames, however many files there are."""
BESIDE = (".toml", ".yaml", ".yml", ".json", ".ini", ".md", ".html", ".png", ".jpg", ".jpeg", ".svg", ".pdf")
"""What people and lidarcheck keep beside frames: descriptions, settings, results, pictures."""
PATTERN = "*?["
MOST_LOOKED_INTO = 8
"""So many files named one by one are looked into for several frames, and kept in memory until they are used; of more,
each is one frame, and is refused when it is read and is not: to read a thousand files twice takes too long."""


@dataclass(frozen=True, eq=False)
class FrameFile:
    """A frame: a file of its own, or with `frames` the one of number `index` in a file of several.

    `held`: the file's table, where it was read already; of a file of its own it is handed out once. `recording`: whose
    frame it is, read when it is asked for. `declared`: what a data set says of it.
    """

    path: Path
    frames: Frames = field(default_factory=Frames)
    index: int = 0
    held: list[Table] = field(default_factory=list, repr=False)
    recording: Recording | None = field(default=None, repr=False)
    declared: Declared | None = None

    def __fspath__(self) -> str:
        return str(self.path)

    def __str__(self) -> str:
        if self.recording is not None and len(self.frames) > 1:
            return self.recording.named(self.index)
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

    def time_ns(self, number: int) -> int:
        """When the frame was measured [ns]: a recording's time since 1970, else its own, else a tenth of a second a
        frame.
        """
        start = 0 if self.recording is None else self.recording.start_ns
        time_s = self.value if self.frames.way == "time" else None
        return start + round(1e9 * (0.1 * number if time_s is None else time_s))

    def read(self) -> Table:
        """The frame's rows. `InputError` where the file cannot be read, or holds several frames unasked."""
        if self.recording is not None:
            return self.recording.read(self.index)
        if len(self.frames) > 1:
            return self.frames.take(self.held[0], self.index)
        return self.held.pop() if self.held else one_frame(read_table(self.path))


Named = FrameFile | Path
"""A frame as functions take it that read it: a path is a file of one frame."""


def scan_of(frame: FrameFile | PathLike, placement: Placement = AS_IT_IS, sensor: Sensor | None = None) -> Scan:
    """The echoes of a frame, placed as declared; `sensor`: what measured, a built-in one where None.

    What a data set declares of the frame holds: its placement, the unit that measured, and its mask.
    """
    return without_masked(frame, scan_from_table(_table(frame), *how_of(frame, placement, sensor)))


def how_of(
    frame: FrameFile | PathLike, placement: Placement = AS_IT_IS, sensor: Sensor | None = None
) -> tuple[Placement, Sensor | None]:
    """How a frame lies and what measured it: as given, or as a data set declares it."""
    declared = frame.declared if isinstance(frame, FrameFile) else None
    return (placement, sensor) if declared is None else (declared.placed(placement), declared.sensor(sensor))


def without_masked(frame: FrameFile | PathLike, scan: Scan) -> Scan:
    """Another scan, as a simulated one, without the beams that a data set masks in a measured frame."""
    declared = frame.declared if isinstance(frame, FrameFile) else None
    return scan if declared is None else declared.scan(scan)


def ideal_of(frame: FrameFile | PathLike, sensor: Sensor | None = None) -> IdealScan:
    """The ideal scan of a frame; `sensor`: whose beams they are, a built-in one's where None."""
    table, declared = _table(frame), frame.declared if isinstance(frame, FrameFile) else None
    if declared is not None:
        sensor = declared.sensor(sensor)
    ideal = ideal_from_table(ideal_table(table, sensor) if is_semantic(table) else table, sensor)
    return ideal if declared is None else declared.ideal(ideal)


def _table(frame: FrameFile | PathLike) -> Table:
    return frame.read() if isinstance(frame, FrameFile) else one_frame(read_table(frame))


def files_in(*given: PathLike) -> list[Path]:
    """The files that are named: by themselves, by a folder, a pattern or a data set; none of the frames read."""
    return [named(file).file for one in given for file in _files(Path(one))]


def frames_in(given: PathLike, role: Role = "measured") -> list[FrameFile]:
    """The frames of a file or recording, which may hold several, of a folder, a pattern or a data set, in their order.

    `role`: which frames of a data set are meant.
    """
    return each_frame([given], role)[0]


def each_frame(given: Iterable[PathLike], role: Role = "measured") -> list[list[FrameFile]]:
    """The frames of each thing that is named, as `frames_in` gives them."""
    places = [Path(one) for one in given]
    sets = [dataset_file(place) for place in places]
    files = [[] if own else _files(place) for place, own in zip(places, sets, strict=True)]
    alone = [found == [place] for place, found in zip(places, files, strict=True)]
    look = sum(alone) <= MOST_LOOKED_INTO
    found: list[list[FrameFile]] = []
    for own, named_files, single in zip(sets, files, alone, strict=True):
        if own is not None:
            found.append(_of_dataset(own, role))
        elif single and look:
            found.append(_looked_into(named_files[0]))
        else:
            found.append([frame for file in named_files for frame in _unread(file)])
    return found


def _unread(file: Path) -> list[FrameFile]:
    """The frames of one of many files: of a recording all, of any other file the one that it should hold."""
    return _recorded(file) if named(file).file.suffix.lower() in _OF_MANY else [FrameFile(file)]


def _recorded(file: Path) -> list[FrameFile]:
    """The frames of a recording, or the one that is named; none of them read."""
    recording, one = open_recording(file, recognise(file)), named(file).frame
    count, times = len(recording), recording.times_s
    if one is not None and one >= count:
        what = f"has no frame {one}: it holds {count}"
        raise InputError(what, file=recording.path, fix=f"name one of 0 to {count - 1}")
    way, column = ("time", "the message's time") if times else ("order", "")
    frames = Frames((None,) * count, way, column, times or ()) if count > 1 else Frames()
    numbers = range(count) if one is None else [one]
    return [FrameFile(recording.path, frames, number, recording=recording) for number in numbers]


def _of_dataset(file: Path, role: Role) -> list[FrameFile]:
    """The measured frames of a data set, or their ideal scans, each with what is declared of it."""
    known: dict[Path, list[FrameFile]] = {}
    found = []
    for frame in load_dataset(file).frames:
        place = frame.measured if role == "measured" else frame.ideal
        if place is None:
            fix = f"give frame {frame.number} an `ideal`"
            raise InputError(f"frame {frame.number} names no ideal scan", file=file, fix=fix)
        own = _one_of(place, known)
        declared = frame.declared
        if role == "ideal":
            declared = replace(declared, placement=AS_IT_IS)
        found.append(replace(own, declared=declared))
    return found


def _one_of(place: Path, known: dict[Path, list[FrameFile]]) -> FrameFile:
    """The frame that a data set names: a file's only one, or one of a recording, which is opened once."""
    parts = named(place)
    if parts.frame is None and parts.file.suffix.lower() not in _OF_MANY:
        return FrameFile(place)
    whole = Path(str(parts._replace(frame=None)))
    frames = known.setdefault(whole, known.get(whole) or _recorded(whole))
    if parts.frame is None and len(frames) > 1:
        fix = f"name one, as '{frames[0]}'"
        raise SeveralFrames(f"holds {len(frames)} frames, where one is wanted", file=place, fix=fix)
    number = parts.frame or 0
    if number >= len(frames):
        fix = f"name one of 0 to {len(frames) - 1}"
        raise InputError(f"has no frame {number}: it holds {len(frames)}", file=parts.file, fix=fix)
    return frames[number]


def frames_of_file(file: Path, by: str | None = None) -> list[FrameFile]:
    """The frames of a file, which is read for it; `by`: what tells them apart, as `formats.frames.frames_of` has it.

    Frames of a recording are its messages, and none of them is read.
    """
    if recognise(file) in RECORDINGS:
        if by is not None:
            raise UsageError("--by tells rows of one table apart, and a recording has its frames", fix="leave --by out")
        return _recorded(file)
    held = [read_table(file)]
    frames = frames_of(held[0], by)
    return [FrameFile(file, frames, index, held) for index in range(len(frames))]


def _looked_into(file: Path) -> list[FrameFile]:
    """The frames of a file; what is wrong with it is for its reader to say, behind what is wrong with the command."""
    if named(file).file.suffix.lower() in _OF_MANY:
        return _recorded(file)
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
    own = dataset_file(place)
    if own is not None:
        frames = load_dataset(own).frames
        named_files = [path for frame in frames for path in (frame.measured, frame.ideal) if path is not None]
        return list(dict.fromkeys([own, *(named(path).file for path in named_files)]))
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
        if suffix not in ALL_SUFFIXES:
            fix = f"take it out of the folder, or name a pattern, as '{folder / '*.pcd'}'"
            raise InputError("stands among frames and is no scan by its name", file=file, fix=fix)
        if other := found.get(file.stem):
            raise InputError(f"is named as {other.name}", file=file, fix="keep one of the two")
        found[file.stem] = file
    if not found:
        raise InputError("holds no frame", file=folder, fix=f"name a folder of {', '.join(SUFFIXES)} files")
    return list(found.values())
