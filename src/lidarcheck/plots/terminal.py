"""Small plots of text, for a terminal: the one place that knows plotext.

Bins and logarithms are taken here, in numpy; plotext is given plain numbers and the ticks' texts. Curves differ by
their marks; colour, where it is asked for, only repeats that.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["HIGHEST", "LOWEST", "NARROWEST", "WIDEST", "Series", "curves", "histogram", "two_curves"]

NARROWEST, WIDEST = 40, 200
LOWEST, HIGHEST = 8, 60
MARKS = ("·", "#", "o", "+")
PLAIN_MARKS = (".", "#", "o", "+")
COLOURS = ("cyan", "orange", "green", "magenta")
_PLAIN = str.maketrans("┌┐└┘┤├┬┴┼─│", "+++++++++-|")
_FIGURE = threading.Lock()
"""Plotext draws into one figure that the whole process shares."""

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """One curve: its name in the legend, and `y` over `x`, shapes (n,); NaN leaves a gap."""

    name: str
    x: npt.ArrayLike
    y: npt.ArrayLike


def two_curves(
    x: npt.ArrayLike,
    before: npt.ArrayLike,
    after: npt.ArrayLike,
    *,
    names: tuple[str, str] = ("before", "after"),
    **style: Any,
) -> str:
    """Two curves over the same x; `style` is that of `curves`."""
    return curves([Series(names[0], x, before), Series(names[1], x, after)], **style)


def histogram(
    samples: Sequence[tuple[str, npt.ArrayLike]], *, bins: int = 40, log_x: bool = False, **style: Any
) -> str:
    """How often values occur, for up to four sets of samples on shared bins; `log_x` bins their logarithms.

    Values that are not finite, and with `log_x` those not above 0, are left out.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        values = [_log10(sample) if log_x else np.asarray(sample, dtype=np.float64).ravel() for _, sample in samples]
    values = [value[np.isfinite(value)] for value in values]
    everything = np.concatenate([*values, np.empty(0)])
    low, high = (float(everything.min()), float(everything.max())) if everything.size else (0.0, 1.0)
    edges = np.linspace(low, high if high > low else low + 1.0, max(bins, 1) + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    x = 10.0**middle if log_x else middle
    counted = [np.histogram(value, edges)[0].astype(np.float64) for value in values]
    drawn = [Series(name, x, y) for (name, _), y in zip(samples, counted, strict=True)]
    return curves(drawn, log_x=log_x, **{"y_label": "count", **style})


def curves(
    series: Sequence[Series],
    *,
    x_label: str = "",
    y_label: str = "",
    width: int = 80,
    height: int = 15,
    log_x: bool = False,
    log_y: bool = False,
    colour: bool = False,
    plain: bool = False,
) -> str:
    """Up to four curves as text of `height` lines, none wider than `width` characters, the last ending in a newline.

    `width` is kept within 40 ... 200 and `height` within 8 ... 60. The first line holds the y label and the legend, the
    last one the x label. `log_x`, `log_y`: what is not above 0 is left out. `colour` adds escape sequences, `plain`
    keeps to ASCII. Without a single finite value the text says so in the plot's place.
    """
    width, height = min(max(width, NARROWEST), WIDEST), min(max(height, LOWEST), HIGHEST)
    marks = PLAIN_MARKS if plain else MARKS
    if len(series) > len(marks):
        raise ValueError(f"{len(series)} curves; there are {len(marks)} marks")
    points = [_points(one, log_x, log_y) for one in series]
    head = _head(y_label, [f"{mark} {one.name}" for mark, one in zip(marks, series, strict=False)], width)
    rows = height - len(head) - 1
    finite = np.concatenate([np.empty((0, 2)), *points])
    finite = finite[np.isfinite(finite).all(axis=1)]
    if not len(finite):
        body = ["", "(nothing to draw)".center(width).rstrip(), *[""] * max(rows - 2, 0)]
    else:
        body = _canvas(points, finite, marks, (width, rows), (log_x, log_y), colour)
    text = "\n".join([*head, *body, _fit(x_label, width).center(width).rstrip()]) + "\n"
    return _ascii(text) if plain else text


def _points(one: Series, log_x: bool, log_y: bool) -> FloatArray:
    """The curve's points, shape (n, 2), in what is drawn; NaN where there is a gap."""
    x, y = np.asarray(one.x, dtype=np.float64).ravel(), np.asarray(one.y, dtype=np.float64).ravel()
    if x.shape != y.shape:
        raise ValueError(f"curve {one.name}: {x.size} x and {y.size} y")
    columns = np.column_stack([_log10(x) if log_x else x, _log10(y) if log_y else y])
    columns[~np.isfinite(columns).all(axis=1)] = np.nan
    return columns


def _log10(values: npt.ArrayLike) -> FloatArray:
    """Decimal logarithm; NaN for what has none."""
    v = np.asarray(values, dtype=np.float64).ravel()
    return np.log10(v, out=np.full(v.shape, np.nan), where=np.isfinite(v) & (v > 0.0))


def _head(y_label: str, legend: Sequence[str], width: int) -> list[str]:
    """The y label and the legend: in one line where they fit, else in two."""
    names = _fit("   ".join(legend), width)
    if not y_label or len(y_label) + 3 + len(names) <= width:
        return [f"{y_label}{names.rjust(width - len(y_label))}"]
    return [_fit(y_label, width), names.rjust(width)]


def _fit(text: str, width: int) -> str:
    """The text, cut where it is too long for a line."""
    return text if len(text) <= width else f"{text[: width - 3]}..."


def _ascii(text: str) -> str:
    return text.translate(_PLAIN).encode("ascii", "replace").decode("ascii")


def _canvas(
    points: Sequence[FloatArray],
    finite: FloatArray,
    marks: Sequence[str],
    size: tuple[int, int],
    logs: tuple[bool, bool],
    colour: bool,
) -> list[str]:
    """The lines of the frame with its curves and ticks."""
    import plotext  # type: ignore[import-untyped]

    limits = [_limits(finite[:, axis], margin) for axis, margin in ((0, 0.0), (1, 0.04))]
    with _FIGURE:
        plotext.clear_figure()
        try:
            plotext.theme("clear")
            plotext.limit_size(False, False)
            plotext.plotsize(*size)
            plotext.xlim(*limits[0])
            plotext.ylim(*limits[1])
            plotext.xticks(*_ticks(*limits[0], max(size[0] // 12, 3), logs[0]))
            plotext.yticks(*_ticks(*limits[1], max(size[1] // 3, 3), logs[1]))
            for line, mark, shade in zip(points, marks, COLOURS, strict=False):
                for piece in _pieces(line):
                    x, y = piece.T.tolist()
                    plotext.plot(x, y, marker=mark, color=shade if colour else None)
            drawn = plotext.build()
            text = drawn if colour else plotext.uncolorize(drawn)
        finally:
            plotext.clear_figure()
    return [line.rstrip() for line in str(text).rstrip("\n").split("\n")][: size[1]]


def _limits(values: FloatArray, margin: float) -> tuple[float, float]:
    """What an axis spans; never nothing, and never more than a double holds."""
    low, high = float(values.min()), float(values.max())
    span = high - low
    if not math.isfinite(span) or span <= 1e-9 * max(abs(low), abs(high)):
        room = 0.05 * max(abs(low), abs(high)) or 0.5
        return low - room, high + room
    return low - margin * span, high + margin * span


def _ticks(low: float, high: float, most: int, log: bool) -> tuple[list[float], list[str]]:
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


def _pieces(line: FloatArray) -> list[FloatArray]:
    """The parts of a curve between its gaps."""
    good = np.isfinite(line).all(axis=1)
    borders = np.flatnonzero(np.diff(good.astype(np.int8))) + 1
    return [piece for piece in np.split(line, borders) if len(piece) and np.isfinite(piece).all()]
