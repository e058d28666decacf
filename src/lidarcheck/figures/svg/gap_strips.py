"""The gap in strips of SVG that fit a table's cell: the waterfall, the features, the candidates' gains."""

from __future__ import annotations

import math

from lidarcheck.explain.report.explanation import Candidate
from lidarcheck.figures.svg.shapes import line, svg
from lidarcheck.figures.words import amount
from lidarcheck.inference.intervals import Gap, Interval

__all__ = ["candidate_strip", "feature_strip", "gap_reach", "gap_strip"]

_WIDTH, _HEIGHT = 220.0, 22.0
_DOUBLINGS = 4.0
"""A candidate's strip spans so many doublings of what is needed to either side."""


def gap_reach(gap: Gap) -> float:
    """What all strips of a gap span, from 0."""
    parts = [gap.before, gap.after, gap.floor, *(one for _, one in gap.waterfall)]
    finite = [value for one in parts for value in (one.value, one.high) if math.isfinite(value)]
    return max([*finite, 0.0]) * 1.03 or 1.0


def gap_strip(one: Interval, earlier: float, floor: Interval, reach: float) -> str:
    """What is left of the gap: a bar with its interval, the part that was closed in outline, over the floor's band.

    `earlier`: the gap before this step, the same where there is none.
    """
    if not math.isfinite(one.value):
        return ""
    x = _place(one.value, reach)
    parts = [_floor(floor, reach), f'<rect class="left" x="0" y="5" width="{x:.1f}" height="12"/>']
    if math.isfinite(earlier) and earlier != one.value:
        first, last = sorted((x, _place(earlier, reach)))
        name = "closed" if earlier > one.value else "opened"
        parts.append(f'<rect class="{name}" x="{first:.1f}" y="5.5" width="{last - first:.1f}" height="11"/>')
    parts += [_line("zero", floor.value, floor.value, reach, 0.0, _HEIGHT), _whisker(one, reach)]
    closes = f", {amount(earlier - one.value)} less than before" if earlier != one.value else ""
    label = f"gap {amount(one.value)}, {amount(one.low)} to {amount(one.high)}{closes}; floor {amount(floor.value)}"
    return svg(label, "".join(parts), name="strip", width=_WIDTH, height=_HEIGHT)


def feature_strip(before: float, after: float, floor: float) -> str:
    """A feature's distance: ring before, dot after, the floor a line; the scale is the feature's own."""
    reach = max((v for v in (before, after, floor) if math.isfinite(v)), default=0.0) * 1.08 or 1.0
    parts = []
    if math.isfinite(floor):
        x = _place(floor, reach)
        parts.append(f'<rect class="band" x="0" y="3" width="{x:.1f}" height="16"/>')
        parts.append(_line("zero", floor, floor, reach, 1.0, 21.0))
    if math.isfinite(before) and math.isfinite(after):
        parts.append(_line("interval", before, after, reach, 11.0, 11.0))
    for name, value in (("ring", before), ("dot", after)):
        if math.isfinite(value):
            parts.append(
                f'<circle class="{name}" cx="{min(max(_place(value, reach), 5.0), 215.0):.1f}" cy="11" r="4"/>'
            )
    label = f"before {amount(before)}, after {amount(after)}, floor {amount(floor)}"
    return svg(label, "".join(parts), name="strip", width=_WIDTH, height=_HEIGHT)


def candidate_strip(one: Candidate) -> str:
    """A candidate's gain over what is needed, in doublings: right of the line it is more than chance makes."""
    if not (math.isfinite(one.gain) and one.needed > 0.0):
        return ""
    ratio = one.gain / one.needed
    doublings = math.log2(ratio) if ratio > 0.0 else -_DOUBLINGS
    x = 110.0 + 104.0 * max(-1.0, min(1.0, doublings / _DOUBLINGS))
    first, last = sorted((110.0, x))
    name = "enough" if ratio >= 1.0 else "little"
    bar = f'<rect class="{name}" x="{first:.1f}" y="6" width="{last - first:.1f}" height="10"/>'
    middle = '<path class="zero" d="M110 1V21"/>'
    return svg(f"gain {amount(ratio)} times what is needed", bar + middle, name="strip", width=_WIDTH, height=_HEIGHT)


def _place(value: float, reach: float) -> float:
    return _WIDTH * max(0.0, min(1.0, value / reach))


def _line(name: str, low: float, high: float, reach: float, top: float, bottom: float) -> str:
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return line(name, _place(low, reach), top, _place(high, reach), bottom)


def _floor(floor: Interval, reach: float) -> str:
    if not (math.isfinite(floor.low) and math.isfinite(floor.high)):
        return ""
    low, high = _place(floor.low, reach), _place(floor.high, reach)
    return f'<rect class="band" x="{low:.1f}" y="0" width="{max(high - low, 1.0):.1f}" height="{_HEIGHT:g}"/>'


def _whisker(one: Interval, reach: float) -> str:
    ends = [f"M{_place(v, reach):.1f} 8v6" for v in (one.low, one.high) if math.isfinite(v)]
    return f'<path class="whisker" d="{"".join(ends)}"/>' + _line("whisker", one.low, one.high, reach, 11.0, 11.0)
