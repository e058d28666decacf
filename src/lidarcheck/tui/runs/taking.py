"""What a run has found, in the place of what a file says: shown first, and taken over as one edit."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from lidarcheck.calibration.blooming.lut_edit import LutChange
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.runs import Run
from lidarcheck.session.takeover import ModelTakeover, TableTakeover, run_takeover, table_takeover
from lidarcheck.tui.host import Host
from lidarcheck.tui.runs.models import OpenModels, change_lines
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

__all__ = ["ask_model", "ask_table", "lut_change_lines", "offered_model", "offered_table"]

_TAKE = "y"
_FEW, _RIGHT, _BELOW = 10, 10**6, 10**6
"""Lines of the box that asks about a table, and its place: the lower right, so that the curve above is seen."""


def lut_change_lines(changes: list[LutChange] | tuple[LutChange, ...]) -> list[Line]:
    """Rows that change, under a head: X, scaled value and Y, before and after."""
    lines = [line(f"{'table':11}{'row':>4}{'X':>9}{'scaled':>8}{'new':>6}{'Y':>13}{'new':>13}", "title")]
    for c in changes:
        old, new = ("-" if value is None else f"{value}" for value in c.scaled)
        before, after = ("-" if math.isnan(value) else f"{value:.7g}" for value in (c.before, c.after))
        x = f"{c.x:g}" if c.x_before is None else f"{c.x_before:g}>{c.x:g}"
        lines.append(line(f"{c.table:11}{c.row:>4}{x:>9}{old:>8}{new:>6}{before:>13}{after:>13}"))
    return lines


def offered_table(host: Host, run: Run, file: EditedLut) -> TableTakeover | None:
    """What the table of a run changes; None, and said, where it cannot be taken over."""
    try:
        return table_takeover(file, run, host.project.root)
    except LidarcheckError as error:
        host.say(error)
        return None


def ask_table(host: Host, change: TableTakeover, taken: Callable[[], object]) -> None:
    """Show the rows that change, and take them over when that is agreed to."""
    if not change.diff:
        host.say(f"{change.what}: no row changes")
        return
    words = []
    if change.missing:
        words.append(line(f"{counted(change.missing, 'row')} of the file are not in the fit, and stay.", "edited"))
    title = f"Take it over: {counted(len(change.diff), 'row')} of {change.file.path.name}?"
    ask = Ask(title, [*words, *lut_change_lines(change.diff)], {_TAKE: "take it over, u takes it back"}, unasked=True)
    ask.most = _FEW
    ask.at = (_RIGHT, _BELOW)
    host.ask(ask, lambda key: _make(host, change, taken) if key == _TAKE else _left(host))


def offered_model(host: Host, models: OpenModels, run: Run) -> ModelTakeover | None:
    """What the model of a run changes; None, and said, where it cannot be taken over."""
    root = host.project.root
    path = root / run.takes["model"]
    try:
        if not path.resolve().is_relative_to(root.resolve()):
            return None
        return run_takeover(models.open(path), run, root)
    except LidarcheckError as error:
        host.say(error)
        return None


def ask_model(host: Host, change: ModelTakeover, taken: Callable[[], object]) -> None:
    """Show the lines that change, and take them over when that is agreed to."""
    name = _name(host, change.file.path)
    if not change.diff:
        host.say(f"{change.what}: {name} has these numbers already")
        return
    words = list(change_lines(change.diff))
    if change.rewritten:
        words.insert(0, line(f"Comments and layout are not kept: {change.rewritten}", "bad"))
    title = f"Take it over: {counted(len(change.diff), 'line')} of {name}?"
    ask = Ask(title, words, {_TAKE: "take it over, u takes it back"}, unasked=True)
    host.ask(ask, lambda key: _make(host, change, taken) if key == _TAKE else _left(host))


def _make(host: Host, change: TableTakeover | ModelTakeover, taken: Callable[[], object]) -> None:
    try:
        made = change.make()
    except LidarcheckError as error:
        host.say(error)
        return
    name = _name(host, change.file.path)
    host.say(f"{name}: taken over, not saved yet; u takes it back" if made else f"{name}: nothing changes")
    taken()


def _left(host: Host) -> None:
    host.say("not taken over: nothing has changed")


def _name(host: Host, path: Path) -> str:
    return host.inside(str(path))
