"""What an axis spans and where its ticks stand: the same for pictures of text, SVG and PNG."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray

__all__ = ["equal_spans", "limits", "log10", "one_a_cell", "round_ticks"]

Span = tuple[float, float]

_MOST_EMPTY = 4.0
"""Axes of one scale may leave all but this part of the room empty; else the picture says that it is stretched."""


def limits(values: FloatArray, margin: float) -> tuple[float, float]:
    """What an axis spans; never nothing, and never more than a double holds."""
    low, high = float(values.min()), float(values.max())
    span = high - low
    if not math.isfinite(span) or span <= 1e-9 * max(abs(low), abs(high)):
        room = 0.05 * max(abs(low), abs(high)) or 0.5
        return low - room, high + room
    return low - margin * span, high + margin * span


def round_ticks(low: float, high: float, most: int, log: bool) -> tuple[list[float], list[str]]:
    """Round numbers between the limits, and how they are written; whole decades and parts of them on a log axis."""
    if log and high - low >= 0.5:
        for parts in ((1, 2, 5), (1, 3), (1,)):
            at = [d + math.log10(p) for d in range(math.floor(low), math.ceil(high) + 1) for p in parts]
            at = [v for v in at if low - 1e-9 <= v <= high + 1e-9]
            if len(at) <= most:
                return at, [_power(v) for v in at]
        at = at[:: -(-len(at) // most)]
        return at, [_power(v) for v in at]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step for step in (power, 2.0 * power, 5.0 * power, 10.0 * power) if step >= rough * (1.0 - 1e-9))
    numbers = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    at = [float(v) for v in numbers]
    if log:
        return at, [_power(v) for v in at]
    written = [f"{v:.{digits}f}" if digits < 7 and abs(v) < 1e7 else f"{v:.4g}" for v in at]
    return at, [text.replace("-0", "0") if float(text) == 0.0 else text for text in written]


def _power(exponent: float) -> str:
    return f"{float(f'{10.0**exponent:.3g}'):g}"


def log10(values: npt.ArrayLike) -> FloatArray:
    """Decimal logarithm; NaN for what has none."""
    v = np.asarray(values, dtype=np.float64).ravel()
    return np.log10(v, out=np.full(v.shape, np.nan), where=np.isfinite(v) & (v > 0.0))


def equal_spans(x: Span, y: Span, width: float, height: float) -> tuple[Span, Span, bool]:
    """The spans, one of them widened around its middle so that a length is the same on both axes, and whether it was.

    `width`, `height`: of the room, in one unit. Where the picture would fill less than a quarter of the room the spans
    stay as they are.
    """
    wide, high = x[1] - x[0], y[1] - y[0]
    scale = max(wide / width, high / height)
    filled = min(wide / width, high / height) / scale
    if filled * _MOST_EMPTY < 1.0:
        return x, y, False
    return _around(x, scale * width), _around(y, scale * height), True


def one_a_cell(x: FloatArray, y: FloatArray, spans: tuple[Span, Span], cells: tuple[int, int]) -> FloatArray:
    """One point of those that fall into the same cell of a grid over the spans, in their order, shape (n, 2)."""
    good = np.isfinite(x) & np.isfinite(y)
    points = np.column_stack([x[good], y[good]])
    column, row = (
        np.clip(np.rint((points[:, axis] - span[0]) / (span[1] - span[0]) * number), 0, number).astype(np.int64)
        for axis, (span, number) in enumerate(zip(spans, cells, strict=True))
    )
    first = np.full((cells[0] + 1) * (cells[1] + 1), -1)
    # Of several values for one place numpy keeps the last: backwards, the first point.
    first[(column * (cells[1] + 1) + row)[::-1]] = np.arange(len(points))[::-1]
    return np.asarray(points[np.sort(first[first >= 0])], dtype=np.float64)


def _around(span: Span, length: float) -> Span:
    middle = 0.5 * (span[0] + span[1])
    return middle - 0.5 * length, middle + 0.5 * length
