"""The KPIs of a comparison beside what chance gives, as an SVG file: a line each, a dot where it lies."""

from __future__ import annotations

import math

from lidarcheck.figures.svg.figure import style
from lidarcheck.figures.svg.shapes import PlotArea, svg, text
from lidarcheck.kpi.chance.exchange import Judgement
from lidarcheck.kpi.chance.verdict import Verdict

__all__ = ["chance_svg"]

_WIDTH, _LINE, _TOP, _LEFT, _RIGHT = 520.0, 13.0, 34.0, 190.0, 70.0
_LEAST, _MOST = -3.0, 12.0
"""Standard deviations that the axis spans at least and at most; a dot beyond becomes an arrow at the end."""


def chance_svg(verdict: Verdict) -> str:
    """The picture: over the standard deviations of what exchanges of the two sides give, each KPI that is judged.

    The broken line is the family's level: what lies right of it stands out, is a filled dot, and says so.
    """
    judged = [one for one in verdict.kpis.values() if not one.not_judged]
    reach = max([verdict.limit + 1.0, *(one.score for one in judged)], default=1.0)
    span = (_LEAST, min(max(reach, 4.0), _MOST))
    height = _TOP + _LINE * len(judged) + 44.0
    area = PlotArea(span, (0.0, 1.0), width=_WIDTH - _RIGHT, height=height, left=_LEFT, top=_TOP - 6.0)
    label = "standard deviations above the mean of what chance gives"
    parts = [f'<rect class="paper" width="{_WIDTH:g}" height="{height:g}"/>', text(4.0, 14.0, verdict.closing)]
    parts.append(area.axes(area.x_ticks(), label, y_ticks=()))
    if math.isfinite(verdict.limit):
        x = area.across(verdict.limit)
        parts.append(f'<path class="reference" d="M{x:.1f} {area.top:g}V{area.bottom:g}"/>')
        parts.append(text(x, area.top - 3.0, "95 % of the largest", "middle", "label"))
    for i, one in enumerate(judged):
        parts.append(_kpi(one, area, _TOP + _LINE * (i + 0.5)))
    whole = svg(verdict.closing, "".join(parts), name="chart", width=_WIDTH, height=height)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{1.6 * _WIDTH:g}" '
    opening, _, body = whole.replace("<svg ", head, 1).partition(">")
    return f"{opening}><style>{style()}.paper {{ fill: var(--paper); }}</style>{body}\n"


def _kpi(one: Judgement, area: PlotArea, y: float) -> str:
    x, beyond = area.across(one.score), one.score > area.x[1]
    name = text(area.left - 6.0, y + 3.0, f"{one.kpi} {one.of}".strip(), "end")
    mark = f'<circle class="{"s0" if one.stands_out else "ring"}" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'
    if beyond:
        mark = f'<path class="s0" d="M{x - 5:.1f} {y - 3.5:.1f}L{x + 2:.1f} {y:.1f}L{x - 5:.1f} {y + 3.5:.1f}z"/>'
    word = text(area.right + 6.0, y + 3.0, f"stands out{f', {one.score:.0f}' if beyond else ''}")
    return name + mark + (word if one.stands_out else "")
