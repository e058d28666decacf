"""A case: measured frames, what their beams met, and the model that should explain them; checked before any fitting."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from lidarcheck.beams import Geometry
from lidarcheck.cases.checks import compared_scene, frame_fault, swapped
from lidarcheck.cases.frame import FEWEST_FRAMES, Frame
from lidarcheck.cases.origin import CAST, Origin, OriginKeys, Part, origin_faults, origin_of
from lidarcheck.cases.weak_rays import without_weak_rays
from lidarcheck.config.schema import LineIndex, PathText, validate
from lidarcheck.errors import ConfigError, InputError, LidarcheckError
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.field.place import named
from lidarcheck.formats.frames import SeveralFrames, one_frame
from lidarcheck.formats.geometry import pooled, words
from lidarcheck.formats.geometry.keys import PlacementKeys
from lidarcheck.formats.ideals import ideal_from_table, is_ideal
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.table import Table
from lidarcheck.kpi.fired import judged_beams
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.kpi.variant import other_variant
from lidarcheck.model.external.reads import readied
from lidarcheck.model.files.model_file import load_model
from lidarcheck.model.light import surface_signal
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor, SpadArray
from lidarcheck.trust.places import check_place, named_file
from lidarcheck.trust.program_text import module_files, named_paths

__all__ = ["CASE_FILE", "FEWEST_FRAMES", "Case", "case_model", "load_case"]

CASE_FILE = "case.toml"
MOST_DAMAGED = 1.0 / 3.0
"""Share of the frames that may be damaged before a case is refused."""
UNKNOWN_BEAMS = 0.05
"""Share of echoes outside the field of view that are dropped with a warning; more is damage."""

_log = logging.getLogger(__name__)


class _FrameTable(PlacementKeys):
    ideal: PathText
    measured: PathText
    time: float = Field(json_schema_extra={"unit": "s"})
    part: Literal["fit", "select", "verify"] | None = None


class _CaseTable(OriginKeys):
    model: PathText
    frames: tuple[_FrameTable, ...] = ()

    @property
    def parts(self) -> tuple[Part, ...]:
        """What each frame is for, empty where it does not say."""
        return tuple(frame.part or "" for frame in self.frames)


@dataclass(frozen=True)
class Case:
    """What `load_case` found. `frames`: those that can be used, `number` as they stand in the file, from 0.

    `left_out`: damaged frames by "frame NUMBER", and why. `hashes`: SHA-256 of every file that was read, by its path
    relative to `directory`. `origin`: where the ideal scans come from.
    """

    directory: Path
    model: Model
    model_file: Path
    frames: tuple[Frame, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)
    hashes: Mapping[str, str] = field(default_factory=dict)
    origin: Origin = CAST

    @property
    def geometry(self) -> Geometry:
        """How X, Y, Z agree with the beams, in all frames together."""
        return pooled(frame.measured.geometry for frame in self.frames)

    @property
    def geometry_words(self) -> str:
        """What is said of it, and what the ranges of which frames cannot tell apart from as they are."""
        untold = dict.fromkeys(variant for frame in self.frames for variant in frame.untold)
        said = [words(self.geometry)]
        for variant in untold:
            numbers = ", ".join(str(frame.number) for frame in self.frames if variant in frame.untold)
            said.append(f"not told apart from {variant}: frames {numbers}")
        return "; ".join(said)

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that the case consists of."""
        return tuple(self.directory / name for name in self.hashes)


def load_case(directory: str | os.PathLike[str], *, fewest: int = FEWEST_FRAMES) -> Case:
    """Read a case: a directory with `case.toml`, or that file; everything that can be checked without a fit is.

    A damaged frame is left out with a warning, as long as no more than a third are and `fewest` remain. `InputError` or
    `ConfigError` for all else: other beams than the ideal scan's, swapped or doubled files, the other variant's
    measurement, materials without an entry, too few frames, columns that are missing. What somebody else's program
    reads is found out; `ExternalModelError` where it is not trusted or fails.
    """
    file = _case_file(Path(directory))
    data, lines = parse_toml(file)
    table = validate(data, lines, _CaseTable)
    _check_places(table, lines, fewest)
    model_file = file.parent / table.model
    model = load_model(model_file)
    hashes = _hashes(file.parent, table, model)
    _check_doubles(table, lines, hashes)
    frames, faults = _frames(file.parent, table, lines, model)
    _check_enough(file, len(table.frames), frames, faults, fewest)
    model = readied(model, [frame.ideal for frame in frames])
    _check_together(table, lines, frames, model)
    left_out = {f"frame {number}": _reason(fault) for number, fault in sorted(faults.items())}
    for name, why in left_out.items():
        _log.warning("%s is left out: %s", name, why)
    return Case(file.parent, model, model_file, tuple(frames), left_out, hashes, origin_of(table, table.parts))


def case_model(directory: str | os.PathLike[str], *, fewest: int = FEWEST_FRAMES) -> Path:
    """The model's file of a case, of which only `case.toml` and the model are read; raises as `load_case` does."""
    file = _case_file(Path(directory))
    data, lines = parse_toml(file)
    table = validate(data, lines, _CaseTable)
    _check_places(table, lines, fewest)
    load_model(file.parent / table.model)
    return file.parent / table.model


def _case_file(place: Path) -> Path:
    if place.is_dir():
        file = place / CASE_FILE
        if not file.exists():
            fix = f"write {CASE_FILE} with `model` and a [[frames]] of `ideal`, `measured`, `time` for each frame"
            raise InputError(f"the directory has no {CASE_FILE}", file=place, fix=fix)
        check_place(file, file)
        return file
    if place.exists() and place.suffix.lower() != ".toml":
        raise InputError("is not a case", file=place, fix=f"name a directory that holds {CASE_FILE}")
    return place


def _check_places(table: _CaseTable, lines: LineIndex, fewest: int) -> None:
    """Paths lead into the directory; there are frames enough; none stands twice."""
    faults = [] if (fault := _outside(table.model, ("model",), lines)) is None else [fault]
    first: dict[str, int] = {}
    for i, frame in enumerate(table.frames):
        own = (_outside(getattr(frame, key), ("frames", i, key), lines) for key in ("ideal", "measured"))
        faults += [fault for fault in own if fault is not None]
        ideal, measured = (os.path.normpath(path) for path in (frame.ideal, frame.measured))
        if ideal == measured:
            what = f"frame {i} names {measured} both as ideal and as measured"
            faults.append(lines.fault(("frames", i, "measured"), what, fix="name the scan of that frame"))
        if measured in first:
            what = f"frame {i} names {measured} as measured, as frame {first[measured]} does"
            faults.append(lines.fault(("frames", i, "measured"), what, fix="every frame is a measurement of its own"))
        first.setdefault(measured, i)
    faults += origin_faults(table, table.parts, lines, split=fewest > 2)
    if len(table.frames) < fewest:
        what = f"the case has {_counted(len(table.frames))}, too few {'frames to split' if fewest > 1 else 'to fit'}"
        why = ": to fit, select and verify" if fewest > 2 else ""
        laws = (
            "; fewer give the laws of range, noise and loss, and no verdict" if table.ideals_from == "repeats" else ""
        )
        faults.append(lines.fault(("frames",), what, fix=f"measure {fewest} or more{why}{laws}"))
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))


def _outside(path: Path, key: tuple[str | int, ...], lines: LineIndex) -> InputError | None:
    if not path.is_absolute() and Path(os.path.normpath(path)).parts[:1] != (os.pardir,):
        named_file(lines.file, path, lines.line(key))  # by a link
        return None
    what = f"{key[-1]} = {str(path)!r} leads out of the case's directory"
    return lines.fault(key, what, fix="copy the file into the directory and name it relative to it")


def _hashes(directory: Path, table: _CaseTable, model: Model) -> dict[str, str]:
    """SHA-256 of each file that can be read, the tables that the model names among them."""
    names = [CASE_FILE, str(table.model)]
    names += [os.path.relpath(curve.file, directory) for effect in model.effects for curve in effect.curves()]
    if model.external is not None:
        program = (*named_paths(model.external), *module_files(model.external).values())
        names += [os.path.relpath(path, directory) for path in program if path.is_relative_to(directory)]
    for frame in table.frames:
        names += [str(frame.ideal), str(frame.measured)]
    found = {}
    for name in names:
        # What is no file, or cannot be read, is for the reader to say; a pipe would keep us waiting for ever.
        with contextlib.suppress(OSError, ValueError):
            file = named(directory / name).file  # of a frame of a recording
            own = name if file == directory / name else os.path.relpath(file, directory)
            if own not in found and file.is_file():
                with file.open("rb") as stream:
                    found[own] = hashlib.file_digest(stream, "sha256").hexdigest()
    return found


def _check_doubles(table: _CaseTable, lines: LineIndex, hashes: Mapping[str, str]) -> None:
    """Noise never repeats itself: two measured files of the same bytes are copies."""
    empty = hashlib.sha256(b"").hexdigest()
    first: dict[str, tuple[int, Path]] = {}
    for i, frame in enumerate(table.frames):
        digest = hashes.get(str(frame.measured), empty)
        if digest != empty and digest in first:
            j, other = first[digest]
            what = f"frame {i}: {frame.measured} holds the same bytes as {other} of frame {j}"
            raise lines.fault(("frames", i, "measured"), what, fix="every frame is a measurement of its own")
        first[digest] = (i, frame.measured)


def _frames(
    directory: Path, table: _CaseTable, lines: LineIndex, model: Model
) -> tuple[list[Frame], dict[int, InputError]]:
    """The frames that can be used, and what is wrong with the others, by number."""
    frames, faults = [], {}
    origin = origin_of(table, table.parts)
    for number, entry in enumerate(table.frames):
        try:
            ideal, measured = _read(directory, number, entry, lines, model.sensor)
        except _Damaged as damage:
            faults[number] = damage.fault
            continue
        surface_signal(ideal, model)  # names a material without an entry
        frames.append(Frame(number, ideal, measured, entry.time, part=entry.part or "", origin=origin))
    sound = []
    frames = without_weak_rays(frames) if origin.source == "repeats" else frames
    for frame in frames:
        entry = table.frames[frame.number]
        fault = frame_fault(frame, frames, model, directory / entry.ideal, directory / entry.measured)
        scene = None if fault else compared_scene(frame, frames, entry.ideal.name)
        if scene is not None and scene.refused:
            fault = InputError(scene.what, file=directory / entry.measured, fix=scene.fix)
        if fault is None:
            sound.append(replace(frame, untold=() if scene is None else scene.untold(frame.measured)))
        else:
            faults[frame.number] = fault
    return sound, faults


class _Damaged(Exception):
    """A frame that cannot be read."""

    def __init__(self, fault: InputError) -> None:
        super().__init__(fault.what)
        self.fault = fault


def _read(directory: Path, number: int, entry: _FrameTable, lines: LineIndex, sensor: Sensor) -> tuple[IdealScan, Scan]:
    try:
        tables = [one_frame(read_table(directory / path)) for path in (entry.ideal, entry.measured)]
        if _is_exchanged(*tables):
            what = f"frame {number}: {entry.ideal} holds echoes and {entry.measured} an ideal scan"
            raise lines.fault(("frames", number, "ideal"), what, fix="exchange `ideal` and `measured`")
        ideal = ideal_from_table(ideal_table(tables[0], sensor) if is_semantic(tables[0]) else tables[0], sensor)
        file = directory / entry.measured
        scan = _with_features(
            _known_beams(scan_from_table(tables[1], entry.placement, sensor), ideal, file), file, sensor
        )
        return judged_beams(ideal, scan)
    except InputError as error:
        if error.file == str(lines.file) or isinstance(error, SeveralFrames):
            raise
        raise _Damaged(error) from error


def _is_exchanged(ideal: Table, measured: Table) -> bool:
    if is_semantic(ideal):
        return False
    return is_ideal(measured) and not is_ideal(ideal) and all(ideal.spelling(name) for name in ("Layer", "Point"))


def _known_beams(scan: Scan, ideal: IdealScan, file: Path) -> Scan:
    """The echoes whose beam is known; the few others of a file without Layer and Point are dropped with a warning."""
    unknown = (scan.layer < 0) | (scan.point < 0)
    if {"Layer", "Point"} & set(scan.defaulted):
        unknown |= ~np.isin(beam_keys(scan.layer, scan.point), beam_keys(ideal.layer, ideal.point))
    count = int(np.count_nonzero(unknown))
    if count == 0:
        return scan
    what = f"{count} of {len(scan)} echoes lie in the direction of no beam of the ideal scan"
    if count > UNKNOWN_BEAMS * len(scan):
        fix = "give Layer and Point of each echo, or turn X, Y, Z into the sensor's frame"
        raise InputError(what, file=file, fix=fix)
    _log.warning("%s: %s and are left out", file, what)
    return scan.take(~unknown)


def _with_features(scan: Scan, file: Path, sensor: Sensor) -> Scan:
    lacking = [name for name in ("PEAK", "AREA", "WIDTH") if name in scan.defaulted]
    if lacking and isinstance(sensor, SpadArray):
        what = f"no column {', '.join(lacking)}: how strong the echoes are is what most effects show in"
        raise InputError(what, file=file, fix="export the scan with PEAK, AREA and WIDTH")
    return scan


def _check_enough(file: Path, of: int, frames: list[Frame], faults: Mapping[int, InputError], fewest: int) -> None:
    """No more than a third of the frames is damaged, and enough remain."""
    if not faults:
        return
    fault = faults[min(faults)]
    if len(faults) > MOST_DAMAGED * of:
        left = f"{len(faults)} of {of} frames cannot be used" if len(faults) < of else f"and so all {of} frames"
    elif len(frames) < fewest:
        left = f"without it {_counted(len(frames))} are left, too few frames to split, which takes {fewest}"
    else:
        return
    raise InputError(f"{fault.what} ({left})", file=fault.file or file, line=fault.line, fix=fault.fix)


def _check_together(table: _CaseTable, lines: LineIndex, frames: list[Frame], model: Model) -> None:
    """What only all frames together show: files that are swapped, and a measurement of the other variant."""
    # Frames of one scene at rest fit each other's ideal scans as well as chance has it.
    at_rest = any(frame.origin.source == "repeats" for frame in frames)
    pair = None if at_rest else swapped(frames, model)
    if pair is not None:
        i, j = pair
        what = (
            f"{table.frames[i].measured} fits {table.frames[j].ideal} of frame {j} better than "
            f"{table.frames[i].ideal} of its own frame {i}"
        )
        raise lines.fault(("frames", i, "measured"), what, fix="were files swapped? pair each scan with its ideal scan")
    what = other_variant([frame.measured for frame in frames], model.sensor)
    if what:
        _, model_lines = parse_toml(lines.file.parent / table.model)
        raise model_lines.fault(("variant",), what, fix="name the model of the sensor that measured")


def _reason(error: LidarcheckError) -> str:
    where = "" if error.file is None else Path(error.file).name
    where = f"{where}:{error.line}" if where and error.line is not None else where
    return f"{where}: {error.what}" if where else error.what


def _counted(number: int) -> str:
    return "1 frame" if number == 1 else f"{number or 'no'} frames"
