"""Writing a data set's file from what a folder holds: distances, classes and repeats out of the files' names.

`sign_25m_r2.pcd` is a sign at 25 m, repeat 2; `panel_10.5m_ideal.txt` is the ideal scan of `panel_10.5m.pcd`. Each
frame of a bag or trace is a frame of its own, at its time. What a name does not say is left out, for a person to
add.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import tomli_w

from lidarcheck.errors import InputError
from lidarcheck.formats.field.place import Named
from lidarcheck.formats.field.recording import RECORDING_SUFFIXES, RECORDINGS, Recording, open_recording
from lidarcheck.formats.recognise import FORMATS, recognise

__all__ = ["FoundFrame", "ScannedFolder", "scan_folder"]

_SCANS = tuple(suffix for form in FORMATS.values() for suffix in form.suffixes)
_MANY = tuple(suffix for suffix in RECORDING_SUFFIXES if suffix != ".bin")
_DISTANCE = re.compile(r"(?<![\d.])(\d{1,4}(?:[.p]\d{1,3})?)[ _-]?m(?![a-z0-9])", re.IGNORECASE)
_REPEAT = re.compile(r"(?:^|[_\- .])(?:r|rep|repeat|run|take|frame|f|scan)?[_-]?(\d{1,6})$", re.IGNORECASE)
_IDEAL = re.compile(r"(?:^|[_\- .])(?:ideal|postpro|truth|gt)(?=$|[_\- .])", re.IGNORECASE)
_LEFT = re.compile(r"^(?:r|rep|repeat|run|take|frame|f|scan|measured|real|cloud|points?)?$", re.IGNORECASE)
_MOST_FRAMES = 100_000


@dataclass(frozen=True)
class FoundFrame:
    """A frame as its file's name tells it; `measured`, `ideal`: relative to the folder."""

    measured: str
    distance_m: float | None = None
    kind: str = ""
    repeat: int | None = None
    ideal: str = ""
    time_s: float | None = None


@dataclass(frozen=True)
class ScannedFolder:
    """`frames` in order; `topics`: of bags with several, what there is beside the one that was taken.

    `left_out`: files that are no scans by their names, or cannot be opened, and why.
    """

    folder: Path
    frames: tuple[FoundFrame, ...]
    topics: tuple[str, ...] = ()
    left_out: tuple[str, ...] = field(default=())

    def text(self, sensor: str = "", model: str = "") -> str:
        """The file, with a comment where a person has to look."""
        lines = [
            "# Written from the names of the files; correct it by hand. Paths start from this file's folder.",
            "[dataset]",
            f"sensor = {_quoted(sensor)}" if sensor else '# sensor = "HDL-32E"  # a shipped sensor, or a sensor file',
            f"model = {_quoted(model)}" if model else '# model = "model.toml"  # its variant must be the sensor',
            '# mask = "mask.csv"  # Layer,Point of beams that see the carrier itself',
            "",
            "# A frame may also say: unit, mirror, pose = {x_m = 0.0, y_m = 0.0, z_m = 0.0, roll_deg = 0.0,",
            "# pitch_deg = 0.0, yaw_deg = 0.0}, and calibration, the file of the unit that measured.",
        ]
        lines += [f"# Not taken: {text}" for text in (*self.topics, *self.left_out)]
        for frame in self.frames:
            lines += ["", "[[frames]]", f"measured = {_quoted(frame.measured)}"]
            if frame.ideal:
                lines.append(f"ideal = {_quoted(frame.ideal)}")
            if frame.distance_m is not None:
                lines.append(f"distance_m = {frame.distance_m!r}")
            if frame.kind:
                lines.append(f"class = {_quoted(frame.kind)}")
            if frame.time_s is not None:
                lines.append(f"time = {round(frame.time_s, 9)!r}")
            if frame.repeat is not None:
                lines.append(f"repeat = {frame.repeat}")
        return "\n".join(lines) + "\n"


def scan_folder(folder: Path, pattern: str = "") -> ScannedFolder:
    """What a folder and those below it hold. `pattern`: of the files' paths, as `*.pcd`; hidden folders are left out.

    `InputError` where there is no scan.
    """
    files = [path for path in _below(folder) if not pattern or path.match(pattern)]
    scans = [path for path in files if path.suffix.lower() in _SCANS and not _IDEAL.search(path.stem)]
    ideals = {_core(path): path for path in files if path.suffix.lower() in _SCANS and _IDEAL.search(path.stem)}
    frames = [_of_name(path, folder, ideals) for path in scans]
    topics: list[str] = []
    left_out: list[str] = []
    for path in files:
        if path.suffix.lower() == ".bin":
            frames.append(_of_name(path, folder, ideals))
        elif path.suffix.lower() in _MANY:
            frames += _of_recording(path, folder, ideals, topics, left_out)
        if len(frames) > _MOST_FRAMES:
            raise InputError(f"holds more than {_MOST_FRAMES} frames", file=folder, fix="scan a part of it")
    if not frames:
        known = ", ".join((*_SCANS, *RECORDING_SUFFIXES))
        said = f": {left_out[0]}" if left_out else ""
        raise InputError(f"holds no scan{said}", file=folder, fix=f"name a folder of {known}")
    return ScannedFolder(folder, _with_repeats(frames), tuple(topics), tuple(left_out))


def _quoted(text: str) -> str:
    """A text as TOML has it."""
    return tomli_w.dumps({"k": text}).strip().removeprefix("k = ")


def _below(folder: Path) -> list[Path]:
    """The files of a folder and of those below it, in order of their names; links to folders are not followed."""
    from lidarcheck.cases.source import natural

    found: list[Path] = []
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        own = [Path(place) / name for name in files if not name.startswith(".")]
        found += sorted(own, key=natural)
    return found


def _core(path: Path) -> str:
    """A name without what says that it is an ideal scan; what a scan and its ideal scan share."""
    stem = _IDEAL.sub("", path.stem)
    return str(path.parent / re.sub(r"(?:^|[_\- .])(?:measured|real)(?=$|[_\- .])", "", stem, flags=re.IGNORECASE))


def _of_name(path: Path, folder: Path, ideals: dict[str, Path]) -> FoundFrame:
    """What a name tells: a length in metres, a number at its end, and the words that are left, else the folder's."""
    stem = path.stem
    distance = _DISTANCE.search(stem)
    rest = _DISTANCE.sub("", stem, count=1).strip("_- .")
    number = _REPEAT.search(rest)
    words = re.sub(r"[_\- .]+", "_", (rest[: number.start()] if number else rest)).strip("_")
    words = re.sub(r"_?(?:measured|real)$", "", words, flags=re.IGNORECASE)
    if _LEFT.match(words):
        words = path.parent.name if path.parent != folder else ""
    core = _core(path)
    ideal = ideals.get(core) or ideals.get(_REPEAT.sub("", core))
    return FoundFrame(
        path.relative_to(folder).as_posix(),
        float(distance[1].replace("p", ".")) if distance else None,
        words,
        int(number[1]) if number else None,
        "" if ideal is None else ideal.relative_to(folder).as_posix(),
    )


def _of_recording(
    path: Path, folder: Path, ideals: dict[str, Path], topics: list[str], left_out: list[str]
) -> list[FoundFrame]:
    """The frames of a bag or trace, of each of its topics."""
    own = _of_name(path, folder, ideals)
    try:
        kind = recognise(path)
        if kind not in RECORDINGS:
            raise InputError("is no recording by its content", file=path)
        recordings = _opened(path, kind)
    except InputError as error:
        left_out.append(f"{own.measured}: {error.what}")
        return []
    if len(recordings) > 1:
        first, *others = recordings
        topics.extend(f"{own.measured}#{one.topic} ({len(one)} frames)" for one in others)
        recordings = [first]
    recording = recordings[0]
    times = recording.times_s or (None,) * len(recording)
    return [
        replace(own, measured=str(Named(Path(own.measured), recording.topic, number)), repeat=number, time_s=time_s)
        for number, time_s in enumerate(times)
    ]


def _opened(path: Path, kind: str) -> list[Recording]:
    """The recording of each topic with point clouds, the one with most frames first."""
    if kind not in ("mcap", "rosbag", "db3"):
        return [open_recording(path, kind)]
    from lidarcheck.formats.field.bags import open_container
    from lidarcheck.formats.field.container import CLOUD, CUSTOM

    found = open_container(path, kind).of_kind(CLOUD, CUSTOM)
    if len(found) < 2:
        return [open_recording(path, kind)]
    opened = [open_recording(str(Named(path, topic.name)), kind) for topic in found]
    return sorted(opened, key=len, reverse=True)


def _with_repeats(frames: Sequence[FoundFrame]) -> tuple[FoundFrame, ...]:
    """Repeats from 0 within what has one distance and class, where numbers tell the frames apart; else none."""
    groups: dict[tuple[float | None, str], list[FoundFrame]] = {}
    for frame in frames:
        groups.setdefault((frame.distance_m, frame.kind), []).append(frame)
    found: dict[str, int | None] = {}
    for group in groups.values():
        numbers = [frame.repeat for frame in group]
        told = None not in numbers and max(Counter(numbers).values()) == 1 and len(group) > 1
        order = sorted(group, key=lambda frame: frame.repeat or 0) if told else group
        found |= {frame.measured: number if told else None for number, frame in enumerate(order)}
    return tuple(replace(frame, repeat=found[frame.measured]) for frame in frames)
