"""A workflow's figure as text for a terminal. Series differ by their marks; colour, if asked for, only repeats that."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.build import KINDS, subplots_of
from lidarcheck.figures.axes.elements import Band, Subplot, depth, packed
from lidarcheck.figures.axes.scales import equal_spans, limits, one_a_cell, round_ticks
from lidarcheck.figures.data import Cloud, Course, Figure, Grid
from lidarcheck.figures.terminal.canvas import (
    COLOURS,
    HIGHEST,
    LOWEST,
    MARKS,
    NARROWEST,
    PLAIN_MARKS,
    WIDEST,
    Stroke,
    ascii_only,
    canvas,
    fit,
    head_lines,
)
from lidarcheck.figures.terminal.map import map_lines
from lidarcheck.figures.words import squeezed

__all__ = ["course_text", "figure_text"]

Span = tuple[float, float]

_INTERVAL, _REFERENCE, _BAR, _RING = ":", "-", "=", "O"
_TICK_ROOM, _FRAME_ROWS, _LEAST = 8, 3, 8
_NAMES = (30, 16, 9, 5)
"""Letters of a name in the legend: fewer where the legend would have more lines than there is room for."""


def figure_text(
    figure: Figure,
    *,
    kind: str = "histogram",
    width: int = 80,
    height: int = 15,
    colour: bool = False,
    plain: bool = False,
) -> str:
    """The figure as text of `height` lines, none wider than `width` characters, the last ending in a newline.

    `kind`: of a distribution one of KINDS, of a cloud one of VIEWS (else it is seen from above). `width` is kept within
    40 ... 200 and `height` within 9 ... 60. The first line is the title. `colour` adds escape sequences, `plain` keeps
    to ASCII. Without anything to draw the text says so. `ValueError`: a kind that there is not.
    """
    width, height = min(max(width, NARROWEST), WIDEST), min(max(height, LOWEST + 1), HIGHEST)
    above = isinstance(figure, Cloud) and kind in KINDS
    subplot = subplots_of(figure, "top" if above else kind)[0]
    if isinstance(subplot.grid, Grid):
        lines = map_lines(subplot.grid, width, height - 1)
    else:
        marks = PLAIN_MARKS if plain else MARKS
        lines = _lines(subplot, marks, _head(subplot, marks, width, height - 1), (width, height - 1), colour)
    return _whole([fit(subplot.title, width), *lines], plain)


def course_text(course: Course, *, width: int = 80, height: int = 15, colour: bool = False, plain: bool = False) -> str:
    """The curves alone as text, for a pane that has a title of its own; parameters are those of `figure_text`.

    The curves reach the frame's sides, points and intervals are not marked, and the first line holds the y label and
    all names. `height` is kept within 8 ... 60.
    """
    width, height = min(max(width, NARROWEST), WIDEST), min(max(height, LOWEST), HIGHEST)
    subplot = dataclasses.replace(subplots_of(course, "histogram")[0], bands=(), dots=())
    marks = PLAIN_MARKS if plain else MARKS
    legend = [f"{mark} {name}" for mark, name in zip(marks, subplot.names, strict=False)]
    legend += [f"({subplot.more} more)"] if subplot.more else []
    head = head_lines(subplot.y_label, legend, width)
    return _whole(_lines(subplot, marks, head, (width, height), colour, margin=0.0, tick_room=(12, 3)), plain)


def _whole(lines: Sequence[str], plain: bool) -> str:
    text = "\n".join(lines) + "\n"
    return ascii_only(text) if plain else text


def _lines(
    subplot: Subplot,
    marks: Sequence[str],
    head: Sequence[str],
    size: tuple[int, int],
    colour: bool,
    *,
    margin: float = 0.02,
    tick_room: tuple[int, int] = (10, 4),
) -> list[str]:
    """As many lines as `size` (columns, rows) has: the head, the frame, the x label.

    `margin`: room to the left and right of the points, as a part of what they span. `tick_room`: columns for a tick of
    the x axis, and how many there may be in any case.
    """
    width, rows = size[0], size[1] - len(head) - 1
    points, label = subplot.points(), subplot.x_label
    if not len(points):
        body = ["", "(nothing to draw)".center(width).rstrip(), *[""] * max(rows - 2, 0)]
        return [*head, *body, fit(label, width).center(width).rstrip()]
    x, y = limits(points[:, 0], margin), limits(points[:, 1], 0.04)
    room = (width - _TICK_ROOM, rows - _FRAME_ROWS)
    if subplot.equal:
        # A character is about twice as high as wide.
        x, y, equal = equal_spans(x, y, float(room[0]), 2.0 * room[1])
        label = label if equal else f"{label}   (not to one scale)"
    y_ticks = round_ticks(*y, max(rows // 3, 3), subplot.log_y)
    if subplot.y_names:
        names = [squeezed(name, 14, "..") for name in subplot.y_names]
        y_ticks = ([float(i) for i in range(len(names))], names)
    ticks = (round_ticks(*x, max(width // tick_room[0], tick_room[1]), subplot.log_x), y_ticks)
    body = canvas(_strokes(subplot, marks, (x, y), room), (x, y), ticks, (width, rows), colour)
    return [*head, *body, fit(label, width).center(width).rstrip()]


def _head(subplot: Subplot, marks: Sequence[str], width: int, height: int) -> list[str]:
    """The y label and the legend, in one line where they fit; else in as many as leave room for the picture."""
    legend = _legend(subplot, marks, _NAMES[0])
    if len(subplot.y_label) + sum(len(words) + 3 for words in legend) <= width:
        return head_lines(subplot.y_label, legend, width)
    for letters in _NAMES:
        legend = _legend(subplot, marks, letters)
        rows = packed([len(words) + 3.0 for words in legend], width + 3.0)
        if len(rows) <= max((height - _LEAST) // 2, 1):
            break
    names = [fit("   ".join(legend[i] for i in row), width) for row in rows]
    return [*([fit(subplot.y_label, width)] if subplot.y_label else []), *(line.rjust(width) for line in names)]


def _legend(subplot: Subplot, marks: Sequence[str], letters: int) -> list[str]:
    """The marks with the names, of so many letters, of what they stand for; violins have theirs beside them."""
    drawn = subplot.drawn()
    known = (
        [] if subplot.y_names else [f"{marks[i]} {squeezed(subplot.names[i], letters, '..')}" for i in sorted(drawn)]
    )
    known += [f"({squeezed(name, letters, '..')}: nothing)" for name in subplot.absent]
    known += [f"({subplot.more} more)"] if subplot.more else []
    known += [f"{_BAR}{_RING}{_BAR} quartiles, median"] if any(line.heavy for line in subplot.lines) else []
    known += [f"{_INTERVAL} interval"] if any(not band.solid for band in subplot.bands) else []
    return known


def _strokes(subplot: Subplot, marks: Sequence[str], spans: tuple[Span, Span], room: tuple[int, int]) -> list[Stroke]:
    """Bands first, then references, lines and dots, so that what matters most is on top."""
    strokes = []
    for band in subplot.bands:
        mark = marks[band.series] if band.solid else _INTERVAL
        strokes.append(Stroke(_filling(band, spans, room), mark, COLOURS[band.series], joined=False))
    for line in sorted(subplot.lines, key=lambda line: line.series is not None):
        points = np.column_stack([line.x, line.y])
        points[~np.isfinite(points).all(axis=1)] = np.nan
        if line.series is None:
            strokes.append(Stroke(points, _BAR if line.heavy else _REFERENCE))
        else:
            strokes.append(Stroke(points, marks[line.series], COLOURS[line.series]))
    for dots in sorted(subplot.dots, key=depth):
        if dots.series is None:
            strokes.append(Stroke(np.column_stack([dots.x, dots.y]), _RING, joined=False))
        else:
            mark = marks[dots.series]
            seen = one_a_cell(dots.x, dots.y, spans, (2 * room[0], 2 * room[1]))
            strokes.append(Stroke(seen, mark, COLOURS[dots.series], joined=False))
    return strokes


def _filling(band: Band, spans: tuple[Span, Span], room: tuple[int, int]) -> FloatArray:
    """Points that fill what lies between the band's ends, one a character."""
    (left, right), (bottom, top) = spans
    good = np.isfinite(band.x) & np.isfinite(band.low) & np.isfinite(band.high)
    if not good.any():
        return np.empty((0, 2))
    x, low, high = band.x[good], band.low[good], band.high[good]
    if len(x) > 1:
        at = np.linspace(x.min(), x.max(), max(math.ceil(2 * room[0] * (x.max() - x.min()) / (right - left)), 2))
        order = np.argsort(x)
        low, high, x = (np.interp(at, x[order], values[order]) for values in (low, high, x))
    step = (top - bottom) / max(room[1], 1)
    rows = np.arange(bottom + 0.5 * step, top, step)
    column, row = np.nonzero((rows >= low[:, None] - 0.25 * step) & (rows <= high[:, None] + 0.25 * step))
    return np.column_stack([x[column], rows[row]])
