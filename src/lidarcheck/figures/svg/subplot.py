"""One pair of axes as SVG text, small, for a page that has many: colours and dashes are the page's CSS.

A series is class `s0`, `s1` ...: its colour, its dashes as a line, its shape as dots.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.elements import Band, Dots, Line, Subplot, depth, packed
from lidarcheck.figures.axes.scales import equal_spans, limits, one_a_cell
from lidarcheck.figures.svg.map import map_svg
from lidarcheck.figures.svg.shapes import LETTER, PlotArea, nodes, svg, text
from lidarcheck.figures.words import squeezed

__all__ = ["HEIGHT", "WIDTH", "subplot_svg"]


WIDTH, HEIGHT = 420.0, 232.0
_LEFT, _ROW, _LONGEST = 44.0, 11.0, 16
_CELLS, _MOST_DOTS = (1.5, 2.5, 4.0), 3000
"""Dots that would fall into one square of such a size are drawn once; into a larger one where they are many."""
_MOST_NODES = 1500
_SHAPES = (
    "h0",
    "m-1.8-1.8l3.6 3.6m0-3.6l-3.6 3.6",
    "m-1.6-1.6h3.2v3.2h-3.2z",
    "m-2.2 0h4.4m-2.2-2.2v4.4",
    "m0-2.2l2 3.6h-4z",
    "m0-2.2l2.2 2.2l-2.2 2.2l-2.2-2.2z",
    "m-2.2 0h4.4",
    "m0-2.2v4.4",
)


def subplot_svg(subplot: Subplot, *, width: float = WIDTH, height: float = HEIGHT) -> str:
    """One pair of axes as an SVG element; says so where there is nothing to draw."""
    if subplot.grid is not None:
        return map_svg(subplot, subplot.grid, width, height)
    points = subplot.points()
    words = f"{subplot.title}: {subplot.y_label} over {subplot.x_label}" if subplot.y_label else subplot.title
    if not len(points):
        nothing = text(width / 2.0, height / 2.0, "nothing to draw", "middle", "label")
        return svg(f"{words}: nothing to draw", nothing, name="chart", width=width, height=height)
    legend, top = _legend(subplot, width)
    frame, stretched = _frame(subplot, points, width, height, top)
    label = f"{subplot.x_label} (not to one scale)" if stretched else subplot.x_label
    y_ticks = (
        [(float(i), squeezed(name, _LONGEST)) for i, name in enumerate(subplot.y_names)] if subplot.y_names else None
    )
    parts = [frame.axes(frame.x_ticks(), label, y_ticks=y_ticks), legend]
    parts += [_band(frame, band) for band in subplot.bands]
    parts += [_line(frame, line) for line in sorted(subplot.lines, key=lambda line: line.series is not None)]
    parts += [_dots(frame, dots) for dots in sorted(subplot.dots, key=depth)]
    return svg(words, "".join(parts), name="chart", width=width, height=height)


def _frame(subplot: Subplot, points: FloatArray, width: float, height: float, top: float) -> tuple[PlotArea, bool]:
    """The axes, and whether lengths on them had to be stretched."""
    x, y = limits(points[:, 0], 0.02), limits(points[:, 1], 0.04)
    letters = max((len(squeezed(name, _LONGEST)) for name in subplot.y_names), default=0)
    frame = PlotArea(x, y, subplot.log_x, subplot.log_y, width, height, max(_LEFT, LETTER * letters + 10.0), top)
    if not subplot.equal:
        return frame, False
    x, y, equal = equal_spans(x, y, frame.right - frame.left, frame.bottom - frame.top)
    return dataclasses.replace(frame, x=x, y=y), not equal


def _legend(subplot: Subplot, width: float) -> tuple[str, float]:
    """(the y label to the left; to the right the series with a piece of their line or a dot, where the axes begin)."""
    names: list[tuple[int | None, str]] = []
    if not subplot.y_names:
        names = [(i, squeezed(subplot.names[i], 40)) for i in sorted(subplot.drawn())]
    names += [(None, f"({squeezed(name, 40)}: nothing)") for name in subplot.absent]
    names += [(None, f"and {subplot.more} more, not drawn")] if subplot.more else []
    lengths = [LETTER * len(words) + (32.0 if i is not None else 10.0) for i, words in names]
    parts, y = [], 13.0
    if subplot.y_label:
        parts.append(text(4.0, y, subplot.y_label, "start", "label"))
        y += _ROW if sum(lengths) + LETTER * len(subplot.y_label) > width - 10.0 else 0.0
    dotted, lined = ({one.series for one in some} for some in (subplot.dots, subplot.lines))
    for row in packed(lengths, width - 10.0):
        x = width - 6.0 - sum(lengths[i] for i in row)
        for i in row:
            series, words = names[i]
            x += lengths[i]
            parts.append(text(x, y, words, "end"))
            if series is not None:
                left, middle = x - lengths[i] + 8.0, y - 3.0
                if series in lined:
                    parts.append(f'<path class="line s{series}" d="M{left:.1f} {middle:.1f}h18"/>')
                if series in dotted:
                    parts.append(f'<path class="dots s{series}" d="M{left + 9:.1f} {middle:.1f}{_SHAPES[series]}"/>')
        y += _ROW
    return "".join(parts), max(y, 24.0) if names else 24.0


def _line(frame: PlotArea, line: Line) -> str:
    name = f"line s{line.series}" if line.series is not None else "bar" if line.heavy else "reference"
    places = _fewer([_place(frame, x, y) for x, y in zip(line.x.tolist(), line.y.tolist(), strict=True)])
    path = _path(places)
    if not path:
        return ""
    drawn = f'<path class="{name}" d="{path}"/>'
    if line.filled:
        ends = [place for place in places if np.isfinite(place[0])]
        shape = f"M{ends[0][0]:.1f} {frame.bottom:.1f}{path.replace('M', 'L')}L{ends[-1][0]:.1f} {frame.bottom:.1f}z"
        drawn = f'<path class="area s{line.series}" d="{shape}"/>{drawn}'
    return drawn


def _path(places: Sequence[tuple[float, float]]) -> str:
    """The path through the places, broken where there is none; level and upright pieces are written short."""
    path, before = [], (math.nan, math.nan)
    for x, y in places:
        if math.isfinite(x):
            short_form = f"H{x:.1f}" if y == before[1] else f"V{y:.1f}" if x == before[0] else f"L{x:.1f} {y:.1f}"
            path.append(short_form if math.isfinite(before[0]) else f"M{x:.1f} {y:.1f}")
        before = (x, y)
    return "".join(path)


def _place(frame: PlotArea, x: float, y: float) -> tuple[float, float]:
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.nan, math.nan
    return round(frame.across(x), 1), round(frame.up(y), 1)


def _fewer(places: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The places without those in the middle of a level or upright piece, and every so many-th of what is too many."""
    ends = [(math.nan, math.nan), *places, (math.nan, math.nan)]
    kept = [
        here
        for before, here, after in zip(ends, places, ends[2:], strict=False)
        if not (before[0] == here[0] == after[0] or before[1] == here[1] == after[1])
    ]
    step = -(-len(kept) // _MOST_NODES)
    return kept if step <= 1 else [*kept[:-1:step], kept[-1]]


def _band(frame: PlotArea, band: Band) -> str:
    good = np.isfinite(band.x) & np.isfinite(band.low) & np.isfinite(band.high)
    parts = []
    for piece in np.split(np.arange(len(good)), np.flatnonzero(np.diff(good.astype(np.int8))) + 1):
        if len(piece) and good[piece[0]]:
            upper = [(frame.across(band.x[i]), frame.up(band.high[i])) for i in piece]
            lower = [(frame.across(band.x[i]), frame.up(band.low[i])) for i in piece[::-1]]
            parts.append(f"{nodes([*upper, *lower])}z")
    name = "body" if band.solid else "interval"
    return f'<path class="{name} s{band.series}" d="{"".join(parts)}"/>' if parts else ""


def _dots(frame: PlotArea, dots: Dots) -> str:
    if dots.series is None:
        return "".join(
            f'<circle class="ring" cx="{frame.across(a):.1f}" cy="{frame.up(b):.1f}" r="3.2"/>'
            for a, b in zip(dots.x.tolist(), dots.y.tolist(), strict=True)
        )
    room = frame.right - frame.left, frame.bottom - frame.top
    points = np.column_stack([dots.x, dots.y])
    for cell in _CELLS:
        cells = (int(room[0] / cell), int(room[1] / cell))
        points = one_a_cell(points[:, 0], points[:, 1], (frame.x, frame.y), cells)
        if len(points) <= _MOST_DOTS:
            break
    shape = _SHAPES[dots.series]
    path = "".join(f"M{frame.across(x):.1f} {frame.up(y):.1f}{shape}" for x, y in points.tolist())
    return f'<path class="dots s{dots.series}" d="{path}"/>' if path else ""
