"""`lidarcheck info`: what a file is and what is in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    JsonFlag,
    MaxRows,
    Placed,
    Quiet,
    Rooted,
    SensorName,
    TimeUnit,
    placement_of,
    sensor_named,
)
from lidarcheck.cli.core.outputs import json_text
from lidarcheck.cli.core.terminal import emit, hush, stage
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.formats.describe import FileDescription
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.sensor import Sensor

__all__ = ["info"]


def info(
    file: Annotated[
        Path, Parameter(help="Any file that lidarcheck reads, a bag's topic as FILE#TOPIC, a folder or a data set.")
    ],
    /,
    *,
    placed: Placed | None = None,
    time_unit: TimeUnit | None = None,
    sensor: SensorName = None,
    json: JsonFlag = False,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Say what a file is and what is in it."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    from lidarcheck.cases.dataset import dataset_file as is_dataset
    from lidarcheck.formats.describe import describe
    from lidarcheck.model import load_model

    known = sensor_named(sensor)
    with stage(f"reading {file.name}"):
        if file.is_dir() or is_dataset(file):
            description = _of_many(file, placement, time_unit, known)
        else:
            description = describe(file, load_model=load_model, placement=placement, time_unit=time_unit, sensor=known)
    emit(json_text(description.to_dict()) if json else str(description))
    return 0


def _of_many(place: Path, placement: Placement, time_unit: TimeUnit | None, sensor: Sensor | None) -> FileDescription:
    """The frames of a folder or data set, one after the other."""
    from lidarcheck.cases.source import frames_in, how_of
    from lidarcheck.formats.field.describe import FrameToDescribe, describe_frames

    frames = frames_in(place)
    told = (FrameToDescribe(frame.read(), *how_of(frame, placement, sensor)) for frame in frames)
    return describe_frames(str(place), f"{len(frames)} frames", told, time_unit)
