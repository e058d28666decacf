"""A workflow's figure as text for a terminal. Series differ by their marks; colour, if asked for, only repeats that."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.figures.data import Cloud, Figure, Grid
from lidarcheck.figures.drawing.panel import Band, Subplot, depth, packed, squeezed
from lidarcheck.figures.drawing.panels import KINDS, VIEWS, panels_of
from lidarcheck.figures.drawing.scales import equal_spans, limits, one_a_cell, round_ticks
from lidarcheck.figures.drawing.terminal import (
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
from lidarcheck.figures.drawing.text_map import map_lines

__all__ = ["KINDS", "VIEWS", "figure_text"]

FloatArray = npt.NDArray[np.float64]
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
    panel = panels_of(figure, "top" if isinstance(figure, Cloud) and kind not in VIEWS and kind in KINDS else kind)[0]
    if isinstance(panel.grid, Grid):
        lines = map_lines(panel.grid, width, height - 1)
    else:
        lines = _panel_lines(panel, width, height - 1, colour, plain)
    text = "\n".join([fit(panel.title, width), *lines]) + "\n"
    return ascii_only(text) if plain else text


def _panel_lines(panel: Subplot, width: int, height: int, colour: bool, plain: bool) -> list[str]:
    marks = PLAIN_MARKS if plain else MARKS
    head = _head(panel, marks, width, height)
    rows = height - len(head) - 1
    points = panel.points()
    if not len(points):
        body = ["", "(nothing to draw)".center(width).rstrip(), *[""] * max(rows - 2, 0)]
        return [*head, *body, fit(panel.x_label, width).center(width).rstrip()]
    x, y = limits(points[:, 0], 0.02), limits(points[:, 1], 0.04)
    label = panel.x_label
    room = (width - _TICK_ROOM, rows - _FRAME_ROWS)
    if panel.equal:
        # A character is about twice as high as wide.
        x, y, equal = equal_spans(x, y, float(room[0]), 2.0 * room[1])
        label = label if equal else f"{label}   (not to one scale)"
    y_ticks = round_ticks(*y, max(rows // 3, 3), panel.log_y)
    if panel.y_names:
        y_ticks = ([float(i) for i in range(len(panel.y_names))], [squeezed(name, 14, "..") for name in panel.y_names])
    ticks = (round_ticks(*x, max(width // 10, 4), panel.log_x), y_ticks)
    body = canvas(_strokes(panel, marks, (x, y), room), (x, y), ticks, (width, rows), colour)
    return [*head, *body, fit(label, width).center(width).rstrip()]


def _head(panel: Subplot, marks: Sequence[str], width: int, height: int) -> list[str]:
    """The y label and the legend, in one line where they fit; else in as many as leave room for the picture."""
    legend = _legend(panel, marks, _NAMES[0])
    if len(panel.y_label) + sum(len(words) + 3 for words in legend) <= width:
        return head_lines(panel.y_label, legend, width)
    for letters in _NAMES:
        legend = _legend(panel, marks, letters)
        rows = packed([len(words) + 3.0 for words in legend], width + 3.0)
        if len(rows) <= max((height - _LEAST) // 2, 1):
            break
    names = [fit("   ".join(legend[i] for i in row), width) for row in rows]
    return [*([fit(panel.y_label, width)] if panel.y_label else []), *(line.rjust(width) for line in names)]


def _legend(panel: Subplot, marks: Sequence[str], letters: int) -> list[str]:
    """The marks with the names, of so many letters, of what they stand for; violins have theirs beside them."""
    drawn = panel.drawn()
    known = [] if panel.y_names else [f"{marks[i]} {squeezed(panel.names[i], letters, '..')}" for i in sorted(drawn)]
    known += [f"({squeezed(name, letters, '..')}: nothing)" for name in panel.absent]
    known += [f"({panel.more} more)"] if panel.more else []
    known += [f"{_BAR}{_RING}{_BAR} quartiles, median"] if any(line.heavy for line in panel.lines) else []
    known += [f"{_INTERVAL} interval"] if any(not band.solid for band in panel.bands) else []
    return known


def _strokes(panel: Subplot, marks: Sequence[str], spans: tuple[Span, Span], room: tuple[int, int]) -> list[Stroke]:
    """Bands first, then references, lines and dots, so that what matters most is on top."""
    strokes = []
    for band in panel.bands:
        mark = marks[band.series] if band.solid else _INTERVAL
        strokes.append(Stroke(_filling(band, spans, room), mark, COLOURS[band.series], joined=False))
    for line in sorted(panel.lines, key=lambda line: line.series is not None):
        points = np.column_stack([line.x, line.y])
        points[~np.isfinite(points).all(axis=1)] = np.nan
        if line.series is None:
            strokes.append(Stroke(points, _BAR if line.heavy else _REFERENCE))
        else:
            strokes.append(Stroke(points, marks[line.series], COLOURS[line.series]))
    for dots in sorted(panel.dots, key=depth):
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
