"""`lidarcheck convert`: a file in another format."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from lidarcheck.cli.core.outputs import check_writable, files_given
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.sensor import Sensor

__all__ = ["convert"]


def convert(
    source: Annotated[
        Path, Parameter(name="A", help="The file, bag (FILE#TOPIC), folder or data set to read, whatever `info` knows.")
    ],
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
    from lidarcheck.formats.field.write import is_stream
    from lidarcheck.formats.recognise import target_format

    known = sensor_named(sensor)
    if not is_stream(target):
        target_format(target)
    check_writable(target, option="B", besides=files_given(source))
    frames = _frames(source, target)
    if frames:
        count = _write(frames, target, placement, known, drop_empty=drop_empty, time_unit=time_unit)
        note(f"{target}: {count} frames written from {source}")
        return 0
    with stage(f"converting {source.name}"):
        run(source, target, placement, drop_empty=drop_empty, time_unit=time_unit, sensor=known)
    note(f"{target}: written from {source}")
    return 0


def _frames(source: Path, target: Path) -> list[FrameFile]:
    """The frames that are written one by one; none where a file becomes a file."""
    from lidarcheck.cases.dataset import dataset_file
    from lidarcheck.cases.source import frames_in
    from lidarcheck.formats.field.recording import RECORDINGS
    from lidarcheck.formats.field.write import is_stream
    from lidarcheck.formats.recognise import recognise

    many = source.is_dir() or dataset_file(source) is not None or is_stream(target)
    if not many and recognise(source) not in RECORDINGS:
        return []
    frames = frames_in(source)
    return frames if len(frames) > 1 or is_stream(target) else []


def _write(
    frames: Sequence[FrameFile],
    target: Path,
    placement: Placement,
    sensor: Sensor | None,
    *,
    drop_empty: bool,
    time_unit: TimeUnit | None,
) -> int:
    from lidarcheck.cases.source import how_of
    from lidarcheck.formats.field.write import FrameToWrite, write_frames

    with progress("converting") as show:

        def each() -> Iterator[FrameToWrite]:
            for number, frame in enumerate(frames):
                yield FrameToWrite(frame.read(), number, frame.time_ns(number), *how_of(frame, placement, sensor))
                show(number + 1, len(frames), frame.stem)

        return write_frames(each(), target, drop_empty=drop_empty, time_unit=time_unit)
