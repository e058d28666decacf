"""Ticks of an axis, none of whose texts touches another: data's own values, or round numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.figures.axes.scales import round_ticks
from lidarcheck.tui.plots.transform import Axis

__all__ = ["Tick", "own_ticks", "spread_ticks", "ticks_across", "ticks_up"]

Tick = tuple[float, str]
"""Where it stands, transformed, and its text."""
_DECADES, _SEVERAL = 12, 2.0


def own_ticks(axis: Axis, values: npt.ArrayLike) -> list[Tick]:
    """The data's own values as ticks, as many as have room: the ends and zero first, then where the gaps are widest."""
    own = np.unique(np.asarray(values, dtype=np.float64))
    return spread_ticks(axis, [(float(axis.transform.to(x)), f"{x:g}") for x in own if np.isfinite(x)])


def ticks_across(axis: Axis) -> list[Tick]:
    """Round numbers for an axis from left to right."""
    return spread_ticks(axis, _round(axis, max(axis.cells // 7, 2)))


def ticks_up(axis: Axis) -> list[Tick]:
    """Round numbers for an axis upward, with a row between them; of several decades whole ones, both ends first."""
    found = _round(axis, max(axis.cells // 2 if axis.transform.scale == "lin" else axis.cells, 2))
    if axis.transform.scale == "log" and axis.span[1] - axis.span[0] >= _SEVERAL:
        found = [tick for tick in found if abs(tick[0] - round(tick[0])) < 1e-9]
    return _with_room(axis, found, _LINES)


def _round(axis: Axis, most: int) -> list[Tick]:
    low, high = axis.span
    scale = axis.transform.scale
    if scale == "lin" or (scale == "log" and high - low >= 0.5):
        at, texts = round_ticks(low, high, most, scale == "log")
        return list(zip(at, texts, strict=True))
    ends = axis.transform.back([low, high])
    if scale == "log" or _about_linear(*ends.tolist()):
        values, texts = round_ticks(float(ends[0]), float(ends[1]), most, False)
        return [(float(t), text) for t, text in zip(axis.transform.to(values), texts, strict=True) if math.isfinite(t)]
    top = math.floor(math.log10(max(abs(float(ends[0])), abs(float(ends[1])))))
    sizes = [part * 10.0**decade for decade in range(top, top - _DECADES, -1) for part in (1, 5, 2)]
    found = [0.0, *(sign * size for size in sizes if size > axis.transform.near for sign in (1, -1))]
    return [(float(axis.transform.to(x)), f"{x:g}") for x in found]


def _about_linear(low: float, high: float) -> bool:
    """Whether round steps serve a part of a symmetric logarithmic axis: both ends of one sign and size."""
    return low * high > 0.0 and max(abs(low), abs(high)) < 3.0 * min(abs(low), abs(high))


def spread_ticks(axis: Axis, candidates: Sequence[Tick]) -> list[Tick]:
    """Of the ticks that are seen as many as have room for their texts side by side, ordered along the axis.

    The first and the last one come first, then zero, then always the one that is furthest from those there are.
    """
    return _with_room(axis, candidates, _SIDE_BY_SIDE)


class _Room(NamedTuple):
    """How texts of ticks take room along their axis."""

    apart: int
    lines: bool


_SIDE_BY_SIDE, _LINES = _Room(2, False), _Room(1, True)
"""Beside each other, two blanks between them; below each other, a line between them."""


def _with_room(axis: Axis, candidates: Sequence[Tick], room: _Room) -> list[Tick]:
    low, high = axis.span
    last = max(axis.cells - 1, 1)
    seen = [tick for tick in candidates if low - 1e-9 <= tick[0] <= high + 1e-9]
    if not seen:
        return []
    cell = np.array([round((at - low) / (high - low) * last) for at, _ in seen], dtype=np.int64)
    wide = np.array([1 if room.lines else len(text) for _, text in seen], dtype=np.int64)
    start = np.clip(cell - wide // 2, 0, np.maximum(axis.cells - wide, 0))
    order = np.argsort(cell, kind="stable")
    zero = [i for i, (_, text) in enumerate(seen) if text == "0"]
    chosen: list[int] = []

    def fits(one: int) -> bool:
        return all(
            start[one] >= start[other] + wide[other] + room.apart or start[other] >= start[one] + wide[one] + room.apart
            for other in chosen
        )

    for one in (int(order[0]), int(order[-1]), *zero):
        if one not in chosen and fits(one):
            chosen.append(one)
    left = [i for i in range(len(seen)) if i not in chosen]
    while left:
        left = [one for one in left if fits(one)]
        if left:
            best = max(left, key=lambda one: (min(abs(int(cell[one] - cell[other])) for other in chosen), -one))
            chosen.append(best)
            left.remove(best)
    return [seen[i] for i in sorted(chosen, key=lambda one: (cell[one], one))]
