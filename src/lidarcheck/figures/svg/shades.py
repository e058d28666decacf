"""The shades of a map: eleven from far below zero to far above it, or six from the least to the most.

They are the classes `n5` ... `n1`, `z0` ... `z5` of the page's CSS.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray

__all__ = ["LEVELS", "box", "levels_of", "shade", "shaded"]

LEVELS = 5
"""Shades to either side of zero."""


def shade(level: int) -> str:
    """The class of a shade, -5 ... 5."""
    return f"z{level}" if level >= 0 else f"n{-level}"


def levels_of(parts: FloatArray) -> IndexArray:
    """The shades of parts of the scale's reach, -1 ... 1; beyond that the last one, of NaN 0."""
    seen = np.isfinite(parts)
    level = np.zeros(parts.shape, dtype=np.int64)
    level[seen] = np.rint(np.clip(parts[seen], -1.0, 1.0) * LEVELS).astype(np.int64)
    return level


def shaded(level: IndexArray, seen: BoolArray, boxes: Callable[[BoolArray], str]) -> list[str]:
    """A path for each shade that there is; `boxes` draws the cells of a mask."""
    shades = np.unique(level[seen]).tolist()
    return [f'<path class="{shade(one)}" d="{boxes(seen & (level == one))}"/>' for one in shades]


def box(x: float, y: float, wide: float, high: float) -> str:
    """A box as a piece of a path."""
    return f"M{x:.1f} {y:.1f}h{wide:.1f}v{high:.1f}h{-wide:.1f}z"
