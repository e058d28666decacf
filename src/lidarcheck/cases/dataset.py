"""A data set: `dataset.toml`, which says of each frame what was measured, at what, and how the sensor stood."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from pydantic import Field

from lidarcheck.arrays import IndexArray
from lidarcheck.beams import Fired
from lidarcheck.config.schema import Config, LineIndex, PathText, validate
from lidarcheck.config.words import shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.columns import INT32_MAX, missing, whole_column
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.field.place import named
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.geometry.keys import PlacementKeys
from lidarcheck.formats.recognise import read_table
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.model.files.model_file import load_model
from lidarcheck.model.files.sensor_file import is_sensor_file, load_sensor
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams, Sensor
from lidarcheck.sensor.channels import ChannelBeams
from lidarcheck.trust.places import named_file

__all__ = ["DATASET_FILE", "Dataset", "DatasetFrame", "Declared", "dataset_file", "load_dataset"]

DATASET_FILE = "dataset.toml"
_OF_A_UNIT = ("elevation_deg", "azimuth_offset_deg", "origin_m", "side_m", "height_m", "range_offset_m")
"""What differs from unit to unit of one model."""


class _FrameTable(PlacementKeys):
    measured: PathText
    ideal: PathText | None = None
    distance_m: float | None = Field(None, ge=0.0, le=1e5, json_schema_extra={"unit": "m"})
    class_: str | None = Field(None, alias="class")
    time: float | None = Field(None, json_schema_extra={"unit": "s"})
    repeat: int | None = Field(None, ge=0)
    calibration: PathText | None = None


class _HeadTable(Config):
    sensor: str | None = None
    model: PathText | None = None
    mask: PathText | None = None


class _DatasetTable(Config):
    dataset: _HeadTable = Field(default_factory=_HeadTable)
    frames: tuple[_FrameTable, ...] = ()


@dataclass(frozen=True, eq=False)
class Declared:
    """What a data set says of a frame: how its measured file lies, what measured it, and beams that are left out.

    `sensor_name`: as the data set names it; `calibration`: the file of the unit that measured. `mask`: keys of beams
    that see the carrier itself, ascending. `file`: the data set.
    """

    file: Path
    placement: Placement = AS_IT_IS
    sensor_name: str = ""
    calibration: Path | None = None
    mask: IndexArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @cached_property
    def own_sensor(self) -> Sensor | None:
        """The unit that measured, else the data set's sensor; None where it names none."""
        model = load_sensor(self.sensor_name) if self.sensor_name else None
        if self.calibration is None:
            return model
        if self.calibration.suffix.lower() == ".toml":
            return load_sensor(self.calibration)
        if model is None:
            fix = "name its sensor: [dataset] sensor"
            raise InputError("says a unit's angles, and no sensor is named", file=self.calibration, fix=fix)
        return replace(model, beams=_beams_of_unit(model, self.calibration))

    def sensor(self, given: Sensor | None) -> Sensor | None:
        """What measured; `UsageError` where the command says another than the data set."""
        own = self.own_sensor
        if own is not None and given is not None and given.name != own.name and self.calibration is None:
            what = f"the command's sensor is {given.name}, that of {self.file} is {own.name}"
            raise UsageError(what, fix="leave --sensor out, or name a model of this sensor")
        return given if own is None else own

    def placed(self, given: Placement) -> Placement:
        """How the file lies; `UsageError` where both the command and the data set declare it."""
        if not given.moves:
            return self.placement
        if self.placement.moves and self.placement != given:
            what = f"{given.said()} is declared on the command line, {self.placement.said()} in {self.file}"
            raise UsageError(what, fix="declare it in one place")
        return given

    def scan(self, scan: Scan) -> Scan:
        """The scan without the beams of the mask, as if they had not been fired."""
        if not len(self.mask):
            return scan
        kept = scan.take(~np.isin(beam_keys(scan.layer, scan.point), self.mask))
        if kept.fired is None:
            return kept
        fired = kept.fired
        own = ~np.isin(beam_keys(fired.layer, fired.point), self.mask)
        frame = None if fired.frame is None else fired.frame[own]
        return replace(kept, fired=Fired(fired.layer[own], fired.point[own], frame, fired.source))

    def ideal(self, ideal: IdealScan) -> IdealScan:
        """The ideal scan without the beams of the mask."""
        return ideal.take(~np.isin(beam_keys(ideal.layer, ideal.point), self.mask)) if len(self.mask) else ideal


def _beams_of_unit(model: Sensor, calibration: Path) -> Beams:
    """The beams of a sensor with the angles and origins that a vendor's file says of one unit."""
    from lidarcheck.formats.sensors import import_sensor, sensor_of_import

    imported = import_sensor(calibration)
    unit = sensor_of_import(imported, calibration).beams
    if not isinstance(model.beams, ChannelBeams) or not isinstance(unit, ChannelBeams):
        what = f"{calibration.name} is of channels, the beams of {model.name} are none"
        raise InputError(what, file=calibration, fix="name a sensor file of the unit, TOML")
    if unit.layers != model.beams.layers:
        what = f"describes {unit.layers} channels, the sensor {model.name} has {model.beams.layers}"
        raise InputError(what, file=calibration, fix="name the calibration of a unit of this model")
    told = [key for key in _OF_A_UNIT if key in imported.document["beams"]]
    channels = replace(model.beams.channels, **{key: getattr(unit.channels, key) for key in told})
    return replace(model.beams, channels=channels)


@dataclass(frozen=True, eq=False)
class DatasetFrame:
    """A frame: `number` from 0 as in the file; `measured` may name a frame of a recording, as `FILE#TOPIC@NUMBER`.

    `kind`: its `class`. What the file does not say is None, or empty.
    """

    number: int
    measured: Path
    declared: Declared
    ideal: Path | None = None
    distance_m: float | None = None
    kind: str = ""
    time_s: float | None = None
    repeat: int | None = None


@dataclass(frozen=True, eq=False)
class Dataset:
    """What `load_dataset` found. `model`: the model's file."""

    file: Path
    frames: tuple[DatasetFrame, ...]
    sensor_name: str = ""
    model: Path | None = None


def dataset_file(place: str | os.PathLike[str]) -> Path | None:
    """The data set that a path names: the file itself, by its name or table, or a folder that holds one."""
    path = Path(place)
    if path.is_dir():
        file = path / DATASET_FILE
        return file if file.is_file() else None
    if path.name == DATASET_FILE:
        return path
    return None


def load_dataset(place: str | os.PathLike[str]) -> Dataset:
    """Read a data set, the file or its folder, and check all of it that can be checked without reading frames.

    `ConfigError` with all faults and their lines: unknown keys, files that are not there or lead out of the project,
    frames named twice, a sensor that is not the model's.
    """
    file = dataset_file(place) or Path(place)
    data, lines = parse_toml(file)
    table = validate(data, lines, _DatasetTable)
    _check(table, lines)
    head = table.dataset
    sensor = head.sensor or ""
    if sensor and is_sensor_file(sensor):
        sensor = str(named_file(file, sensor, lines.line(("dataset", "sensor"))))
    model = None if head.model is None else named_file(file, head.model, lines.line(("dataset", "model")))
    if model is not None:
        sensor = _agreeing(sensor, model, lines)
    mask = _mask(file, head.mask, lines)
    frames = tuple(
        DatasetFrame(
            number,
            file.parent / one.measured,
            Declared(file, one.placement, sensor, _beside(file, one.calibration), mask),
            _beside(file, one.ideal),
            one.distance_m,
            one.class_ or "",
            one.time,
            one.repeat,
        )
        for number, one in enumerate(table.frames)
    )
    return Dataset(file, frames, sensor, model)


def _beside(file: Path, name: Path | None) -> Path | None:
    return None if name is None else file.parent / name


def _check(table: _DatasetTable, lines: LineIndex) -> None:
    """Every file that is named is there and in the project, and no frame is named twice: all faults at once."""
    faults: list[InputError] = []
    first: dict[str, int] = {}
    if not table.frames:
        faults.append(lines.fault(("frames",), "the data set has no frame", fix="add [[frames]] with `measured`"))
    for key in ("model", "mask"):
        faults += _file_faults(getattr(table.dataset, key), ("dataset", key), lines)
    for i, frame in enumerate(table.frames):
        for key in ("measured", "ideal", "calibration"):
            faults += _file_faults(getattr(frame, key), ("frames", i, key), lines)
        measured = os.path.normpath(frame.measured)
        if measured in first:
            what = f"frame {i} names {shown(measured, 200)} as measured, as frame {first[measured]} does"
            faults.append(lines.fault(("frames", i, "measured"), what, fix="every frame is a measurement of its own"))
        first.setdefault(measured, i)
        if frame.ideal is not None and os.path.normpath(frame.ideal) == measured:
            what = f"frame {i} names {shown(measured, 200)} both as ideal and as measured"
            faults.append(lines.fault(("frames", i, "ideal"), what, fix="name the ideal scan of that frame"))
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))


def _file_faults(name: Path | None, key: tuple[str | int, ...], lines: LineIndex) -> list[InputError]:
    """What is wrong with a file that is named at a key."""
    if name is None:
        return []
    place = named(lines.file.parent / name).file
    try:
        named_file(lines.file, os.path.relpath(place, lines.file.parent), lines.line(key))
    except (InputError, ValueError) as error:
        if isinstance(error, InputError):
            return [error]
        return [lines.fault(key, f"{key[-1]} = {shown(str(name), 200)} is no path", fix="name a file")]
    try:
        there = place.exists()
    except (OSError, ValueError):
        there = False
    if not there:
        what = f"{key[-1]} = {shown(str(name), 200)}: there is no such file"
        return [lines.fault(key, what, fix="paths start from the data set's folder")]
    return []


def _agreeing(sensor: str, model: Path, lines: LineIndex) -> str:
    """The sensor of the data set, else the model's. The fault where the two are not the same."""
    found = load_model(model)
    if found.external is not None and not sensor:
        return ""
    own = found.sensor
    if sensor:
        named_one = load_sensor(sensor)
        if named_one.name != own.name and found.external is None:
            what = f"sensor = {Path(sensor).name!r} is {named_one.name}, the variant of {model.name} is {own.name}"
            raise lines.fault(("dataset", "sensor"), what, fix="name the model's variant, or leave `sensor` out")
        return sensor
    return own.file or own.variant


def _mask(file: Path, name: Path | None, lines: LineIndex) -> IndexArray:
    """The keys of the masked beams, ascending."""
    if name is None:
        return np.zeros(0, dtype=np.int64)
    table = read_table(named_file(file, name, lines.line(("dataset", "mask"))))
    lacking = missing(table, ("Layer", "Point"))
    if lacking:
        raise table.fault(f"the mask has no column {', '.join(lacking)}", fix="write Layer,Point and a beam a line")
    layer, point = (whole_column(table, one, 0, INT32_MAX) for one in ("Layer", "Point"))
    return np.unique(beam_keys(layer, point))
