"""`lidarcheck convert`: a file in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    Flag,
    MaxRows,
    Placed,
    Quiet,
    Rooted,
    SensorName,
    TimeUnit,
    placement_of,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_writable
from lidarcheck.cli.core.terminal import hush, note, stage
from lidarcheck.formats.limits import limit_rows

__all__ = ["convert"]


def convert(
    source: Annotated[Path, Parameter(name="A", help="The file to read, in any format that `info` knows.")],
    target: Annotated[Path, Parameter(name="B", help="The file to write; its suffix names the format.")],
    /,
    *,
    placed: Placed | None = None,
    drop_empty: Annotated[bool, Flag, Parameter(help="Leave out the rows without a return.")] = False,
    time_unit: TimeUnit | None = None,
    sensor: SensorName = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Convert a file; the output's format follows its suffix."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    from lidarcheck.formats.convert import convert as run
    from lidarcheck.formats.recognise import target_format

    known = sensor_named(sensor)
    target_format(target)
    check_writable(target, option="B", besides=(source,))
    with stage(f"converting {source.name}"):
        run(source, target, placement, drop_empty=drop_empty, time_unit=time_unit, sensor=known)
    note(f"{target}: written from {source}")
    return 0
