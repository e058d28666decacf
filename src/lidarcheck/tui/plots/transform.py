"""Axes: linear, logarithmic and symmetric logarithmic; what they span, and which cell a value stands in.

A value goes through three forms: as it is in the data, transformed (what the axis is even in), and as a place in cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray

__all__ = ["SCALES", "Axis", "Scale", "Span", "Transform", "limits", "next_scale", "panned", "zoomed"]

Scale = Literal["lin", "log", "symlog"]
SCALES: tuple[Scale, ...] = ("lin", "log", "symlog")
Span = tuple[float, float]
_LEAST = 1e-9
"""An axis spans at least this part of its numbers: below, doubles cannot tell the cells apart."""


@dataclass(frozen=True)
class Transform:
    """`scale`: what the axis is even in. `near`: of symlog, below which |x| it is about linear."""

    scale: Scale = "lin"
    near: float = 1.0

    @classmethod
    def of(cls, scale: Scale, values: npt.ArrayLike) -> Transform:
        """The transform of an axis that shows `values`: symlog is linear up to half the smallest |x| above 0."""
        sizes = np.abs(np.asarray(values, dtype=np.float64).ravel())
        sizes = sizes[np.isfinite(sizes) & (sizes > 0.0)]
        return cls(scale, 0.5 * float(sizes.min()) if sizes.size else 1.0)

    def to(self, values: npt.ArrayLike) -> FloatArray:
        """Values as the axis is even in, shape kept; NaN for what it cannot show, as 0 on a logarithmic one."""
        x = np.asarray(values, dtype=np.float64)
        x = np.where(np.isfinite(x), x, np.nan)
        if self.scale == "log":
            return np.log10(x, out=np.full(x.shape, np.nan), where=x > 0.0)
        if self.scale == "symlog":
            return np.asarray(np.sign(x) * np.log10(1.0 + np.abs(x) / self.near))
        return x

    def back(self, transformed: npt.ArrayLike) -> FloatArray:
        """Values from what the axis is even in."""
        t = np.asarray(transformed, dtype=np.float64)
        if self.scale == "log":
            return np.asarray(10.0 ** np.clip(t, -300.0, 300.0))
        if self.scale == "symlog":
            return np.asarray(np.sign(t) * self.near * (10.0 ** np.minimum(np.abs(t), 300.0) - 1.0))
        return t


@dataclass(frozen=True)
class Axis:
    """A transform, what is seen of it (`span`, transformed), and how many cells show that."""

    transform: Transform
    span: Span
    cells: int

    def place(self, values: npt.ArrayLike) -> FloatArray:
        """Where values stand, in cells: the ends of the span are the middles of the first and the last one."""
        low, high = self.span
        return np.asarray((self.transform.to(values) - low) / (high - low) * max(self.cells - 1, 1) + 0.5)

    def cell(self, value: float) -> int | None:
        """The cell of one value; None where it is not seen."""
        at = float(self.place(value))
        return int(at) if 0.0 <= at < self.cells else None

    def transformed(self, cell: float) -> float:
        """What stands in the middle of a cell, transformed."""
        low, high = self.span
        return low + cell / max(self.cells - 1, 1) * (high - low)

    def value(self, cell: float) -> float:
        """The value in the middle of a cell."""
        return float(self.transform.back(self.transformed(cell)))


def limits(transformed: FloatArray, margin: float = 0.0, room: float | None = None) -> Span:
    """What an axis must span to show all finite numbers, with a part of that on both sides; never nothing: `room` on
    both sides of a single number, by default a twentieth of it.
    """
    good = transformed[np.isfinite(transformed)]
    if not good.size:
        return 0.0, 1.0
    low, high = float(good.min()), float(good.max())
    if high - low <= _LEAST * max(abs(low), abs(high), 1e-300) or not np.isfinite(high - low):
        room = room or 0.05 * max(abs(low), abs(high)) or 0.5
        return low - room, high + room
    return low - margin * (high - low), high + margin * (high - low)


def zoomed(span: Span, about: float, by: float) -> Span:
    """The span, `by` times narrower, with `about` where it was; as it was where doubles would not tell cells apart."""
    low, high = about - (about - span[0]) / by, about + (span[1] - about) / by
    return (low, high) if 1e12 > high - low > 1e-6 * _LEAST + _LEAST * max(abs(low), abs(high)) else span


def panned(span: Span, part: float) -> Span:
    """The span moved by a part of itself."""
    by = part * (span[1] - span[0])
    return span[0] + by, span[1] + by


def next_scale(now: Scale, values: npt.ArrayLike) -> Scale:
    """The scale after this one that can show the values: a logarithmic axis shows nothing below 0."""
    x = np.asarray(values, dtype=np.float64)
    able = [scale for scale in SCALES if scale != "log" or bool(np.any(x > 0.0) and not np.any(x < 0.0))]
    return able[(able.index(now) + 1) % len(able)] if now in able else able[0]
