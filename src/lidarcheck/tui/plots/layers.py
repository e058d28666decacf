"""The traces of a chart as cells: each a character and a role. Dots of several traces in one cell are merged."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.tui.plots.chart import Trace
from lidarcheck.tui.plots.colours import PlotRole
from lidarcheck.tui.plots.marks import LETTERS, Level, glyphs
from lidarcheck.tui.plots.raster import (
    DASHED,
    DOTTED,
    SOLID,
    Pattern,
    cells_of,
    curve_dots,
    empty,
    point_dots,
)
from lidarcheck.tui.plots.transform import Axis

__all__ = ["BOTH", "Cells", "cells_of_traces", "letter_of", "sample_of"]

Letters = npt.NDArray[np.str_]
BOTH = "@"
"""The ASCII mark of a cell that two traces share."""
_EVERY, _FIRST = 6, 3
"""An `o` stands in every so many columns of an open trace, the first in this one: in none where dots of another are."""
_LETTERS = {"solid": "#", "open": "o", "dots": ".", "dashes": "-", "points": "#", "filled": "#", "outline": "|"}
_PATTERNS: dict[str, Pattern] = {"open": DASHED, "dashes": DASHED, "dots": DOTTED}
_EIGHTHS = np.array(list(" ▁▂▃▄▅▆▇█"))
_STEPS = {"flat": "─", "up": "│", "rise": "┌", "foot": "┘", "fall": "┐", "toe": "└"}
_PLAIN_STEPS = {"flat": "_", "up": "|", "rise": "_", "foot": "|", "fall": "_", "toe": "|"}
_INTERVAL = ":"
_FEW = 3
"""Intervals are bars where each has this many columns, else their ends are two curves."""


class Cells(NamedTuple):
    """`letters`: shape (rows, columns), a blank where there is nothing; `roles`: which trace's role, by its number in
    `names`.
    """

    letters: Letters
    roles: IndexArray
    names: tuple[PlotRole | str, ...]


class _Layer(NamedTuple):
    dots: BoolArray
    role: PlotRole
    letter: str
    alone: bool
    """Whether its letter, not its dots, is what a cell shows that it has alone."""
    open: bool = False


def letter_of(trace: Trace) -> str:
    """The mark of a trace where a cell is one character."""
    return trace.letter or _LETTERS[trace.form]


def sample_of(trace: Trace, level: Level) -> str:
    """How a trace looks, in one or two characters, for a legend."""
    if level in LETTERS:
        return "_|" if trace.form == "outline" else letter_of(trace)
    if trace.form in ("filled", "outline"):
        return "▆" if trace.form == "filled" else "┌┐"
    if trace.form == "points":
        return trace.letter or {"braille": "⠶", "blocks": "▘", "half": "▀"}[level]
    dots = curve_dots(np.array([0.0, 1.9]), np.array([0.6, 0.6]), (2, 1), _PATTERNS.get(trace.form, SOLID))
    sample = "".join(glyphs(dots, level)[0])
    return f"{letter_of(trace)}{sample[1]}" if trace.form == "open" else sample.rstrip()


def cells_of_traces(traces: list[Trace], axes: tuple[Axis, Axis], level: Level) -> Cells:
    """All traces on a plot of as many cells as the axes have; the first is the measured one where there is one."""
    size = (axes[0].cells, axes[1].cells)
    names: tuple[PlotRole | str, ...] = ("", "real", "now", "saved", "wanted", "both")
    letters = np.full((size[1], size[0]), " ", dtype="<U1")
    roles = np.zeros((size[1], size[0]), dtype=np.int64)
    main = [_curve_layer(trace, axes, size) for trace in traces if not trace.is_histogram]
    beside = [_interval_layer(trace, axes, size) for trace in traces if trace.low is not None and len(trace.x)]
    for trace in traces:
        if trace.is_histogram:
            _add_histogram(letters, roles, trace, axes, level, names)
    if not main:
        return Cells(letters, roles, names)
    dots = empty(size)
    for layer in (*main, *beside):
        dots |= layer.dots
    shape = glyphs(dots, level)
    count = np.zeros_like(roles)
    for layer in main:
        own = cells_of(layer.dots)
        count += own
        roles[own] = names.index(layer.role)
    only_interval = np.zeros(roles.shape, dtype=np.bool_)
    for layer in beside:
        own = cells_of(layer.dots) & (count == 0)
        roles[own], only_interval[own] = names.index(layer.role), True
    seen = (count > 0) | only_interval
    letters[seen] = shape[seen]
    _letter_cells(letters, main, count, level)
    if level in LETTERS:
        letters[only_interval] = _INTERVAL
        letters[count > 1] = BOTH
    roles[count > 1] = names.index("both")
    return Cells(letters, roles, names)


def _letter_cells(letters: Letters, main: list[_Layer], count: IndexArray, level: Level) -> None:
    """Letters in the place of dots, where a trace has a cell alone."""
    for layer in main:
        own = cells_of(layer.dots) & (count == 1)
        if level in LETTERS or layer.alone:
            letters[own] = layer.letter
        elif layer.open:
            marked = own[:, _FIRST::_EVERY]
            # One a column: where the curve is steep, the highest.
            marked = marked & (np.cumsum(marked, axis=0) == 1)
            letters[:, _FIRST::_EVERY][marked] = layer.letter


def _places(x: FloatArray, y: FloatArray, axes: tuple[Axis, Axis]) -> tuple[FloatArray, FloatArray]:
    """Places in cells from the left and from the top."""
    return axes[0].place(x), axes[1].cells - axes[1].place(y)


def _curve_layer(trace: Trace, axes: tuple[Axis, Axis], size: tuple[int, int]) -> _Layer:
    across, down = _places(trace.x, trace.y, axes)
    points = trace.form == "points"
    if points:
        dots = point_dots(across, down, size)
    else:
        dots = curve_dots(across, down, size, _PATTERNS.get(trace.form, SOLID))
    return _Layer(dots, trace.role, letter_of(trace), points and bool(trace.letter), trace.form == "open")


def _interval_layer(trace: Trace, axes: tuple[Axis, Axis], size: tuple[int, int]) -> _Layer:
    assert trace.low is not None
    assert trace.high is not None
    if _FEW * len(trace.x) > size[0]:
        dots = empty(size)
        for end in (trace.low, trace.high):
            dots |= curve_dots(*_places(trace.x, end, axes), size, DOTTED)
    else:
        gaps = np.full(len(trace.x), np.nan)
        x = np.column_stack([trace.x, trace.x, gaps]).ravel()
        y = np.column_stack([trace.low, trace.high, gaps]).ravel()
        dots = curve_dots(*_places(x, y, axes), size, Pattern(1, 2))
    return _Layer(dots, trace.role, _INTERVAL, False)


# Histograms


def _column_values(trace: Trace, axis: Axis) -> FloatArray:
    """The value of the bin in the middle of each column, NaN beside the bins."""
    middle = axis.transform.back(axis.transformed(0.0) + np.arange(axis.cells) * _step(axis))
    at = np.searchsorted(trace.x, middle, side="right") - 1
    # The ends of the axis are the first and the last edge, give or take a rounding.
    slack = 1e-9 * (float(trace.x[-1]) - float(trace.x[0]))
    inside = (middle >= trace.x[0] - slack) & (middle <= trace.x[-1] + slack)
    return np.where(inside, trace.y[np.clip(at, 0, len(trace.y) - 1)], np.nan)


def _step(axis: Axis) -> float:
    return (axis.span[1] - axis.span[0]) / max(axis.cells - 1, 1)


def _add_histogram(
    letters: Letters, roles: IndexArray, trace: Trace, axes: tuple[Axis, Axis], level: Level, names: tuple[str, ...]
) -> None:
    """A filled body, or an outline over what is there."""
    if len(trace.x) < 2:
        return
    values = _column_values(trace, axes[0])
    height = np.where(values > 0.0, axes[1].place(values), 0.0)
    rows = letters.shape[0]
    if trace.form == "filled":
        _fill(letters, roles, height, level, names.index(trace.role))
        return
    steps = _PLAIN_STEPS if level == "ascii" else _STEPS
    seen = np.isfinite(height) & (height > 0.0)
    level_row = np.where(seen, np.clip(np.floor(np.where(seen, height, 0.0)), -1, rows), -1).astype(np.int64)
    before = -1
    for column, now in enumerate(level_row.tolist()):
        for row, step in _outline(before, now):
            if 0 <= row < rows:
                at = (rows - 1 - row, column)
                shared = letters[at] != " "
                letters[at] = steps[step]
                roles[at] = names.index("both" if shared else trace.role)
        before = now


def _fill(letters: Letters, roles: IndexArray, height: FloatArray, level: Level, role: int) -> None:
    rows = letters.shape[0]
    up = np.arange(rows)[::-1, None]
    eighths = np.clip(np.rint(8.0 * (np.nan_to_num(height)[None, :] - up)), 0, 8).astype(np.int64)
    # What is there is seen, however little.
    eighths[-1] = np.maximum(eighths[-1], height > 0.0)
    if level in LETTERS:
        shape = np.where(eighths >= 4, "#", " ")
        shape[-1] = np.where(height > 0.0, "#", " ")
    elif level == "half":
        shape = np.where(eighths >= 6, "█", np.where(eighths > 0, "▄", " "))
    else:
        shape = _EIGHTHS[eighths]
    seen = shape != " "
    letters[seen], roles[seen] = shape[seen], role


def _outline(before: int, now: int) -> list[tuple[int, str]]:
    """(row, step) of a column whose level is `now` after a column at `before`; -1 is below all."""
    if now == before:
        return [(now, "flat")]
    low, high = min(before, now), max(before, now)
    between = [(row, "up") for row in range(low + 1, high)]
    rises = now > before
    return [(high, "rise" if rises else "fall"), *between, (low, "foot" if rises else "toe")]
