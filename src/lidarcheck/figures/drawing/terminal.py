"""Small plots of text, for a terminal: the one place that knows plotext.

Bins and logarithms are taken here, in numpy; plotext is given plain numbers and the ticks' texts. Curves differ by
their marks; colour, where it is asked for, only repeats that.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.figures.drawing.scales import limits, log10, round_ticks

__all__ = [
    "COLOURS",
    "HIGHEST",
    "LOWEST",
    "MARKS",
    "NARROWEST",
    "PLAIN_MARKS",
    "WIDEST",
    "Series",
    "Stroke",
    "ascii_only",
    "canvas",
    "curves",
    "fit",
    "head_lines",
    "histogram",
    "two_curves",
]

NARROWEST, WIDEST = 40, 200
LOWEST, HIGHEST = 8, 60
MARKS = ("·", "#", "o", "+", "x", "*", "%", "@")
PLAIN_MARKS = (".", *MARKS[1:])
COLOURS = ("cyan", "orange", "green", "magenta", "blue", "red", "white", "gray")
_PLAIN = str.maketrans("┌┐└┘┤├┬┴┼─│", "+++++++++-|")
_FIGURE = threading.Lock()
"""Plotext draws into one figure that the whole process shares."""

FloatArray = npt.NDArray[np.float64]
Span = tuple[float, float]
Ticks = tuple[list[float], list[str]]


@dataclass(frozen=True)
class Stroke:
    """What the frame is given to draw: points, shape (n, 2), NaN for a gap, with one mark; a curve where `joined`."""

    points: FloatArray
    mark: str
    shade: str | None = None
    joined: bool = True


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
    """How often values occur, for up to eight sets of samples on shared bins; `log_x` bins their logarithms.

    Values that are not finite, and with `log_x` those not above 0, are left out.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        values = [log10(sample) if log_x else np.asarray(sample, dtype=np.float64).ravel() for _, sample in samples]
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
    """Up to eight curves as text of `height` lines, none wider than `width` characters, the last ending in a newline.

    `width` is kept within 40 ... 200 and `height` within 8 ... 60. The first line holds the y label and the legend, the
    last one the x label. `log_x`, `log_y`: what is not above 0 is left out. `colour` adds escape sequences, `plain`
    keeps to ASCII. Without a single finite value the text says so in the plot's place.
    """
    width, height = min(max(width, NARROWEST), WIDEST), min(max(height, LOWEST), HIGHEST)
    marks = PLAIN_MARKS if plain else MARKS
    if len(series) > len(marks):
        raise ValueError(f"{len(series)} curves; there are {len(marks)} marks")
    points = [_points(one, log_x, log_y) for one in series]
    head = head_lines(y_label, [f"{mark} {one.name}" for mark, one in zip(marks, series, strict=False)], width)
    rows = height - len(head) - 1
    finite = np.concatenate([np.empty((0, 2)), *points])
    finite = finite[np.isfinite(finite).all(axis=1)]
    if not len(finite):
        body = ["", "(nothing to draw)".center(width).rstrip(), *[""] * max(rows - 2, 0)]
    else:
        spans = (limits(finite[:, 0], 0.0), limits(finite[:, 1], 0.04))
        ticks = (round_ticks(*spans[0], max(width // 12, 3), log_x), round_ticks(*spans[1], max(rows // 3, 3), log_y))
        strokes = [Stroke(*drawn) for drawn in zip(points, marks, COLOURS, strict=False)]
        body = canvas(strokes, spans, ticks, (width, rows), colour)
    text = "\n".join([*head, *body, fit(x_label, width).center(width).rstrip()]) + "\n"
    return ascii_only(text) if plain else text


def _points(one: Series, log_x: bool, log_y: bool) -> FloatArray:
    """The curve's points, shape (n, 2), in what is drawn; NaN where there is a gap."""
    x, y = np.asarray(one.x, dtype=np.float64).ravel(), np.asarray(one.y, dtype=np.float64).ravel()
    if x.shape != y.shape:
        raise ValueError(f"curve {one.name}: {x.size} x and {y.size} y")
    columns = np.column_stack([log10(x) if log_x else x, log10(y) if log_y else y])
    columns[~np.isfinite(columns).all(axis=1)] = np.nan
    return columns


def head_lines(y_label: str, legend: Sequence[str], width: int) -> list[str]:
    """The y label and the legend: in one line where they fit, else in two."""
    names = fit("   ".join(legend), width)
    if not y_label or len(y_label) + 3 + len(names) <= width:
        return [f"{y_label}{names.rjust(width - len(y_label))}"]
    return [fit(y_label, width), names.rjust(width)]


def fit(text: str, width: int) -> str:
    """The text, cut where it is too long for a line."""
    return text if len(text) <= width else f"{text[: width - 3]}..."


def ascii_only(text: str) -> str:
    """The text with the frame's lines as `+-|`, and a question mark for what else ASCII does not have."""
    return text.translate(_PLAIN).encode("ascii", "replace").decode("ascii")


def canvas(
    strokes: Sequence[Stroke],
    spans: tuple[Span, Span],
    ticks: tuple[Ticks, Ticks],
    size: tuple[int, int],
    colour: bool = False,
) -> list[str]:
    """The lines of a frame of `size` (columns, rows) with its strokes, the last on top, and its ticks."""
    import plotext  # type: ignore[import-untyped]

    with _FIGURE:
        plotext.clear_figure()
        try:
            plotext.theme("clear")
            plotext.limit_size(False, False)
            plotext.plotsize(*size)
            plotext.xlim(*spans[0])
            plotext.ylim(*spans[1])
            plotext.xticks(*ticks[0])
            plotext.yticks(*ticks[1])
            for stroke in strokes:
                draw = plotext.plot if stroke.joined else plotext.scatter
                for piece in _pieces(stroke.points):
                    x, y = piece.T.tolist()
                    draw(x, y, marker=stroke.mark, color=stroke.shade if colour else None)
            drawn = plotext.build()
            text = drawn if colour else plotext.uncolorize(drawn)
        finally:
            plotext.clear_figure()
    return [line.rstrip() for line in str(text).rstrip("\n").split("\n")][: size[1]]


def _pieces(line: FloatArray) -> list[FloatArray]:
    """The parts of a curve between its gaps."""
    good = np.isfinite(line).all(axis=1)
    borders = np.flatnonzero(np.diff(good.astype(np.int8))) + 1
    return [piece for piece in np.split(line, borders) if len(piece) and np.isfinite(piece).all()]
