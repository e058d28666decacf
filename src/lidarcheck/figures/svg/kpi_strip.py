"""A KPI's change beside its tolerance, as a strip of SVG that fits a table's cell.

Written by hand: a page has hundreds, each a few shapes in the page's own colours.
"""

from __future__ import annotations

import math

from lidarcheck.figures.svg.shapes import line, svg
from lidarcheck.harness.reports.results import KpiResult

__all__ = ["strip"]

_WIDTH, _HEIGHT, _MIDDLE = 150.0, 22.0, 11.0
_REACH = 3.0
"""The strip spans so many tolerances to either side; what lies beyond is an arrow at its end."""


def strip(kpi: KpiResult) -> str:
    """The change in tolerances: a dot with its interval by chance, over the band that does not matter.

    Two ticks show the smallest change that would be caught. Empty if nothing was compared.
    """
    evidence, tolerance = kpi.golden, kpi.spec.tolerance
    if evidence is None or math.isnan(evidence.delta):
        return ""
    change = evidence.delta / tolerance
    margin = 0.0 if math.isnan(evidence.margin) else evidence.margin / tolerance
    label = f"change {change:+.2f} tolerances" + (f", ±{margin:.2f} by chance" if margin else "")
    parts = [
        _box("band", -1.0, 1.0, 2.0, _HEIGHT - 4.0),
        line("zero", _place(0.0), 2.0, _place(0.0), _HEIGHT - 2.0),
        *_caught(evidence.smallest / tolerance, one_sided=kpi.spec.kind == "distance"),
        line("interval", _place(change - margin), _MIDDLE, _place(change + margin), _MIDDLE) if margin else "",
        _mark(change),
    ]
    return svg(label, "".join(parts), name="strip", width=_WIDTH, height=_HEIGHT)


def _place(tolerances: float) -> float:
    reach = max(-_REACH, min(_REACH, tolerances))
    return (reach / _REACH + 1.0) * (_WIDTH / 2.0 - 7.0) + 7.0


def _box(name: str, low: float, high: float, top: float, height: float) -> str:
    left = _place(low)
    return f'<rect class="{name}" x="{left:.1f}" y="{top:g}" width="{_place(high) - left:.1f}" height="{height:g}"/>'


def _caught(smallest: float, *, one_sided: bool) -> list[str]:
    if math.isnan(smallest) or smallest > _REACH:
        return []
    signs = (1.0,) if one_sided else (-1.0, 1.0)
    return [line("caught", x, 5.0, x, _HEIGHT - 5.0) for x in (_place(sign * smallest) for sign in signs)]


def _mark(change: float) -> str:
    """A dot, or an arrow where the dot would lie outside."""
    if abs(change) <= _REACH:
        return f'<circle class="dot" cx="{_place(change):.1f}" cy="{_MIDDLE:g}" r="3.5"/>'
    end, back = _place(change), -6.0 if change > 0.0 else 6.0
    base = f"{end - back / 2 + back:.1f}"
    tip = f"{end - back / 2 - back / 4:.1f}"
    return f'<path class="dot" d="M{base} {_MIDDLE - 4.5:g}L{tip} {_MIDDLE:g}L{base} {_MIDDLE + 4.5:g}z"/>'
