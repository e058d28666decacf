"""`lidarcheck effects`: what a model can name, and what it does to the data."""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet, Seed
from lidarcheck.cli.core.outputs import json_text
from lidarcheck.cli.core.terminal import emit, hush, stage
from lidarcheck.cli.simulation.effects_text import explanation, facts, listing
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.effects import Effect
    from lidarcheck.model.showcase import EffectCurve

__all__ = ["effects"]

WIDTH = 80
HEIGHT = 15


def effects(
    name: Annotated[str | None, Parameter(help="The effect to explain; all by default.")] = None,
    /,
    *,
    settings: Annotated[
        list[str] | None,
        Parameter(name="--set", negative=(), help="PARAMETER=VALUE: show the effect with this value; may be repeated."),
    ] = None,
    variant: Annotated[str, Parameter(help="The sensor that shows it: SMART or SLIM.")] = "SMART",
    seed: Seed = 0,
    no_plot: Annotated[bool, Flag, Parameter(name="--no-plot", help="Explain without showing.")] = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """List the effects that a model can name, or explain one and show what it changes."""
    hush(quiet)
    from lidarcheck.effects import catalogue, empirical_terms, find
    from lidarcheck.sensor import Sensor

    Sensor.of(variant)
    if name is None:
        if settings:
            raise UsageError("--set needs an effect", fix="name it: lidarcheck effects NAME --set PARAMETER=VALUE")
        everything = [facts(effect) for effect in catalogue().values()]
        emit(json_text(everything) if json else listing(catalogue(), empirical_terms()))
        return 0
    effect = find(name)
    made = _make(name, settings or ())
    shown = None if no_plot else _show(made, variant, seed)
    if json:
        more = {} if shown is None else {"shown": {**shown.to_dict(), "parameters": made.settings()}}
        emit(json_text(facts(effect) | more))
    else:
        emit(explanation(effect, "" if shown is None else _picture(made, shown)))
    return 0


def _make(name: str, settings: Sequence[str]) -> Effect:
    """The effect with `PARAMETER=VALUE` applied; numbers as numbers, all else as text. Lists are those it shows."""
    from lidarcheck.effects import find, make

    files = {file.name for file in find(name).files()}
    lists = {numbers.name for numbers in find(name).lists()}
    values: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not key or not text:
            raise UsageError(f"--set {setting} is no setting", fix="use --set PARAMETER=VALUE, as --set gain=0.5")
        if key in values:
            raise UsageError(f"--set {key} is given more than once", fix="give it once")
        if key in files:
            raise UsageError(f"--set {key} names a file", fix="--set takes numbers; name the file in a model file")
        if key in lists:
            raise UsageError(
                f"--set {key} is a list", fix="--set takes one number or word; put the list in a model file"
            )
        values[key] = _number(text)
    return make(name, find(name).example() | values)


def _number(text: str) -> float | str:
    try:
        value = float(text)
    except ValueError:
        return text
    return int(value) if math.isfinite(value) and value == int(value) else value


def _show(effect: Effect, variant: str, seed: int) -> EffectCurve:
    with stage("showing the effect"):
        from lidarcheck.model.showcase import show

        return show(effect, variant=variant, seed=seed)


def _picture(effect: Effect, shown: EffectCurve) -> str:
    """What is shown, in words and as a plot; in words alone where nothing changes."""
    shown_as = {key: list(value) if isinstance(value, tuple) else value for key, value in effect.settings().items()}
    settings = ", ".join(f"{key} = {value}" for key, value in shown_as.items())
    head = f"Shown on a small demonstration scene, {shown.variant}, seed {shown.seed}"
    head = f"{head}:\n{_wrapped(settings)}" if settings else f"{head}:\n"
    if not shown.significant:
        return f"{head}With these values nothing changes there by more than chance.\n"
    from lidarcheck.figures.data import Course, Curve
    from lidarcheck.figures.terminal import course_text

    tty = sys.stdout.isatty()
    width = min(shutil.get_terminal_size().columns, WIDTH) if tty else WIDTH
    colour = tty and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    curves = (Curve("without", shown.x, shown.before), Curve("with", shown.x, shown.after))
    course = Course(shown.label, shown.x_label, shown.y_label, curves, log_x=shown.log_x)
    plot = course_text(course, width=width, height=HEIGHT, colour=colour, plain=not _draws_boxes())
    return f"{head}{_wrapped(shown.label[0].upper() + shown.label[1:] + '.')}\n{plot}"


def _wrapped(text: str) -> str:
    import textwrap

    return textwrap.fill(text, WIDTH - 2, break_long_words=False, initial_indent="", subsequent_indent="  ") + "\n"


def _draws_boxes() -> bool:
    """Whether standard output can hold the plot's characters."""
    try:
        "┤┌·".encode(sys.stdout.encoding or "ascii")
    except (LookupError, UnicodeEncodeError):
        return False
    return True
