"""`lidarcheck bench`: how fast this machine runs what the project promises."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet, Several, up_to
from lidarcheck.cli.core.outputs import json_text
from lidarcheck.cli.core.terminal import columns, emit, hush, note, progress, table
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.cli.bench.kit import Alternative, Figure

__all__ = ["bench"]

Quick = Annotated[bool, Flag, Parameter(help="Less input, fewer repeats: a first impression.")]
BEAMS, FEW_BEAMS = 40_000, 4_000
MOST_BEAMS = 10_000_000
COLUMNS = columns("figure", "best", "median", "unit", "n", "times faster than", right=("best", "median", "n"))


def bench(
    *,
    json: JsonFlag = False,
    quick: Quick = False,
    scaling: Annotated[
        bool,
        Flag,
        Parameter(help="Curves over beams, pulses, frames and cores instead."),
    ] = False,
    effects: Annotated[
        bool,
        Flag,
        Parameter(
            help="Every effect alone and in six mixes instead, for five sensors: speed, and where the time goes."
        ),
    ] = False,
    beams: Annotated[
        int | None,
        Parameter(converter=up_to(MOST_BEAMS), help="About so many beams a frame, with --effects; 40000 by default."),
    ] = None,
    sensor: Annotated[
        list[str] | None, Several, Parameter(help="Names of built-in sensors in the place of the five, with --effects.")
    ] = None,
    out: Annotated[Path | None, Parameter(help="Directory for the curves as PNG, with --scaling.")] = None,
    quiet: Quiet = False,
) -> int:
    """Measure each figure and what a user would otherwise take, side by side."""
    hush(quiet)
    if out is not None and not scaling:
        raise UsageError("--out is for the curves of --scaling", fix="add --scaling, or leave --out out")
    if not effects and (beams is not None or sensor):
        what = "--beams" if beams is not None else "--sensor"
        raise UsageError(f"{what} is for the frames of --effects", fix=f"add --effects, or leave {what} out")
    if effects and scaling:
        raise UsageError("--effects and --scaling measure different things", fix="use one of them")
    if effects:
        return _effects(json, beams or (FEW_BEAMS if quick else BEAMS), sensor)
    if scaling:
        return _scaling(json, quick, out)
    from lidarcheck.cli.bench.fast import plain_keys
    from lidarcheck.cli.bench.figures import cases
    from lidarcheck.cli.bench.machine import machine

    measured: list[Figure] = []
    tasks = cases(quick)
    with progress("measuring") as show:
        for done, (name, task) in enumerate(tasks.items()):
            show(done, len(tasks), name)
            measured += task()
    about = machine()
    if json:
        figures = {figure.name: figure for figure in measured}
        emit(json_text({"machine": about, "quick": quick, **plain_keys(measured), "figures": figures}))
        return 0
    note(f"{about['cores']} cores, load {about['load_1min']:.1f}; best and median of n repeats")
    emit(table(COLUMNS, [_row(figure, other) for figure in measured for other in figure.against or (None,)]))
    return 0


def _effects(json: bool, beams: int, sensors: list[str] | None) -> int:
    """A table a sensor, or JSON."""
    from lidarcheck.cli.bench.effects_text import effects_json, effects_measured, effects_text
    from lidarcheck.cli.bench.machine import machine

    with progress("measuring") as show:
        measured = effects_measured(beams, sensors, show)
    about = machine()
    if json:
        emit(json_text({"machine": about, "sensors": effects_json(measured)}))
        return 0
    note(f"{about['cores']} cores, load {about['load_1min']:.1f}; best of a few repeats")
    emit("\n\n".join(effects_text(name, *found) for name, found in measured.items()))
    return 0


def _scaling(json: bool, quick: bool, out: Path | None) -> int:
    """The curves as text, or as JSON, and as PNG in `out`."""
    from lidarcheck.cli.bench.machine import machine
    from lidarcheck.cli.bench.scaling import scaling_courses
    from lidarcheck.cli.core.workflow_output import check_out_dir, drawn
    from lidarcheck.figures.files.result_folder import draw_pictures
    from lidarcheck.formats.plain import plain

    if out is not None:
        check_out_dir(out)
    with progress("measuring") as show:
        courses = scaling_courses(quick, show)
    if out is not None:
        out.mkdir(exist_ok=True)
        draw_pictures(courses, out, "histogram")
    if json:
        emit(json_text({"machine": machine(), "quick": quick, "courses": plain(courses)}))
        return 0
    for course in courses:
        emit(drawn(course, "histogram"))
    return 0


def _row(figure: Figure, other: Alternative | None) -> tuple[str, ...]:
    """A figure beside one of the others; its own numbers stand in the first of its rows."""
    first = other is None or figure.against[0] is other
    own = (figure.name, f"{figure.best:.4g}", f"{figure.median:.4g}", figure.unit, str(figure.repeats))
    against = f"{other.ratio:.3g} x {other.name}" if other else ""
    return (*(own if first else ("",) * len(own)), against)
