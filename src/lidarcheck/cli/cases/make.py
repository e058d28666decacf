"""`lidarcheck case make`: a case from measured frames, their ideal scans and a model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Files,
    Flag,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    placement_of,
    up_to,
)
from lidarcheck.cli.core.outputs import check_twice, check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, note, progress, stage, table
from lidarcheck.cli.ideals.options import numbers_of
from lidarcheck.cli.sensor.options import positive
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.files.sets import write_set
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.make import CaseFrame
    from lidarcheck.cases.source import FrameFile

__all__ = ["make"]

COLUMNS = columns("frame", "time s", "part", "measured", "ideal", right=("frame", "time s"))
_MOST_REPEATS = 100_000


def make(
    *,
    measured: Annotated[Files, Parameter(help=f"Measured scans, a frame each{MANY}.")],
    ideal: Annotated[
        Files, Parameter(help=f"Their ideal scans, by name, number, time or order; one serves all{MANY}.")
    ],
    model: Annotated[Path, Parameter(help="The model that should explain them; files that it names come with it.")],
    out: Annotated[Path, Parameter(help="The case's directory; it need not be there yet.")],
    ideals_from: Annotated[
        Literal["repeats", "snippet", "map"] | None,
        Parameter(help="What the ideal scans were made from, where not from a scene."),
    ] = None,
    pose_from: Annotated[
        Literal["fit"] | None, Parameter(help="fit: the pose of snippet or map was fitted with these scans.")
    ] = None,
    laws_from: Annotated[
        Literal["repeats"] | None, Parameter(help="repeats: so were the model's laws of range, noise and loss.")
    ] = None,
    repeats: Annotated[
        int | None,
        Parameter(converter=up_to(_MOST_REPEATS), help="Repeats in the estimate of each ideal scan from repeats."),
    ] = None,
    parts: Annotated[
        str | None,
        Parameter(help="Frames to fit, to select, to verify, in their order, as 12,4,4; else explain splits."),
    ] = None,
    period: Annotated[
        float | None, Parameter(converter=positive, help="Seconds from frame to frame, where the files do not say it.")
    ] = None,
    link: Annotated[bool, Flag, Parameter(help="Give files a second name in the case in the place of a copy.")] = False,
    force: Annotated[bool, Flag, Parameter(help="Replace the case that is there.")] = False,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Make a case from measured frames, their ideal scans and a model."""
    hush(quiet)
    limit_rows(max_rows)
    origin = _origin(ideals_from, pose_from, laws_from, repeats)
    _check_out(out, force)
    from lidarcheck.cases.case import CASE_FILE
    from lidarcheck.cases.make import CaseFrame, CaseKeys, case_files, frame_times, parts_of
    from lidarcheck.model import load_model

    with stage("reading"):
        pairs = _pairs(measured, ideal)
        check_twice(frame for frame, _ in pairs)
        times, how = frame_times([frame for frame, _ in pairs], load_model(model).sensor, period)
    roles = [""] * len(pairs)
    if parts is not None:
        counts = numbers_of(parts, 3, "--parts", "whole numbers of frames to fit, to select and to verify")
        roles = parts_of([int(one) if one == int(one) else 0 for one in counts], len(pairs))
    frames = [CaseFrame(m, i, t, role) for (m, i), t, role in zip(pairs, times, roles, strict=True)]
    files = case_files(frames, model, CaseKeys(placement_of(placed), origin), link=link)
    _check_inputs(out, files, [*measured, *ideal, model], json)
    with progress("writing") as show:
        names = list(files)

        def told(number: int, place: Path) -> None:
            files[names[number]](place)
            show(number + 1, len(names), names[number])

        write_set(out, {name: partial(told, number) for number, name in enumerate(names)})
    _tell(out, frames, json)
    note(f"{out / CASE_FILE}: {len(frames)} frames, {how}; what they can show: lidarcheck case check {out}")
    return 0


def _origin(
    ideals_from: str | None, pose_from: str | None, laws_from: str | None, repeats: int | None
) -> dict[str, Any]:
    """The keys of the case that say where its ideal scans come from."""
    if pose_from is not None and ideals_from not in ("snippet", "map"):
        raise UsageError("--pose-from is of --ideals-from snippet or map", fix="leave it out, or say which it is")
    for option, value in (("--laws-from", laws_from), ("--repeats", repeats)):
        if value is not None and ideals_from != "repeats":
            raise UsageError(f"{option} is of --ideals-from repeats", fix="leave it out, or add --ideals-from repeats")
    found = {"ideals_from": ideals_from, "pose_from": pose_from, "laws_from": laws_from, "repeats": repeats}
    return {key: value for key, value in found.items() if value is not None}


def _check_out(out: Path, force: bool) -> None:
    """Refuse a place that holds something already, unless a case is to be replaced."""
    if not out.exists():
        return
    if not out.is_dir():
        raise InputError("is not a directory", file=out, fix="name a directory for the case")
    if any(out.iterdir()):
        if not (out / "case.toml").is_file():
            raise InputError("is no case, and not empty", file=out, fix="name another directory for --out")
        if not force:
            fix = "name another directory, or replace it with --force"
            raise InputError("is there already", file=out / "case.toml", fix=fix)


def _pairs(measured: Sequence[Path], ideal: Sequence[Path]) -> list[tuple[FrameFile, FrameFile]]:
    """Each measured frame with its ideal scan."""
    from lidarcheck.cases.partners import paired
    from lidarcheck.cases.source import each_frame

    mine = [frame for group in each_frame(measured) for frame in group]
    theirs = [frame for group in each_frame(ideal, "ideal") for frame in group]
    if len(theirs) == 1:
        return [(frame, theirs[0]) for frame in mine]
    return list(zip(mine, paired(mine, theirs), strict=True))


def _check_inputs(out: Path, files: dict[str, Any], read: Sequence[Path], json: str | None) -> None:
    from lidarcheck.cli.core.outputs import same_file

    for name in files:
        place = out / name
        if place.exists() and any(same_file(place, file) for file in read):
            raise InputError("is also read by this command", file=place, fix="name another directory for --out")
    if json is not None:
        check_writable(json, option="--json", besides=[*read, *(out / name for name in files)])


def _tell(out: Path, frames: Sequence[CaseFrame], json: str | None) -> None:
    facts = [
        {
            "frame": number,
            "time_s": one.time_s,
            "part": one.part,
            "measured": str(one.measured),
            "ideal": str(one.ideal),
        }
        for number, one in enumerate(frames)
    ]
    if json is not None:
        write_result(json, json_text(with_origin({"case": str(out), "frames": facts})))
    if json != "-":
        rows = [
            (str(f["frame"]), f"{f['time_s']:.6g}", str(f["part"] or "-"), str(f["measured"]), str(f["ideal"]))
            for f in facts
        ]
        emit(table(COLUMNS, rows))
