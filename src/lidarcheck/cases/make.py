"""A case from files: each measured frame with its ideal scan, the model with all that it names, in one directory."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from lidarcheck.arrays import IndexArray
from lidarcheck.cases.case import CASE_FILE
from lidarcheck.cases.dataset import load_dataset
from lidarcheck.cases.source import FrameFile, ideal_of
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import save_ideal
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.geometry.placement import AS_IT_IS, POSE_NAMES, Placement
from lidarcheck.formats.recognise import FORMATS
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.model.files.model_file import load_model
from lidarcheck.reading import reading
from lidarcheck.sensor import Sensor
from lidarcheck.trust.program_text import module_files, program_files

__all__ = ["PARTS", "CaseFrame", "CaseKeys", "case_files", "frame_file", "frame_times", "parts_of"]

PARTS = ("fit", "select", "verify")
"""What frames are for, in the order of time."""
_MEASURED, _IDEAL = "measured", "ideal"

Writer = Callable[[Path], object]


@dataclass(frozen=True)
class CaseFrame:
    """A frame of a case that is made: `part`: what it is for, empty where the case leaves that to `explain`."""

    measured: FrameFile
    ideal: FrameFile
    time_s: float
    part: str = ""


@dataclass(frozen=True)
class CaseKeys:
    """What a case says of all its frames: how the measured files lie, and where the ideal scans come from.

    `origin`: the keys `ideals_from`, `pose_from`, `laws_from` and `repeats`, those that are said.
    """

    placement: Placement = AS_IT_IS
    origin: Mapping[str, Any] | None = None


def parts_of(counts: Sequence[int], frames: int) -> list[str]:
    """The part of each frame in the order of time: so many to fit, to select, to verify; `UsageError` for another
    number of frames."""
    if len(counts) != len(PARTS) or min(counts, default=0) < 1 or sum(counts) != frames:
        what = f"the parts {','.join(map(str, counts))} are not three numbers whose sum is {frames}"
        raise UsageError(what, fix="say how many frames are to fit, to select and to verify, in their order")
    return [part for part, count in zip(PARTS, counts, strict=True) for _ in range(count)]


def frame_times(frames: Sequence[FrameFile], sensor: Sensor, period_s: float | None = None) -> tuple[list[float], str]:
    """When each frame was measured [s], and how that is known: by the times that tell a file's frames apart, else one
    after another, `period_s` apart, by default as often as the sensor measures."""
    declared = _declared_times(frames)
    if declared is not None and period_s is None:
        return declared, "as the data set has them"
    timed = len(frames) > 1 and all(frame.frames.way == "time" for frame in frames)
    if timed and period_s is None:
        values = [float(frame.value or 0.0) for frame in frames]
        if values == sorted(set(values)):
            return [value - values[0] for value in values], "as their file has them"
    period = 1.0 / sensor.frame_rate_hz if period_s is None else period_s
    return [round(number * period, 9) for number in range(len(frames))], f"{period:g} s apart, in their order"


def _declared_times(frames: Sequence[FrameFile]) -> list[float] | None:
    """The times that a data set says of its frames; None where it does not say all of them."""
    files = {frame.declared.file for frame in frames if frame.declared is not None}
    if len(files) != 1 or any(frame.declared is None for frame in frames):
        return None
    times = [frame.time_s for frame in load_dataset(files.pop()).frames]
    known = [time for time in times if time is not None]
    return known if len(known) == len(frames) == len(times) else None


def case_files(frames: Sequence[CaseFrame], model: Path, keys: CaseKeys, *, link: bool = False) -> dict[str, Writer]:
    """The files of a case by their names in its directory, each with a function that writes it there.

    Files of one frame are copied as they are, or with `link` get a second name; frames of a file of several are written
    as Parquet. One ideal scan of several frames stands there once. The model brings the files that it names. The last
    is `case.toml`. `InputError` for a model that names files elsewhere.
    """
    files = _model_files(model, link)
    entries: list[dict[str, Any]] = []
    for frame in frames:
        entry: dict[str, Any] = {}
        for role, own in ((_IDEAL, frame.ideal), (_MEASURED, frame.measured)):
            entry[role] = _placed(files, role, own, link)
        entry["time"] = float(frame.time_s)
        if frame.part:
            entry["part"] = frame.part
        entries.append(entry | _placement(_declared(frame.measured, keys.placement)))
    document = {"model": model.name, **(keys.origin or {}), "frames": entries}
    text = tomli_w.dumps(document)
    return {name: write for name, (_, write) in files.items()} | {CASE_FILE: lambda path: write_text(path, text)}


_Files = dict[str, tuple[str, Writer]]
"""By name in the case: what is written there, told from others by a word, and who writes it."""


def frame_file(frame: FrameFile, *, link: bool = False) -> tuple[str, Writer]:
    """The name of a frame as a file of its own, and who writes that: as it is, or one of several as Parquet."""
    if len(frame.frames) == 1 and frame.recording is None:
        return frame.name, partial(_brought, frame.path, link)
    return f"{frame.stem}.parquet", partial(_written, frame)


def _placed(files: _Files, role: str, frame: FrameFile, link: bool) -> str:
    """The name of a frame's file in the case, which is added to the files unless it is there."""
    own, write = frame_file(frame, link=link)
    mask = frame.declared.mask if frame.declared is not None and role == _IDEAL else ()
    if len(mask):
        own, write = f"{frame.stem}.parquet", partial(_without_mask, frame, np.asarray(mask))
    name, source = f"{role}/{own}", f"{os.path.realpath(frame.path)}#{frame.index}"
    there = files.setdefault(name, (source, write))
    if there[0] != source:
        what = f"is named as {there[0].partition('#')[0]}"
        raise InputError(what, file=str(frame), fix="give the frames different names")
    return name


def _declared(frame: FrameFile, given: Placement) -> Placement:
    """How a measured file lies, as given or as a data set declares it; `InputError` for a unit of its own."""
    if frame.declared is None:
        return given
    if frame.declared.calibration is not None:
        fix = "make a case of each unit's frames, with a model whose variant is that unit's sensor file"
        raise InputError("was measured by a unit with a calibration of its own", file=str(frame), fix=fix)
    return frame.declared.placed(given)


def _without_mask(frame: FrameFile, mask: IndexArray, target: Path) -> None:
    """Write an ideal scan in which nobody knows what the masked beams meet, so that they are never judged."""
    target.parent.mkdir(parents=True, exist_ok=True)
    ideal = ideal_of(replace(frame, declared=None), frame.declared.own_sensor if frame.declared else None)
    masked = np.isin(beam_keys(ideal.layer, ideal.point), mask)
    save_ideal(replace(ideal, distance_m=np.where(masked, np.nan, ideal.distance_m)), target)


def _written(frame: FrameFile, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    FORMATS["parquet"].write(frame.read(), target)


def _brought(source: Path, link: bool, target: Path) -> None:
    """Copy a file, or give it a second name where the file system has such."""
    target.parent.mkdir(parents=True, exist_ok=True)
    real = os.path.realpath(source)
    if link:
        try:
            os.link(real, target)
        except OSError as error:
            fix = "leave out --link: the files are then copied"
            raise InputError(f"cannot get a second name: {error.strerror or error}", file=source, fix=fix) from error
        return
    try:
        shutil.copy(real, target)
    except OSError as error:
        raise InputError(f"cannot be copied: {error.strerror or error}", file=source, fix="is it there?") from error


def _model_files(model: Path, link: bool) -> _Files:
    """The model and the files that it names, a program with its text, at the same places from it as before."""
    with reading() as read:
        loaded = load_model(model)
    home = Path(os.path.realpath(model)).parent
    ours = Path(os.path.realpath(__file__)).parents[1]
    files: _Files = {}
    program: set[Path] = set()
    if loaded.external is not None:
        program = {*program_files(loaded.external), *module_files(loaded.external).values()}
        # An interpreter, or what else is named from the root, stays where it is.
        program -= {path for path in program if str(path) in loaded.external.command}
    for path in sorted({*map(Path, read.files), *(Path(os.path.realpath(path)) for path in program)}):
        if path.is_relative_to(ours) or not path.is_file():
            continue
        if not path.is_relative_to(home):
            fix = "move it beside the model, and name it there"
            raise InputError(f"the model names {path}, which is not below its folder", file=model, fix=fix)
        files[path.relative_to(home).as_posix()] = (str(path), partial(_brought, path, link))
    if CASE_FILE in files or model.name == CASE_FILE:
        raise InputError(f"the model needs a file {CASE_FILE}", file=model, fix="give it another name")
    return files


def _placement(placement: Placement) -> dict[str, Any]:
    """The keys by which a frame declares how its measured file lies."""
    keys: dict[str, Any] = {}
    if placement.unit != "m":
        keys["unit"] = placement.unit
    if placement.mirror:
        keys["mirror"] = placement.mirror
    if placement.pose is not None:
        keys["pose"] = dict(zip(POSE_NAMES, map(float, placement.pose), strict=True))
    return keys
