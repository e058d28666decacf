"""`lidarcheck still`: the frames of a recording in which the scene stands still."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import MANY, Flag, JsonFile, MaxRows, Quiet, up_to
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import emit, hush, progress
from lidarcheck.errors import InputError
from lidarcheck.figures.files.sets import write_set
from lidarcheck.formats.limits import limit_rows
from lidarcheck.formats.table import counted

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.ideals.still import Search

__all__ = ["still"]

_MOST, _USUAL = 10_000, 20


def still(
    frames: Annotated[list[Path], Parameter(negative=(), help=f"A recording's frames, in order of time{MANY}.")],
    /,
    *,
    out: Annotated[Path, Parameter(help="Directory for the frames; it need not be there yet.")],
    most: Annotated[
        int, Parameter(converter=up_to(_MOST), help="So many frames are enough: the search then ends.")
    ] = _USUAL,
    link: Annotated[bool, Flag, Parameter(help="Give files a second name in DIR in the place of a copy.")] = False,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
) -> int:
    """Take the longest run of frames in which the scene stands still."""
    hush(quiet)
    limit_rows(max_rows)
    _check_out(out)
    from lidarcheck.cases.make import frame_file
    from lidarcheck.cases.source import each_frame

    given = [frame for group in each_frame(frames) for frame in group]
    found = _search(given, most)
    first, last = _run(found, given)
    taken = given[first : last + 1]
    files = [frame_file(frame, link=link) for frame in taken]
    if len({name for name, _ in files}) < len(files):
        files = [(f"{number:06d}_{name}", write) for number, (name, write) in enumerate(files, first)]
    if json is not None:
        check_writable(json, option="--json", besides=[*frames, *(out / name for name, _ in files)])
    with progress("writing") as show:

        def one(number: int, place: Path) -> None:
            files[number][1](place)
            show(number + 1, len(files), place.name)

        write_set(out, {name: partial(one, number) for number, (name, _) in enumerate(files)})
    facts = _facts(found, taken, first, out, [name for name, _ in files])
    if json is not None:
        write_result(json, json_text(with_origin(facts)))
    if json != "-":
        emit(_text(facts))
    return 0


def _check_out(out: Path) -> None:
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("is there already", file=out, fix="name a new directory for --out")


def _search(given: Sequence[FrameFile], most: int) -> Search:
    """Look at one frame after the other, until a run is long enough."""
    from lidarcheck.formats.assign.cloud import clouds_of
    from lidarcheck.ideals.still import Search

    found = Search()
    with progress("looking") as show:
        for number, frame in enumerate(given):
            found.look(clouds_of(frame.read())[0])
            show(number + 1, len(given), frame.name)
            if found.best is not None and len(found.best) >= most:
                break
    return found


def _run(found: Search, given: Sequence[FrameFile]) -> tuple[int, int]:
    """The first and the last frame of the run; `InputError` where there is none."""
    if len(given) < 2:
        what = "is a single frame, which shows nothing of what repeats"
        raise InputError(what, file=str(given[0]), fix="record some seconds with sensor and scene at rest")
    if found.two_sensors:
        what = "the frames of two sensors take turns: each is like the one before the last"
        raise InputError(
            what, file=str(given[0].path), fix="give each sensor's frames by themselves, or name its topic"
        )
    if found.best is None:
        what = f"nothing stands still: no two of {counted(found.seen, 'frame')} in a row agree"
        raise InputError(what, file=str(given[0].path), fix="record some seconds with sensor and scene at rest")
    return found.best.first, found.best.last


def _facts(found: Search, taken: Sequence[FrameFile], first: int, out: Path, names: Sequence[str]) -> dict[str, Any]:
    times = [frame.value for frame in taken if frame.frames.way == "time" and frame.value is not None]
    whole = len(times) == len(taken) > 1
    return {
        "directory": str(out),
        "first": first,
        "last": first + len(taken) - 1,
        "looked_at": found.seen,
        "period_s": (times[-1] - times[0]) / (len(times) - 1) if whole else None,
        "frames": [{"measured": str(frame), "file": str(out / name)} for frame, name in zip(taken, names, strict=True)],
    }


def _text(facts: dict[str, Any]) -> str:
    count = facts["last"] - facts["first"] + 1
    period = "" if facts["period_s"] is None else f", {facts['period_s']:.4g} s apart"
    return (
        f"frames {facts['first']} to {facts['last']} stand still: {count} of {facts['looked_at']} that were looked at"
        f"{period}\n{facts['directory']}: {counted(count, 'frame')}"
    )
