"""Curves and points as dots: four rows and two columns of them a cell, one array of booleans a curve."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray

__all__ = ["ACROSS", "DASHED", "DOTTED", "DOWN", "SOLID", "Pattern", "cells_of", "curve_dots", "empty", "point_dots"]

DOWN, ACROSS = 4, 2
"""Dots of a cell."""


class Pattern(NamedTuple):
    """Of every `of` dots along a curve the first `on` are seen."""

    on: int
    of: int


SOLID, DOTTED, DASHED = Pattern(1, 1), Pattern(1, 4), Pattern(4, 6)


def empty(size: tuple[int, int]) -> BoolArray:
    """No dots, for `size` (columns, rows) of cells: shape (rows * 4, columns * 2)."""
    return np.zeros((size[1] * DOWN, size[0] * ACROSS), dtype=np.bool_)


def cells_of(dots: BoolArray) -> BoolArray:
    """Which cells have a dot, shape (rows, columns)."""
    rows, columns = dots.shape[0] // DOWN, dots.shape[1] // ACROSS
    return np.asarray(dots.reshape(rows, DOWN, columns, ACROSS).any(axis=(1, 3)))


def point_dots(across: FloatArray, down: FloatArray, size: tuple[int, int]) -> BoolArray:
    """The dots of points; `across`, `down`: their places in cells from the left and the top, NaN for none."""
    dots = empty(size)
    good = np.isfinite(across) & np.isfinite(down)
    _set(dots, ACROSS * across[good], DOWN * down[good])
    return dots


def curve_dots(across: FloatArray, down: FloatArray, size: tuple[int, int], pattern: Pattern = SOLID) -> BoolArray:
    """The dots of a curve through points in their order, with gaps where one is NaN.

    The pattern goes by the dot's column where the curve is flat and by its row where it is steep, so that an edit of
    one point leaves the rest of the picture as it was. A point between two gaps is always seen.
    """
    dots = empty(size)
    x, y = ACROSS * np.asarray(across, dtype=np.float64), DOWN * np.asarray(down, dtype=np.float64)
    good = np.isfinite(x) & np.isfinite(y)
    joined = good[:-1] & good[1:]
    starts = np.flatnonzero(joined)
    alone = good.copy()
    alone[:-1] &= ~joined
    alone[1:] &= ~joined
    _set(dots, x[alone], y[alone])
    if starts.size:
        x0, y0, x1, y1 = _clipped(x[starts], y[starts], x[starts + 1], y[starts + 1], dots.shape)
        if x0.size:
            _draw(dots, x0, y0, x1, y1, pattern)
    return dots


def _draw(dots: BoolArray, x0: FloatArray, y0: FloatArray, x1: FloatArray, y1: FloatArray, pattern: Pattern) -> None:
    steps = np.maximum(np.ceil(np.maximum(np.abs(x1 - x0), np.abs(y1 - y0))), 1.0).astype(np.int64)
    which = np.repeat(np.arange(len(steps)), steps + 1)
    first = np.concatenate([[0], np.cumsum(steps + 1)[:-1]])
    part = (np.arange(len(which)) - first[which]) / steps[which]
    x = x0[which] + part * (x1 - x0)[which]
    y = y0[which] + part * (y1 - y0)[which]
    if pattern.on < pattern.of:
        flat = (np.abs(x1 - x0) >= np.abs(y1 - y0))[which]
        along = np.where(flat, np.floor(x), np.floor(y)).astype(np.int64)
        seen = along % pattern.of < pattern.on
        x, y = x[seen], y[seen]
    _set(dots, x, y)


def _set(dots: BoolArray, x: FloatArray, y: FloatArray) -> None:
    inside = (x >= 0.0) & (y >= 0.0) & (x < dots.shape[1]) & (y < dots.shape[0])
    column: IndexArray = x[inside].astype(np.int64)
    row: IndexArray = y[inside].astype(np.int64)
    dots[row, column] = True


def _clipped(
    x0: FloatArray, y0: FloatArray, x1: FloatArray, y1: FloatArray, shape: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The parts of segments that lie within the picture (Liang and Barsky): a curve far outside costs nothing."""
    first, last = np.zeros(len(x0)), np.ones(len(x0))
    seen = np.ones(len(x0), dtype=np.bool_)
    for start, way, end in ((x0, x1 - x0, float(shape[1])), (y0, y1 - y0, float(shape[0]))):
        for direction, room in ((-way, start), (way, end - start)):
            still = direction == 0.0
            seen &= ~(still & (room < 0.0))
            at = np.divide(room, direction, out=np.zeros(len(x0)), where=~still)
            first = np.where(direction < 0.0, np.maximum(first, at), first)
            last = np.where(direction > 0.0, np.minimum(last, at), last)
    seen &= first <= last
    x0, y0, x1, y1, first, last = (part[seen] for part in (x0, y0, x1, y1, first, last))
    return x0 + first * (x1 - x0), y0 + first * (y1 - y0), x0 + last * (x1 - x0), y0 + last * (y1 - y0)
