"""What the gap workflow found, as pictures of text for a terminal."""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.explain.report.explanation import Explanation
from lidarcheck.figures.drawing.terminal import NARROWEST, WIDEST, Series, curves
from lidarcheck.figures.explain.tables import Histogram, Pictures
from lidarcheck.inference.intervals import Interval

__all__ = ["closed_most", "terminal_histograms", "terminal_waterfall"]

_NAME = 24
"""Letters that a step's name may have."""


def terminal_waterfall(explanation: Explanation, *, width: int = 80, plain: bool = False) -> str:
    """The gap as it was, after each effect, and the floor: a line each, none wider than `width` (40 ... 200).

    A bar is what is left, the lighter part what the step closes; then the number with its 90 % interval, and the share
    of the gap that the step closes. `plain` keeps to ASCII. The last line ends in a newline.
    """
    gap, width = explanation.gap, min(max(width, NARROWEST), WIDEST)
    rows = [("as it was", gap.before, gap.before.value)]
    earlier = gap.before.value
    steps = gap.waterfall or ((("the new model", gap.after),) if explanation.findings else ())
    for name, left in steps:
        rows.append((f"+ {name}", left, earlier))
        earlier = left.value
    rows.append(("floor", gap.floor, gap.floor.value))
    excess = gap.before.value - gap.floor.value
    texts = [_numbers(one, before, excess) for _, one, before in rows]
    name_width = min(max(len(name) for name, *_ in rows), _NAME, width // 3)
    room = max(width - name_width - max(map(len, texts)) - 4, 0)
    reach = max([one.value for _, one, _ in rows if math.isfinite(one.value)] + [0.0]) or 1.0
    lines = []
    for (name, one, before), words in zip(rows, texts, strict=True):
        bar = _bar(one.value / reach, before / reach, room, "#." if plain else "█░")
        lines.append(f"{_cut(name, name_width):<{name_width}}  {bar:<{room}}  {words}"[:width].rstrip())
    return "\n".join(lines) + "\n"


def _numbers(one: Interval, earlier: float, excess: float) -> str:
    words = f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g})"
    closed = (earlier - one.value) / excess if excess > 0.0 else 0.0
    return f"{words} {-100.0 * closed:+.0f} %" if earlier != one.value and math.isfinite(closed) else words


def _bar(left: float, earlier: float, room: int, marks: str) -> str:
    """What is left and, up to where it was, what is closed."""
    if not (math.isfinite(left) and math.isfinite(earlier)):
        return ""
    first = round(room * min(max(left, 0.0), 1.0))
    last = round(room * min(max(earlier, 0.0), 1.0))
    return marks[0] * first + marks[1] * max(last - first, 0)


def _cut(name: str, width: int) -> str:
    return name if len(name) <= width else f"{name[: width - 2]}.."


def terminal_histograms(
    pictures: Pictures,
    feature: str = "",
    *,
    width: int = 80,
    height: int = 15,
    colour: bool = False,
    plain: bool = False,
) -> str:
    """How often a feature's values occur, measured and simulated before and after, counts on a log scale.

    `feature`: that of one of the histograms; by default the one whose gap closed most. `width`, `height`, `colour` and
    `plain` are those of `terminal.curves`. Empty without frames. `ValueError` for a feature that there is not.
    """
    if not pictures.histograms:
        return ""
    found = {one.feature: one for one in pictures.histograms}
    if feature and feature not in found:
        raise ValueError(f"no histogram of {feature}; there are {', '.join(found)}")
    one = found[feature] if feature else closed_most(pictures)
    edges = np.sqrt(one.edges[1:] * np.maximum(one.edges[:-1], 0.1)) if one.log_x else None
    middle = 0.5 * (one.edges[1:] + one.edges[:-1]) if edges is None else edges
    sides = [("measured", one.measured), ("before", one.before), ("after", one.after)]
    if not pictures.changed:
        sides = [("measured", one.measured), ("model", one.after)]
    return curves(
        [Series(name, middle, values) for name, values in sides],
        x_label=f"{one.words} [{one.unit}]",
        y_label="echoes a frame",
        width=width,
        height=height,
        log_x=one.log_x,
        log_y=True,
        colour=colour,
        plain=plain,
    )


def closed_most(pictures: Pictures) -> Histogram:
    """The histogram whose counts came closest to the measured ones; where nothing changed the one that is farthest.

    By the squared distance of the roots of the counts, in which chance is the same in every bin. `ValueError` without
    a histogram.
    """
    if not pictures.histograms:
        raise ValueError("there are no histograms")

    def gain(one: Histogram) -> float:
        own, before, after = (np.sqrt(values) for values in (one.measured, one.before, one.after))
        earlier = float(((own - before) ** 2).sum())
        return earlier - float(((own - after) ** 2).sum()) if pictures.changed else earlier

    return max(pictures.histograms, key=gain)
