"""`lidarcheck info`: what a file is and what is in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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

__all__ = ["info"]


def info(
    file: Annotated[Path, Parameter(help="Any file that lidarcheck reads.")],
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
    from lidarcheck.formats.describe import describe
    from lidarcheck.model import load_model

    known = sensor_named(sensor)
    with stage(f"reading {file.name}"):
        description = describe(file, load_model=load_model, placement=placement, time_unit=time_unit, sensor=known)
    emit(json_text(description.to_dict()) if json else str(description))
    return 0
