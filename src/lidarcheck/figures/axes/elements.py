"""One pair of axes as plain data: lines, dots, bands and cells, for text and images to draw alike.

Numbers are those that are drawn, so that on a logarithmic axis they are decimal logarithms; `scales.round_ticks` writes
them as the numbers that they stand for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.data import Grid

__all__ = ["Band", "Dots", "Line", "Subplot", "depth", "packed"]


@dataclass(frozen=True)
class Line:
    """A curve of the series number `series`; `filled` down to the axis; NaN is a gap.

    Without a series it is a reference, as y = x, or, `heavy`, a bar that stands out, as from quartile to quartile.
    """

    series: int | None
    x: FloatArray
    y: FloatArray
    filled: bool = False
    heavy: bool = False


@dataclass(frozen=True)
class Dots:
    """Single points of a series; without one rings that stand out, as at a median."""

    series: int | None
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True)
class Band:
    """What lies between `low` and `high` over `x`: an interval, or, `solid`, a body of its own."""

    series: int
    x: FloatArray
    low: FloatArray
    high: FloatArray
    solid: bool = False


@dataclass(frozen=True)
class Subplot:
    """One pair of axes with what is on it; `names`: of the series, in order.

    `y_names`: texts at 0, 1, 2 ... in the place of numbers. `equal`: both axes are lengths, to be drawn to one scale.
    `grid`: a map, on which nothing else is drawn. `more`: how many further series are not drawn;
    `absent`: the names of those that have nothing to draw.
    """

    title: str
    x_label: str
    y_label: str
    names: tuple[str, ...] = ()
    bands: tuple[Band, ...] = ()
    lines: tuple[Line, ...] = ()
    dots: tuple[Dots, ...] = ()
    grid: Grid | None = None
    log_x: bool = False
    log_y: bool = False
    y_names: tuple[str, ...] = ()
    equal: bool = False
    more: int = 0
    absent: tuple[str, ...] = ()

    def drawn(self) -> set[int]:
        """The series that something is drawn of."""
        series = [line.series for line in self.lines] + [dots.series for dots in self.dots]
        return {one for one in (*series, *(band.series for band in self.bands)) if one is not None}

    def points(self) -> FloatArray:
        """All finite points that the axes must hold, shape (n, 2)."""
        parts = [np.empty((0, 2))]
        for band in self.bands:
            parts += [np.column_stack([band.x, band.low]), np.column_stack([band.x, band.high])]
        parts += [np.column_stack([line.x, line.y]) for line in self.lines]
        parts += [np.column_stack([dots.x, dots.y]) for dots in self.dots]
        parts += [np.column_stack([one.x, np.zeros(len(one.x))]) for one in self.lines if one.filled and not self.log_y]
        points = np.concatenate(parts)
        return np.asarray(points[np.isfinite(points).all(axis=1)], dtype=np.float64)


def depth(dots: Dots) -> tuple[int, int]:
    """In which order dots are drawn: few are not buried under many, nor the small dot of the first under crosses."""
    return -len(dots.x).bit_length(), -(dots.series or 0)


def packed(lengths: Sequence[float], room: float) -> list[list[int]]:
    """Numbers of the entries of a legend, in rows none of which is longer than the room (but for a single entry)."""
    rows: list[list[int]] = []
    left = 0.0
    for i, length in enumerate(lengths):
        if not rows or length > left:
            rows.append([])
            left = room
        rows[-1].append(i)
        left -= length
    return rows
