"""The pictures of a gap: histograms, and residuals over what they may depend on.

Measured is a grey area, the model before a dashed line with rings, the model after a solid line with dots, so that
nothing is told by colour alone.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.gap.data import Detected, Histogram, ResidualCurve
from lidarcheck.figures.svg.shapes import PlotArea, nodes, svg
from lidarcheck.figures.words import amount, short
from lidarcheck.printable import printable

__all__ = ["detected_svg", "histogram_svg", "residual_svg"]


_DECADES = 4.5
_APART = 0.17
"""Before and after are drawn so much to either side of a bin's middle, in bins."""
_LABELS = {
    "range": "range [m]",
    "amplitude": "amplitude: AREA from",
    "layer": "layer",
    "point": "point",
    "incidence": "incidence [°]",
    "material": "",
}


def histogram_svg(one: Histogram, *, changed: bool) -> str:
    """Echoes a frame over a feature, on a log scale; empty if there is no echo at all."""
    sides = [("before", one.before), ("after", one.after)] if changed else [("after", one.after)]
    counts = [one.measured, *(values for _, values in sides)]
    most = max(float(values.max(initial=0.0)) for values in counts)
    if most <= 0.0:
        return ""
    least = min(float(values[values > 0.0].min(initial=most)) for values in counts)
    high = math.log10(most) + 0.08
    low = max(math.log10(least) - 0.15, high - _DECADES)
    edges = np.log10(np.maximum(one.edges, 1e-3)) if one.log_x else one.edges
    frame = PlotArea((float(edges[0]), float(edges[-1])), (low, high), log_x=one.log_x, log_y=True)
    parts = [frame.axes(frame.fitting(frame.x_ticks()), one.unit)]
    parts.append(f'<path class="measured" d="{_steps(frame, edges, one.measured)}z"/>')
    parts += [f'<path class="{name}" d="{_steps(frame, edges, values)}"/>' for name, values in sides]
    return svg(_histogram_words(one, changed), "".join(parts))


def _steps(frame: PlotArea, edges: FloatArray, values: FloatArray) -> str:
    """The outline of the bins, from the axis up and back to it."""
    low = frame.y[0]
    height = [frame.up(math.log10(v) if v > 0.0 else low) for v in values]
    x = [frame.across(float(edge)) for edge in edges]
    path, at = [f"M{x[0]:.1f} {frame.up(low):.1f}"], frame.up(low)
    for left, right, y in zip(x[:-1], x[1:], height, strict=True):
        if y != at:  # bins as high as the one before are one line
            path.append(f"H{left:.1f}V{y:.1f}")
            at = y
        last = right
    return f"{''.join(path)}H{last:.1f}V{frame.up(low):.1f}"


def _histogram_words(one: Histogram, changed: bool) -> str:
    middle = 0.5 * (one.edges[1:] + one.edges[:-1])

    def words(name: str, values: FloatArray) -> str:
        total = float(values.sum())
        mean = float((values * middle).sum()) / total if total > 0.0 else math.nan
        return f"{name} {total:.0f} echoes a frame, mean {amount(mean)}"

    sides = [words("measured", one.measured)]
    sides += [words("before", one.before), words("after", one.after)] if changed else [words("model", one.after)]
    return f"{one.words} in {one.unit}, how often, on a log scale: {'; '.join(sides)}"


def residual_svg(one: ResidualCurve, *, changed: bool) -> str:
    """Median and 10 to 90 % of the residuals in each bin; empty if no bin has enough."""
    sides = [("before", one.before), ("after", one.after)] if changed else [("after", one.after)]
    everything = np.concatenate([values for _, values in sides])
    if not np.isfinite(everything).any():
        return ""
    frame = PlotArea((-0.5, len(one.bins) - 0.5), _residual_span(everything))
    zero = frame.up(0.0)
    parts = [_bin_axes(frame, one.bins, one.covariate)]
    parts.append(f'<path class="zero" d="M{frame.across(-0.5):.1f} {zero:.1f}H{frame.across(len(one.bins)):.1f}"/>')
    for (name, values), shift in zip(sides, (-_APART, _APART) if changed else (0.0,), strict=True):
        parts.append(_series(frame, name, values, shift, joined=one.covariate != "material"))
    parts.append(_hints(frame, one.bins, [_residual_words(one, i, sides) for i in range(len(one.bins))]))
    worst = ", ".join(f"{name} at most {amount(_most(values[:, 1]))}" for name, values in sides)
    label = f"{one.words} over {one.covariate}, measured less simulated in {one.unit}: median {worst}"
    return svg(label, "".join(parts))


def _residual_span(quantiles: FloatArray) -> tuple[float, float]:
    """All medians and most of the quantiles, with zero; one wild bin does not flatten the others."""
    medians = quantiles[:, 1]
    ends = [np.nanmin(medians), np.nanmax(medians), 1.3 * np.nanmedian(quantiles[:, 0]), 0.0]
    low, high = min(ends), max(*ends[:2], 1.3 * float(np.nanmedian(quantiles[:, 2])), 0.0)
    room = 0.06 * (high - low) or 0.5
    return float(low - room), float(high + room)


def _residual_words(one: ResidualCurve, i: int, sides: Sequence[tuple[str, FloatArray]]) -> str:
    parts = [f"{name} {amount(v[i, 1])} ({amount(v[i, 0])} to {amount(v[i, 2])})" for name, v in sides]
    return f"{one.bins[i]}: {', '.join(parts)}; {int(one.count[i])} residuals"


def detected_svg(one: Detected, *, changed: bool) -> str:
    """The share of surfaces that have an echo in each bin, measured with its interval; empty if no bin has enough."""
    if not np.isfinite(one.measured).any():
        return ""
    sides = [("before", one.before), ("after", one.after)] if changed else [("after", one.after)]
    frame = PlotArea((-0.5, len(one.bins) - 0.5), (-2.0, 104.0))
    parts = [_bin_axes(frame, one.bins, one.covariate)]
    parts += [_interval(frame, i, 100.0 * one.measured[i]) for i in range(len(one.bins))]
    for (name, values), shift in zip(sides, (-_APART, _APART) if changed else (0.0,), strict=True):
        column = np.repeat(100.0 * values[:, None], 3, axis=1)
        parts.append(_series(frame, name, column, shift, joined=False))
    words = [
        f"{bin_name}: measured {_percent(m)} ({_percent(low)} to {_percent(high)}), "
        f"{', '.join(f'{name} {_percent(v[i])}' for name, v in sides)}; {int(one.count[i])} beams"
        for i, (bin_name, (m, low, high)) in enumerate(zip(one.bins, one.measured, strict=True))
    ]
    parts.append(_hints(frame, one.bins, words))
    worst = ", ".join(f"{name} {_percent(_most(one.measured[:, 0] - values))}" for name, values in sides)
    label = f"share of surfaces that have an echo over {one.covariate}: measured less simulated at most {worst}"
    return svg(label, "".join(parts))


def _interval(frame: PlotArea, i: int, measured: FloatArray) -> str:
    """A grey box over the interval, at least a line thick, with the share across it."""
    if not np.isfinite(measured).all():
        return ""
    share, low, high = (frame.up(float(v)) for v in measured)
    left, right = frame.across(i - 0.42), frame.across(i + 0.42)
    box = f'<path class="measured" d="M{left:.1f} {low:.1f}V{min(high, low - 1.0):.1f}H{right:.1f}V{low:.1f}z"/>'
    return f'{box}<path class="axis" d="M{left:.1f} {share:.1f}H{right:.1f}"/>'


def _series(frame: PlotArea, name: str, values: FloatArray, shift: float, *, joined: bool) -> str:
    """Medians as rings or dots, joined by a line, on bars from the 10 to the 90 % quantile."""
    x = [frame.across(i + shift) for i in range(len(values))]
    bars, marks, middle = [], [], []
    for at, (low, median, high) in zip(x, values, strict=True):
        if not math.isfinite(median):
            middle.append((at, math.nan))
            continue
        middle.append((at, frame.up(median)))
        if frame.up(low) - frame.up(high) > 0.5:
            bars.append(f"M{at:.1f} {frame.up(low):.1f}V{frame.up(high):.1f}")
        marks.append(f'<circle class="{name}-dot" cx="{at:.1f}" cy="{frame.up(median):.1f}" r="2.6"/>')
    line = f'<path class="{name}" d="{nodes(middle)}"/>' if joined else ""
    return (f'<path class="{name}-bar" d="{"".join(bars)}"/>' if bars else "") + line + "".join(marks)


def _bin_axes(frame: PlotArea, bins: Sequence[str], covariate: str) -> str:
    """Axes with the bins' names; materials have longer ones, all of which are shown."""
    named = covariate == "material"
    room = max(5, int(84.0 / max(len(bins), 1)))
    ticks = [(float(i), short(name, room) if named else _plain(name)) for i, name in enumerate(bins)]
    return frame.axes(ticks if named else frame.fitting(ticks), _LABELS.get(covariate, covariate), staggered=named)


def _plain(name: str) -> str:
    """A bin's name without what the axis says."""
    plain = name.removeprefix("AREA from ").removesuffix(" m").removesuffix(" deg").replace("over ", ">")
    return "rare" if plain == "seldom seen" else plain


def _hints(frame: PlotArea, bins: Sequence[str], words: Sequence[str]) -> str:
    """What a pointer that rests on a bin is told."""
    boxes = []
    top, bottom = frame.up(frame.y[1]), frame.up(frame.y[0])
    for i in range(len(bins)):
        left, right = frame.across(i - 0.5), frame.across(i + 0.5)
        box = f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'
        boxes.append(f'<rect class="hint" {box}><title>{html.escape(printable(words[i]))}</title></rect>')
    return "".join(boxes)


def _most(values: FloatArray) -> float:
    """The value farthest from zero, NaN where there is none."""
    finite = values[np.isfinite(values)]
    return float(finite[np.argmax(np.abs(finite))]) if len(finite) else math.nan


def _percent(share: float) -> str:
    return f"{amount(100.0 * share)} %" if math.isfinite(share) else "–"
