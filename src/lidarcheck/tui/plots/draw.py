"""A chart as lines of a pane: frame, cells, cursors, a strip of residuals, and the line with label and readout."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from typing import NamedTuple, cast

import numpy as np

from lidarcheck.figures.terminal import open_frame
from lidarcheck.figures.words import squeezed
from lidarcheck.tui.plots.chart import Chart, Strip
from lidarcheck.tui.plots.layers import Cells, cells_of_traces, sample_of
from lidarcheck.tui.plots.look import Look, axes_of, seen_traces
from lidarcheck.tui.plots.marks import Level
from lidarcheck.tui.plots.readout import reading_words
from lidarcheck.tui.plots.ticks import Tick, own_ticks, ticks_across, ticks_up
from lidarcheck.tui.plots.transform import Axis
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["LEAST", "Drawn", "drawn", "legend"]

LEAST = (24, 6)
"""Columns and lines below which there is no plot."""
_LABELS = (5, 10)
"""Columns of the ticks' texts upward: so many at least, so that they stay where they are, and at most."""
_STRIP_ROWS, _ROWS_WITH_STRIP = 3, 4
_BELOW = 3
"""Lines below the data: the axis, its ticks, and label and readout."""
_PLAIN_FRAME = str.maketrans("┌┐└┘┤├┬┴┼─│", "+++++++++-|")


class Drawn(NamedTuple):
    """`lines`: of the pane. `axes`: x and y. `left`: columns before the data. `zoom`: how many times less than all is
    seen along x, or along y where that is more.
    """

    lines: list[Line]
    axes: tuple[Axis, Axis]
    left: int
    zoom: float


def drawn(chart: Chart, look: Look, size: tuple[int, int], level: Level, more: Line = ()) -> Drawn | None:
    """The chart on `size` (columns, lines); None where there is no room. `more`: what the title has no room for of the
    legend; it stands below where nothing is read.
    """
    width, height = size
    if width < LEAST[0] or height < LEAST[1]:
        return None
    strip = chart.strip if height - _BELOW - _STRIP_ROWS >= _ROWS_WITH_STRIP else None
    rows = height - _BELOW - (_STRIP_ROWS if strip else 0)
    # Which ticks there are upward says how wide their texts are, and that how many columns are left.
    up = _up_ticks(chart, axes_of(chart, look, (width, rows))[1])
    labels = min(max([_LABELS[0], *(len(text) for _, text in up)]), _LABELS[1])
    left = labels + 1
    axes = axes_of(chart, look, (width - left, rows))
    up = [(at, text[:labels]) for at, text in (up if not chart.equal else _up_ticks(chart, axes[1]))]
    across = own_ticks(axes[0], chart.xs()) if chart.own_ticks else ticks_across(axes[0])
    frame = _frame(axes, (across, up), left, level)
    cells = cells_of_traces(seen_traces(chart, look), axes, level)
    lines = [_row(frame[y], left, cells, y, _overlay(chart, look, axes, cells, y, level)) for y in range(rows)]
    lines += [
        line(frame[rows], "dim"),
        line(frame[rows + 1], "dim"),
        _label_line(chart, look, axes, strip, width, more),
    ]
    if strip is not None:
        lines += _strip_lines(strip, axes[0], left, level)
    return Drawn(lines, axes, left, _zoom(chart, look, axes))


def _zoom(chart: Chart, look: Look, axes: tuple[Axis, Axis]) -> float:
    if not look.zoomed:
        return 1.0
    whole = axes_of(chart, replace(look, x=None, y=None), (axes[0].cells, axes[1].cells))
    parts = [(one.span[1] - one.span[0]) / (seen.span[1] - seen.span[0]) for one, seen in zip(whole, axes, strict=True)]
    return max(parts) if max(parts) > 1.0 else min(parts)


def legend(chart: Chart, look: Look, level: Level, room: int) -> tuple[Line, Line]:
    """The marks with the names of what they stand for, hidden ones in brackets: what has room, and the rest."""
    parts: list[tuple[str, Role]] = []
    fits = 0
    for trace in {trace.name: trace for trace in chart.traces}.values():
        hidden = trace.name in look.hidden
        sample = sample_of(trace, level)
        words = f" ({trace.name})" if hidden else f" {trace.name}"
        room -= 1 + len(sample) + len(words)
        fits += 2 if room >= 0 else 0
        parts += [(f" {sample}", "dim" if hidden else cast("Role", trace.role)), (words, "dim" if hidden else "text")]
    return tuple(parts[:fits]), tuple(parts[fits:])


def _up_ticks(chart: Chart, axis: Axis) -> list[Tick]:
    if chart.y_names:
        return [(float(i), squeezed(name, _LABELS[1], "..")) for i, name in enumerate(chart.y_names)]
    return ticks_up(axis)


def _frame(axes: tuple[Axis, Axis], ticks: tuple[list[Tick], list[Tick]], left: int, level: Level) -> list[str]:
    """The frame's lines, all of one width up to the data."""
    wide = max([0, *(len(text) for _, text in ticks[1])]) + 1
    spans = (axes[0].span, axes[1].span)
    size = (axes[0].cells + wide, axes[1].cells + 2)
    text = [f"{'':{left - wide}}{row}" for row in open_frame(spans, (tuple(ticks[0]), tuple(ticks[1])), size)]
    text += [""] * (size[1] - len(text))
    return [row.translate(_PLAIN_FRAME) for row in text] if level == "ascii" else text


def _row(frame: str, left: int, cells: Cells, y: int, over: dict[int, tuple[str, Role]]) -> Line:
    """A line of data behind its part of the frame."""
    looks: list[tuple[str, Role]] = [
        (letter, cast("Role", cells.names[role]) if role else "text")
        for letter, role in zip(cells.letters[y].tolist(), cells.roles[y].tolist(), strict=True)
    ]
    for x, look in over.items():
        looks[x] = look
    while looks and looks[-1] == (" ", "text"):
        looks.pop()
    runs = [("".join(letter for letter, _ in run), role) for role, run in groupby(looks, lambda one: one[1])]
    return (*line(f"{frame[:left]:{left}}", "dim"), *runs)


def _overlay(
    chart: Chart, look: Look, axes: tuple[Axis, Axis], cells: Cells, y: int, level: Level
) -> dict[int, tuple[str, Role]]:
    """What the cursors lay over a row: lines in cells that are empty, and the points they are at in reverse."""
    over: dict[int, tuple[str, Role]] = {}
    for at, mark in ((look.second, ":"), (look.cursor, "|" if level == "ascii" else "│")):
        column = None if at is None else axes[0].cell(at)
        if column is not None and cells.letters[y, column] == " ":
            over[column] = (mark, "dim")
    for column in _box_columns(look.box, y, axes[0].cells):
        if cells.letters[y, column] == " ":
            over[column] = ("+" if level == "ascii" else "·", "dim")
    for x, value in _points(chart, look):
        column, up = axes[0].cell(x), axes[1].cell(value)
        if column is not None and up is not None and axes[1].cells - 1 - up == y:
            letter = str(cells.letters[y, column])
            over[column] = ("o" if letter == " " else letter, "cursor")
    return over


def _box_columns(box: tuple[int, int, int, int] | None, y: int, cells: int) -> list[int]:
    """The columns of a row in which the border of a box is."""
    if box is None:
        return []
    (left, right), (top, bottom) = sorted((box[0], box[2])), sorted((box[1], box[3]))
    border = range(left, right + 1) if y in (top, bottom) else (left, right) if top < y < bottom else ()
    return [column for column in border if 0 <= column < cells]


def _points(chart: Chart, look: Look) -> list[tuple[float, float]]:
    """The data points that are under a cursor: that of the readout, and that of another pane."""
    found: list[tuple[float, float]] = []
    traces = seen_traces(chart, look)
    if chart.at is not None and chart.traces[chart.at[0]].name not in look.hidden:
        trace, index = chart.traces[chart.at[0]], chart.at[1]
        if index < len(trace.y):
            found.append((float(trace.places[index]), float(trace.y[index])))
    if look.cursor is not None and traces:
        trace = traces[min(look.active, len(traces) - 1)]
        places = trace.places
        if len(places) and np.isfinite(places).any():
            index = int(np.nanargmin(np.abs(places - look.cursor)))
            found.append((float(places[index]), float(trace.y[index])))
    return [point for point in found if np.isfinite(point).all()]


def _label_line(chart: Chart, look: Look, axes: tuple[Axis, Axis], strip: Strip | None, width: int, more: Line) -> Line:
    """The x axis's label and the readout; without a cursor the words of the strip. The label gives way, unit first."""
    scale = "" if axes[0].transform.scale == "lin" else f", {axes[0].transform.scale}"
    label = f"{chart.x_label}{scale}"
    labels = (f"{label}; up: {chart.y_label}" if chart.y_label else label, label, chart.x_label.partition(" [")[0])
    entries = reading_words(chart, look, (axes[0].transform, axes[1].transform))
    while len(entries) > 1 and len(", ".join(entries)) > width - 1:
        entries.pop()
    words = ", ".join(entries) or (strip.words if strip else "")
    while len(words) > width - 1 and ", " in words:  # whole figures, as many as there is room for
        words = words.rpartition(", ")[0]
    room = width - len(words) - 3
    if not words and more:
        room = width - sum(len(text) for text, _ in more) - 2
        return (*line(f"{next((f' {one} ' for one in labels if len(one) <= room), '')}", "dim"), *more)
    if not words:
        return line(next((f" {one}" for one in labels if len(one) < width), ""), "dim")
    shown = next((f" {one}  " for one in labels if len(one) <= room), " ")
    return (*line(shown, "dim"), *line(words[: width - len(shown)]))


def _strip_lines(strip: Strip, axis: Axis, left: int, level: Level) -> list[Line]:
    """One mark a column, the furthest of those in it: above, at, or below what chance allows about none."""
    place = axis.place(strip.x)
    middle, reach = (0.0, strip.reach) if strip.scale == "lin" else (1.0, strip.reach)
    marks = [[" "] * axis.cells for _ in range(_STRIP_ROWS)]
    size: dict[int, tuple[float, bool]] = {}
    for at, y, far in zip(place.tolist(), strip.y.tolist(), strip.far.tolist(), strict=True):
        if np.isfinite(at) and np.isfinite(y) and 0.0 <= at < axis.cells:
            y = y if strip.scale == "lin" else float(np.log10(max(y, 1e-12)) / np.log10(reach) * reach)
            if abs(y) >= abs(size.get(int(at), (0.0, False))[0]):
                size[int(at)] = (y, bool(far))
    rule = "-" if level == "ascii" else "─"
    marks[1] = [rule] * axis.cells
    for column, (y, far) in size.items():
        row = 1 - max(min(round(y / reach), 1), -1)
        marks[1][column] = rule if row != 1 else marks[1][column]
        marks[row][column] = "!" if far else "o"
    texts = (f"{reach:g}{strip.unit}", f"{middle:g}{strip.unit}",
             f"-{reach:g}" if strip.scale == "lin" else f"{1.0 / reach:.2g}{strip.unit}")  # fmt: skip
    bar = "|" if level == "ascii" else "│"
    return [
        (*line(f"{text:>{left - 1}}{bar}", "dim"), *line("".join(row).rstrip()))
        for text, row in zip(texts, marks, strict=True)
    ]
