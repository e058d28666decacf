"""What is in the frames of a recording, or of any other row of frames, told together; one frame in memory at a time."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from lidarcheck.beams import Geometry
from lidarcheck.formats.describe import ColumnSummary, FileDescription, beam_keys, described
from lidarcheck.formats.field.recording import RECORDINGS, Recording, open_recording
from lidarcheck.formats.geometry import AS_IT_IS, Placement, pooled, words
from lidarcheck.formats.scans import RowCounts
from lidarcheck.formats.table import Table, counted
from lidarcheck.formats.times import TimeUnit
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["FrameToDescribe", "describe_frames", "describe_recording", "said_once"]

_One = TypeVar("_One")
_TOLD_OF_FIRST = ("sensor", "time", "rows by material")


class FrameToDescribe(NamedTuple):
    """A frame's rows, what is declared of it, and what measured it."""

    table: Table
    placement: Placement = AS_IT_IS
    sensor: Sensor | None = None


def describe_recording(
    place: str | os.PathLike[str],
    kind: str,
    placement: Placement = AS_IT_IS,
    time_unit: TimeUnit | None = None,
    sensor: Sensor | None = None,
) -> FileDescription:
    """What is in a recording; `kind`: of `RECORDINGS`. `InputError` for the first frame that has a fault."""
    recording = open_recording(place, kind)
    from lidarcheck.formats.field.place import named

    frame = named(place).frame
    numbers = range(len(recording)) if frame is None else [frame]
    frames = (FrameToDescribe(recording.read(number), placement, sensor) for number in numbers)
    found = describe_frames(str(place), recording.title or RECORDINGS[kind][0], frames, time_unit)
    return replace(found, facts={**_recording_facts(recording), **found.facts})


def _recording_facts(recording: Recording) -> dict[str, Any]:
    facts: dict[str, Any] = {}
    if recording.topics:
        facts["topic"] = recording.topic
        others = [f"{name} ({counted(count, 'frame')})" for name, count in recording.topics if name != recording.topic]
        if others:
            facts["other topics"] = others
    if recording.times_s and len(recording) > 1:
        times = np.array(recording.times_s)
        step = float(np.median(np.diff(times)))
        facts["recorded"] = f"over {times[-1] - times[0]:.6g} s, a frame every {step:.6g} s"
    if recording.notes:
        facts["note"] = list(recording.notes)
    return facts


@dataclass
class _Sum:
    """What all frames together have so far."""

    sizes: list[int] = field(default_factory=list)
    columns: dict[str, ColumnSummary] = field(default_factory=dict)
    values: dict[str, int] = field(default_factory=dict)
    beams: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    range_m: tuple[float, float, float] | None = None
    ranges: int = 0
    per_beam: dict[int, int] = field(default_factory=dict)
    defaulted: dict[str, None] = field(default_factory=dict)
    geometry: list[Geometry] = field(default_factory=list)
    counts: list[RowCounts] = field(default_factory=list)
    fired: int = 0
    first: FileDescription | None = None

    def add(self, description: FileDescription, rows: Scan | IdealScan, counts: RowCounts) -> None:
        """Add a frame."""
        self.first = self.first or description
        self.sizes.append(description.rows or 0)
        for column in description.columns:
            self._add_column(column, description.rows or 0)
        self.beams = np.union1d(self.beams, beam_keys(rows.layer, rows.point))
        for number, beams in description.echoes_per_beam.items():
            self.per_beam[int(number)] = self.per_beam.get(int(number), 0) + beams
        self.defaulted.update(dict.fromkeys(description.defaulted))
        echoes = len(rows)
        if description.range_m is not None:
            self.range_m = _joined(self.range_m, self.ranges, description.range_m, echoes)
            self.ranges += echoes
        self.counts.append(counts)
        if isinstance(rows, Scan):
            self.geometry.append(rows.geometry)
            self.fired += 0 if rows.fired is None else len(rows.fired)

    def _add_column(self, column: ColumnSummary, rows: int) -> None:
        before, known = self.columns.get(column.name), self.values.get(column.name, 0)
        own = rows - column.missing
        span = None if before is None else _span(before)
        joined = _joined(span, known, _span(column), own)
        missing = column.missing + (before.missing if before else 0)
        low, high, mean = joined or (None, None, None)
        dtype = column.dtype if before is None or before.dtype == column.dtype else "mixed"
        self.columns[column.name] = ColumnSummary(column.name, dtype, low, high, mean, missing)
        self.values[column.name] = known + own


def _span(column: ColumnSummary) -> tuple[float, float, float] | None:
    if column.low is None or column.high is None or column.mean is None:
        return None
    return column.low, column.high, column.mean


def _joined(
    one: tuple[float, float, float] | None, rows: int, other: tuple[float, float, float] | None, more: int
) -> tuple[float, float, float] | None:
    """Low, high and mean of both together, of so many values each."""
    if one is None or other is None:
        return one or other
    share = more / max(rows + more, 1)
    return min(one[0], other[0]), max(one[1], other[1]), one[2] + (other[2] - one[2]) * share


def said_once(frames: Iterable[_One]) -> Iterator[_One]:
    """The same; what is logged of the first one's columns is not said again of each that follows."""
    log = logging.getLogger("lidarcheck.formats")
    level = log.level
    try:
        for number, frame in enumerate(frames):
            yield frame
            if number == 0:
                log.setLevel(logging.ERROR)
    finally:
        log.setLevel(level)


def describe_frames(
    name: str, title: str, frames: Iterable[FrameToDescribe], time_unit: TimeUnit | None = None
) -> FileDescription:
    """What is in frames that are read one after the other; `name`: how they are named, `title`: their format."""
    total = _Sum()
    for frame in said_once(frames):
        total.add(*described(frame.table, title, frame.placement, time_unit, frame.sensor))
    first = total.first
    if first is None:
        return FileDescription(name, title, "scan", rows=0)
    if len(total.sizes) == 1:
        return replace(first, path=name)
    return FileDescription(
        path=name,
        format=title,
        kind=first.kind,
        rows=sum(total.sizes),
        columns=tuple(total.columns.values()),
        beams=len(total.beams),
        range_m=total.range_m,
        echoes_per_beam={str(number): total.per_beam[number] for number in sorted(total.per_beam)},
        defaulted=tuple(total.defaulted),
        facts=_facts(total, first),
    )


def _facts(total: _Sum, first: FileDescription) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "frames": f"{len(total.sizes)}, read one by one; {min(total.sizes)} to {max(total.sizes)} rows each"
    }
    facts |= {name: value for name, value in first.facts.items() if name in _TOLD_OF_FIRST}
    if total.geometry:
        facts["geometry"] = words(pooled(total.geometry)).removeprefix("geometry ")
    empty = _sum(total.counts, "no_return")
    if empty:
        unplaced = _sum(total.counts, "unplaced")
        facts["no return"] = counted(empty, "row") + (f", {unplaced} of unknown beams" if unplaced else "")
    if total.fired:
        facts["fired beams"] = f"{total.fired} in all frames"
    if copies := _sum(total.counts, "copies"):
        facts["copies"] = f"{counted(copies, 'row')} that the frames have twice"
    if renumbered := _sum(total.counts, "renumbered"):
        facts["renumbered"] = f"the echoes of {counted(renumbered, 'beam')}, by range from 1"
    return facts


def _sum(counts: Sequence[RowCounts], name: str) -> int:
    return sum(getattr(one, name) for one in counts)
