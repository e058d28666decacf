"""A frame of text with points and lines in it: the one place that knows plotext.

plotext is given plain numbers and the ticks' texts. Series differ by their marks; colour, where it is asked for, only
repeats that.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = [
    "COLOURS",
    "HIGHEST",
    "LOWEST",
    "MARKS",
    "NARROWEST",
    "PLAIN_MARKS",
    "WIDEST",
    "Stroke",
    "ascii_only",
    "canvas",
    "fit",
    "head_lines",
    "open_frame",
]

NARROWEST, WIDEST = 40, 200
LOWEST, HIGHEST = 8, 60
MARKS = ("·", "#", "o", "+", "x", "*", "%", "@")
PLAIN_MARKS = (".", *MARKS[1:])
COLOURS = ("cyan", "orange", "green", "magenta", "blue", "red", "white", "gray")
_PLAIN = str.maketrans("┌┐└┘┤├┬┴┼─│", "+++++++++-|")
_FIGURE = threading.Lock()
"""Plotext draws into one figure that the whole process shares."""

Span = tuple[float, float]
Ticks = tuple[list[float], list[str]]


@dataclass(frozen=True)
class Stroke:
    """What the frame is given to draw: points, shape (n, 2), NaN for a gap, with one mark; a curve where `joined`."""

    points: FloatArray
    mark: str
    shade: str | None = None
    joined: bool = True


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


@lru_cache(64)
def open_frame(
    spans: tuple[Span, Span], ticks: tuple[tuple[tuple[float, str], ...], ...], size: tuple[int, int]
) -> tuple[str, ...]:
    """The lines of a frame without data: an axis to the left and one below, each with its ticks (place, text).

    `size`: (columns, rows), with the texts of the ticks. The texts must leave each other room.
    """
    import plotext

    with _FIGURE:
        plotext.clear_figure()
        try:
            plotext.theme("clear")
            plotext.limit_size(False, False)
            plotext.plotsize(*size)
            plotext.xaxes(True, False)
            plotext.yaxes(True, False)
            plotext.xlim(*spans[0])
            plotext.ylim(*spans[1])
            for place, own in zip((plotext.xticks, plotext.yticks), ticks, strict=True):
                place([at for at, _ in own], [text for _, text in own])
            # plotext leaves out the ticks of an empty plot.
            plotext.scatter([spans[0][0]], [spans[1][0]], marker=" ")
            text = str(plotext.uncolorize(plotext.build()))
        finally:
            plotext.clear_figure()
    lines = text.rstrip("\n").split("\n")[: size[1]]
    # plotext puts the texts down in any order, and moves one that meets another.
    columns = [k for k, mark in enumerate(lines[-2]) if mark == "┬"] if len(lines) > 1 else []
    if len(columns) == len(ticks[0]):
        lines[-1] = _below(columns, [text for _, text in sorted(ticks[0])], size[0])
    return tuple(line.rstrip() for line in lines)


def _below(columns: Sequence[int], texts: Sequence[str], width: int) -> str:
    """A line with each text in the middle of its column, within the width."""
    found = ""
    for column, text in zip(columns, texts, strict=True):
        start = max(min(column - len(text) // 2, width - len(text)), 0)
        found = f"{found:{start}}{text}"
    return found


def _pieces(line: FloatArray) -> list[FloatArray]:
    """The parts of a curve between its gaps."""
    good = np.isfinite(line).all(axis=1)
    borders = np.flatnonzero(np.diff(good.astype(np.int8))) + 1
    return [piece for piece in np.split(line, borders) if len(piece) and np.isfinite(piece).all()]
