"""Points as counts a cell: one scale for both sides, a window that is zoomed and moved, axes in 7-bit characters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.figures.axes.scales import round_ticks
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["SIDES", "Side", "Window", "class_words", "classes", "cloud_lines", "counts", "fitted", "over_lines"]

LEFT = 6
"""Columns of an axis upward: a tick's text and the line."""
BELOW = 2
"""Rows of an axis across."""
_MARGIN = 1.06
_MARKS = ".:#"
_REAL, _SIMULATED, _BOTH = "#", "o", "%"


@dataclass(frozen=True)
class Side:
    """A view along an axis: which column of X, Y, Z goes across, which way, and which upward."""

    words: str
    across: int
    sign: float
    up: int

    @property
    def names(self) -> tuple[str, str]:
        """The names of both axes."""
        return "xyz"[self.across], "xyz"[self.up]

    def places(self, xyz_m: FloatArray) -> FloatArray:
        """Points as they are seen [m], shape (n, 2): across to the right, and upward."""
        return np.column_stack([self.sign * xyz_m[:, self.across], xyz_m[:, self.up]])


SIDES = {
    "above": Side("from above", 0, 1.0, 1),
    "behind": Side("from behind", 1, -1.0, 2),
    "side": Side("from the side", 0, 1.0, 2),
}
"""What can be seen; from behind is as the sensor sees it, left on the left."""


@dataclass(frozen=True)
class Window:
    """What is seen: its middle, across and upward, and the metres that a column has; a row has twice as many."""

    middle_m: tuple[float, float]
    column_m: float

    def zoomed(self, about_m: tuple[float, float], by: float) -> Window:
        """`by` times nearer, with a point where it was."""
        x, y = (at + (middle - at) / by for at, middle in zip(about_m, self.middle_m, strict=True))
        return Window((x, y), min(max(self.column_m / by, 1e-3), 1e3))

    def moved(self, across_m: float, up_m: float) -> Window:
        """The same scale elsewhere."""
        return replace(self, middle_m=(self.middle_m[0] + across_m, self.middle_m[1] + up_m))

    def edges(self, size: tuple[int, int]) -> tuple[float, float, float, float]:
        """Left, right, bottom and top [m] of so many columns and rows."""
        half = 0.5 * size[0] * self.column_m, size[1] * self.column_m
        (x, y) = self.middle_m
        return x - half[0], x + half[0], y - half[1], y + half[1]

    def cells(self, places: FloatArray, size: tuple[int, int]) -> IndexArray:
        """The column and the row of each place, shapes (n, 2) and (n, 2); it may lie outside."""
        left, _, _, top = self.edges(size)
        across, down = (places[:, 0] - left) / self.column_m, (top - places[:, 1]) / (2.0 * self.column_m)
        return np.floor(np.column_stack([across, down])).astype(np.int64)

    def cell(self, at_m: tuple[float, float], size: tuple[int, int]) -> tuple[int, int]:
        """The column and the row of one place."""
        column, row = self.cells(np.array([at_m]), size)[0].tolist()
        return column, row


def fitted(places: FloatArray, size: tuple[int, int], outer: float = 0.0) -> Window:
    """The window that shows all of the points, shape (n, 2), but for `outer` percent at either end."""
    if not len(places):
        return Window((0.0, 0.0), 1.0)
    low, high = np.percentile(places, [outer, 100.0 - outer], axis=0)
    span = np.maximum(high - low, 0.1) * _MARGIN
    scale = max(span[0] / max(size[0], 1), span[1] / (2.0 * max(size[1], 1)))
    middle = 0.5 * (low + high)
    return Window((float(middle[0]), float(middle[1])), float(scale))


def counts(places: FloatArray, window: Window, size: tuple[int, int]) -> IndexArray:
    """Points in each cell, shape (rows, columns), the upper row first."""
    column, row = window.cells(places, size).T
    inside = (column >= 0) & (column < size[0]) & (row >= 0) & (row < size[1])
    return np.bincount(row[inside] * size[0] + column[inside], minlength=size[0] * size[1]).reshape(size[::-1])


def classes(*sides: IndexArray) -> tuple[int, int]:
    """From how many points a cell is `:` and `#`, one scale for all sides."""
    some = np.concatenate([side[side > 0] for side in sides])
    if not len(some) or np.median(some) <= 5:
        return 2, 5
    middle, many = (_round(float(value)) for value in np.percentile(some, [40.0, 80.0]))
    return max(middle, 2), max(many, middle + 1, 5)


def _round(value: float) -> int:
    size = float(10.0 ** np.floor(np.log10(max(value, 1.0))))
    return round(max(step for step in (1, 2, 5) if step * size <= value) * size)


def class_words(limits: tuple[int, int]) -> str:
    """What the marks stand for."""
    first = "1" if limits[0] == 2 else f"1-{limits[0] - 1}"
    middle = str(limits[0]) if limits[1] - limits[0] == 1 else f"{limits[0]}-{limits[1] - 1}"
    return f". {first}  : {middle}  # {limits[1]} and more a cell"


def cloud_lines(count: IndexArray, limits: tuple[int, int], role: Role) -> list[list[tuple[str, Role]]]:
    """The marks of one side, cell by cell."""
    level = (count > 0).astype(np.int64) + (count >= limits[0]) + (count >= limits[1])
    marks = np.array([" ", *_MARKS])[level]
    return [[(str(mark), role) for mark in row] for row in marks]


def over_lines(real: IndexArray, simulated: IndexArray) -> list[list[tuple[str, Role]]]:
    """Both sides over each other: they differ by form first."""
    looks: list[tuple[str, Role]] = [(" ", "text"), (_REAL, "real"), (_SIMULATED, "now"), (_BOTH, "both")]
    level = (real > 0).astype(np.int64) + 2 * (simulated > 0)
    return [[looks[i] for i in row] for row in level.tolist()]


def with_axes(
    cells: list[list[tuple[str, Role]]], window: Window, side: Side, cursor: tuple[int, int] | None
) -> list[Line]:
    """Cells between their axes; `cursor`: the column and row that is marked."""
    size = len(cells[0]) if cells else 0, len(cells)
    left, right, bottom, top = window.edges(size)
    rows = {
        min(int((top - place) / (top - bottom) * size[1]), size[1] - 1): word
        for place, word in zip(*round_ticks(bottom, top, max(size[1] // 3, 2), False), strict=True)
    }
    lines: list[Line] = []
    for at, row in enumerate(cells):
        if cursor is not None and cursor[1] == at and 0 <= cursor[0] < size[0]:
            row = [*row[: cursor[0]], (row[cursor[0]][0], "cursor"), *row[cursor[0] + 1 :]]
        word = f"{side.names[1]}[m]" if at == 0 else rows.get(at, "")
        runs = [("".join(mark for mark, _ in run), role) for role, run in groupby(row, lambda one: one[1])]
        lines.append((*line(f"{word[: LEFT - 1]:>{LEFT - 1}}|", "dim"), *runs))
    return [*lines, *_axis(left, right, size[0], side)]


def _axis(left: float, right: float, columns: int, side: Side) -> list[Line]:
    """The axis across and its ticks; a text that has no room is left out."""
    border, words = ["-"] * columns, [" "] * (LEFT + columns)
    unit = f"{side.names[0]}[m]"
    words[-len(unit) :] = unit
    for place, _ in zip(*round_ticks(left, right, max(columns // 9, 3), False), strict=True):
        at = min(max(int((place - left) / (right - left) * columns), 0), columns - 1)
        border[at] = "+"
        word = f"{side.sign * place + 0.0:.10g}"
        start = LEFT + at - len(word) // 2
        if start + len(word) < len(words) and not "".join(words[max(start - 2, 0) : start + len(word) + 2]).strip():
            words[start : start + len(word)] = word
    return [line(f"{'':{LEFT - 1}}+{''.join(border)}", "dim"), line("".join(words).rstrip(), "dim")]
