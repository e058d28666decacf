"""The frames of a request as they were read: scans, and what their beams met."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.calibration.number.found_target import ideal_of_target
from lidarcheck.calibration.number.request import Request
from lidarcheck.cases.case import load_case
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.partners import beside
from lidarcheck.cases.source import FrameFile, each_frame, ideal_of, scan_of
from lidarcheck.cases.split import split_frames
from lidarcheck.errors import InputError
from lidarcheck.formats.table import counted
from lidarcheck.inference.observed.echo_view import EchoView, Slot
from lidarcheck.kpi.fired import judged_beams
from lidarcheck.kpi.variant import check_variant
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.reading import state_of_file
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["Frames", "hash_of", "key_of_files", "read_frames", "seen_slots"]


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of one measurement, with the surfaces of their ideal scans. `key`: a hash of the files and of how they are
    read; `name`: of the first, for messages."""

    frames: tuple[Frame, ...]
    surfaces: tuple[Surfaces, ...]
    key: str
    name: str


def hash_of(value: Any) -> str:
    """A hash of numbers, arrays and dataclasses of them, by what they hold."""
    digest = hashlib.sha256(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update("".join(hash_of(getattr(value, f.name)) for f in fields(value)).encode())
    else:
        digest.update(repr(value).encode())
    return digest.hexdigest()


def key_of_files(paths: Sequence[Path], *more: object) -> str:
    """A hash of files by their names, sizes and times, and of what else is said."""
    states = [(os.path.realpath(path), state_of_file(path)) for path in paths]
    return hashlib.sha256(repr((states, more)).encode()).hexdigest()


def read_frames(request: Request, model: Model, key: str = "") -> Frames:
    """The frames of a request; `InputError` names the file that cannot be used, or has no ideal scan where one is
    needed."""
    if request.case is not None:
        case = load_case(request.case)
        verified = split_frames(case.frames).verify.look()
        return Frames(verified, tuple(Surfaces(frame.ideal) for frame in verified), key, str(request.case))
    groups, sensor = each_frame(request.measured), model.sensor
    files = [frame for group in groups for frame in group]
    partners = _partners(request, groups, sensor)
    found = []
    for number, (file, other) in enumerate(zip(files, partners, strict=True)):
        scan = scan_of(file, request.placement, sensor)
        check_variant(scan, sensor, str(file))
        if other is None:
            found.append(Frame(number, ideal_of_target(scan, model, request, str(file)), scan, 0.1 * number))
            continue
        ideal, scan = judged_beams(ideal_of(other, sensor), scan.take((scan.layer >= 0) & (scan.point >= 0)))
        found.append(Frame(number, ideal, scan, 0.1 * number))
    surfaces = {id(frame.ideal): Surfaces(frame.ideal) for frame in found}
    return Frames(tuple(found), tuple(surfaces[id(f.ideal)] for f in found), key, str(files[0]))


def _partners(request: Request, groups: Sequence[Sequence[FrameFile]], sensor: Sensor) -> Sequence[FrameFile | None]:
    """The ideal scan of each frame; None where the target is found in the scan itself."""
    count = sum(len(group) for group in groups)
    if not request.ideal and request.kind == "misfit" and isinstance(sensor, SpadArray):
        return [None] * count
    if not request.ideal:
        what = "has no ideal scan: what its beams met is not known, and nothing can be simulated"
        raise InputError(what, file=groups[0][0].path, fix="make one: lidarcheck ideal, or name it")
    found = beside(groups, each_frame(request.ideal, "ideal"), "ideal")
    found = found * count if len(found) == 1 else found
    if len(found) != count:
        what = f"{counted(count, 'frame')} and {counted(len(found), 'ideal scan')}"
        raise InputError(what, file=groups[0][0].path, fix="give one ideal scan for each frame, or one for all")
    return found


def seen_slots(frames: Sequence[Frame], sensor: Sensor) -> tuple[Slot, ...]:
    """The features that are compared: those of the sensor that every measured scan has."""
    slots = [slot for slot in EchoView.of(sensor).slots if slot.name]
    return tuple(slot for slot in slots if all(_has(frame, slot) for frame in frames))


def _has(frame: Frame, slot: Slot) -> bool:
    scan = frame.measured
    return scan.histograms is not None if slot.bins is not None else slot.name in scan.feature_names
