"""Axes and marks as SVG text, for the pages that have many small plots.

Written by hand: a page has dozens, they must be small and quick, and follow the page's light or dark mode by its CSS.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

from lidarcheck.figures.axes.scales import round_ticks
from lidarcheck.printable import printable

__all__ = ["HEIGHT", "LETTER", "WIDTH", "PlotArea", "line", "nodes", "svg", "text"]

WIDTH, HEIGHT = 260.0, 158.0
_BESIDE, _BELOW = 6.0, 36.0
"""Room that a plot leaves to the right of its axes, and below them for ticks and label."""
LETTER = 4.7
"""Width of a letter of a tick's text, about."""


@dataclass(frozen=True, slots=True)
class PlotArea:
    """What a plot spans, in the plot's own numbers; with `log` in their decimal logarithms.

    `width`, `height`: of the whole picture; its axes begin at `left` and `top`.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    log_x: bool = False
    log_y: bool = False
    width: float = WIDTH
    height: float = HEIGHT
    left: float = 38.0
    top: float = 8.0

    @property
    def right(self) -> float:
        """Where the axes end."""
        return self.width - _BESIDE

    @property
    def bottom(self) -> float:
        """Where the x axis lies."""
        return self.height - _BELOW

    def across(self, value: float) -> float:
        """Where a number of the x axis lies, kept inside."""
        return self.left + (self.right - self.left) * _part(value, self.x)

    def up(self, value: float) -> float:
        """Where a number of the y axis lies, kept inside."""
        return self.bottom - (self.bottom - self.top) * _part(value, self.y)

    def x_ticks(self) -> list[tuple[float, str]]:
        """Round numbers on the x axis."""
        places, words = round_ticks(*self.x, max(int((self.right - self.left) / 36.0), 3), self.log_x)
        return [(place, word.replace("-", "−")) for place, word in zip(places, words, strict=True)]

    def y_ticks(self) -> list[tuple[float, str]]:
        """Round numbers on the y axis."""
        most = max(int((self.bottom - self.top) / 28.0), 3)
        places, words = round_ticks(*self.y, most, self.log_y)
        return [(place, word.replace("-", "−")) for place, word in zip(places, words, strict=True)]

    def axes(
        self,
        x_ticks: Sequence[tuple[float, str]],
        x_label: str,
        *,
        y_ticks: Sequence[tuple[float, str]] | None = None,
        staggered: bool = False,
    ) -> str:
        """The frame's lines, ticks and texts; `staggered`: every other text of the x axis is a line lower."""
        parts = [f'<path class="axis" d="M{self.left:g} {self.top:g}V{self.bottom:g}H{self.right:g}"/>']
        for value, words in self.y_ticks() if y_ticks is None else y_ticks:
            y = self.up(value)
            parts.append(f'<path class="grid" d="M{self.left:g} {y:.1f}H{self.right:g}"/>')
            parts.append(text(self.left - 4.0, y + 3.0, words, "end"))
        for i, (value, words) in enumerate(x_ticks):
            x, lower = self.across(value), 10.0 if staggered and i % 2 else 0.0
            parts.append(f'<path class="axis" d="M{x:.1f} {self.bottom:g}v{3.0 + lower:g}"/>')
            parts.append(text(x, self.bottom + 12.0 + lower, words, "middle"))
        parts.append(text((self.left + self.right) / 2.0, self.height - 5.0, x_label, "middle", "label"))
        return "".join(parts)

    def fitting(self, ticks: Sequence[tuple[float, str]]) -> list[tuple[float, str]]:
        """As many of the ticks, evenly picked, as have room for their texts beside each other."""
        if not ticks:
            return []
        room = (self.right - self.left) / len(ticks)
        step = max(1, math.ceil((max(len(words) for _, words in ticks) * LETTER + 4.0) / room))
        return list(ticks[::step])


def _part(value: float, span: tuple[float, float]) -> float:
    low, high = span
    return min(max((value - low) / (high - low), 0.0), 1.0) if high > low else 0.5


def svg(label: str, content: str, *, name: str = "plot", width: float = WIDTH, height: float = HEIGHT) -> str:
    """A picture with its words for those who do not see it."""
    words, size = html.escape(printable(label)), f"0 0 {width:g} {height:g}"
    return f'<svg class="{name}" role="img" aria-label="{words}" viewBox="{size}">{content}</svg>'


def text(x: float, y: float, words: str, anchor: str = "start", name: str = "") -> str:
    """Words at a place; `anchor`: start, middle or end."""
    style = f' class="{name}"' if name else ""
    where = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text{style}{where} x="{x:.1f}" y="{y:.1f}">{html.escape(printable(words))}</text>'


def line(name: str, x: float, y: float, end_x: float, end_y: float) -> str:
    """A straight line from one place to another."""
    return f'<path class="{name}" d="M{x:.1f} {y:g}L{end_x:.1f} {end_y:g}"/>'


def nodes(points: Sequence[tuple[float, float]]) -> str:
    """The path through the points, broken where one of them is not finite."""
    path, down = [], False
    for x, y in points:
        finite = math.isfinite(x) and math.isfinite(y)
        if finite:
            path.append(f"{'L' if down else 'M'}{x:.1f} {y:.1f}")
        down = finite
    return "".join(path)
