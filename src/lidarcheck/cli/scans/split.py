"""`lidarcheck split`: a file of several frames into a file a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from cyclopts import Parameter

from lidarcheck.cli.core.options import JsonFile, MaxRows, Quiet
from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, note, progress, stage, table
from lidarcheck.errors import InputError
from lidarcheck.figures.files.sets import write_set
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.recognise import Format

__all__ = ["split"]

COLUMNS = columns("frame", "rows", "file", right=("frame", "rows"))


class _Written(NamedTuple):
    """A frame as the result lists it. `value`: the frame column's, or its first time; None where rows' order tells."""

    frame: int
    rows: int
    value: float | None
    file: str


def split(
    merged: Annotated[Path, Parameter(help="The file of several frames, scans or ideal scans.")],
    /,
    *,
    out: Annotated[Path, Parameter(help="Directory for the frames; it need not be there yet.")],
    by: Annotated[
        str | None, Parameter(help="What tells frames apart: frame, time, order, or the name of a column.")
    ] = None,
    format: Annotated[
        Literal["parquet", "pcd", "txt", "csv", "las", "laz", "ply"] | None,
        Parameter(help="What each frame is written as; by default as MERGED is."),
    ] = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
) -> int:
    """Split a file of several frames into a file a frame."""
    hush(quiet)
    limit_rows(max_rows)
    if out.exists() and not out.is_dir():
        raise InputError("is not a directory", file=out, fix="name a directory for the frames")
    from lidarcheck.cases.source import frames_of_file
    from lidarcheck.formats.field.place import named
    from lidarcheck.formats.field.recording import RECORDINGS
    from lidarcheck.formats.recognise import FORMATS, recognise, target_format

    with stage(f"reading {merged.name}"):
        frames = frames_of_file(merged, by)
    kind = recognise(merged)
    form = FORMATS["pcd" if kind in RECORDINGS else kind] if format is None else target_format(f"frame.{format}")
    merged = named(merged).file
    own = merged.suffix if merged.suffix.lower() in form.suffixes else form.suffixes[0]
    suffix = own if format is None else f".{format}"
    places = [out / f"{merged.stem}_{frame.label:06d}{suffix}" for frame in frames]
    _check_places(places, json, merged)
    rows = _write(frames, places, form)
    written = [
        _Written(frame.label, count, frame.value, str(place))
        for frame, count, place in zip(frames, rows, places, strict=True)
    ]
    _tell(merged, out, frames[0].how, written, json)
    return 0


def _check_places(places: Sequence[Path], json: str | None, merged: Path) -> None:
    for place in places:
        if place.exists():
            raise InputError("is there already", file=place, fix="move it away, or name another directory for --out")
    if json is not None:
        check_writable(json, option="--json", besides=[merged, *places])


def _write(frames: Sequence[FrameFile], places: Sequence[Path], form: Format) -> list[int]:
    """Write all frames or none, and say how many rows each has."""
    rows = [0] * len(frames)
    out = places[0].parent
    with progress("writing") as show:

        def one(number: int, place: Path) -> None:
            content = frames[number].read()
            form.write(content, place)
            rows[number] = len(content)
            show(number + 1, len(frames), places[number].name)

        writers: dict[str, Callable[[Path], object]] = {place.name: partial(one, i) for i, place in enumerate(places)}
        write_set(out, writers)
    return rows


def _tell(merged: Path, out: Path, how: str, written: Sequence[_Written], json: str | None) -> None:
    from lidarcheck.formats.table import counted

    if json is not None:
        frames = [one._asdict() for one in written]
        write_result(json, json_text({"file": str(merged), "told_apart": how, "frames": frames}))
    if json != "-":
        emit(table(COLUMNS, [(str(one.frame), str(one.rows), one.file) for one in written]))
    words = f", told apart {how}" if len(written) > 1 else "; nothing tells more apart"
    note(f"{out}: {counted(len(written), 'frame')} of {merged}{words}")
