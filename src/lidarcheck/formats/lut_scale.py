"""The whole numbers that stand for a blooming table's shares in an editor: seven decades in a thousand steps."""

from __future__ import annotations

import math

from lidarcheck.errors import UsageError

__all__ = ["SCALE_MAX", "scaled_of_y", "y_of_scaled"]

SCALE_MAX = 1000
"""The scaled value of Y = 1."""

_STEP = 0.007
"""Decades a step."""


def scaled_of_y(y: float) -> int:
    """The whole number 0 ... 1000 that stands for Y in [0, 1]: 0 for Y = 0 alone, 1 for all else up to 1e-7."""
    if y == 0.0:
        return 0
    return min(max(round(SCALE_MAX + math.log10(y) / _STEP), 1), SCALE_MAX)


def y_of_scaled(scaled: int) -> float:
    """The Y of a whole number 0 ... 1000; `UsageError` for any other."""
    if isinstance(scaled, bool) or not 0 <= scaled <= SCALE_MAX or scaled != int(scaled):
        raise UsageError(f"scaled Y = {scaled} is out of range", fix=f"use a whole number from 0 to {SCALE_MAX}")
    return 0.0 if scaled == 0 else float(10.0 ** (-_STEP * (SCALE_MAX - scaled)))
