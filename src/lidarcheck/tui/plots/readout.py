"""What stands under the cursor of a plot, in words: x, each trace's value, how they differ, and an interval's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck.tui.plots.chart import Chart, Trace, value_text
from lidarcheck.tui.plots.look import Look, seen_traces
from lidarcheck.tui.plots.transform import Transform

__all__ = ["Reading", "read", "reading_words"]

_SAME = 1e-9


class Reading(NamedTuple):
    """A trace's value at an x. `point`: number of the data point, None between two, where the value is on the line."""

    trace: Trace
    x: float
    y: float
    point: int | None

    @property
    def text(self) -> str:
        """The value; behind a tilde where it is between two points, with what it counts where it counts something."""
        count = "" if self.trace.counts is None or self.point is None else f" ({self.trace.counts[self.point]:.0f})"
        value = f"{100.0 * self.y:.3g} %" if self.trace.is_histogram and np.isfinite(self.y) else value_text(self.y)
        return f"{'' if self.point is not None else '~'}{value}{count}"


def read(trace: Trace, x: float, scales: tuple[Transform, Transform]) -> Reading | None:
    """The value of a trace at x; None where it has none there."""
    if trace.is_histogram:
        at = int(np.searchsorted(trace.x, x, side="right")) - 1
        return Reading(trace, x, float(trace.y[at]), at) if 0 <= at < len(trace.y) else None
    if not len(trace.x):
        return None
    near = int(np.nanargmin(np.abs(trace.x - x))) if np.isfinite(trace.x).any() else 0
    reach = float(np.nanmax(trace.x) - np.nanmin(trace.x)) if np.isfinite(trace.x).any() else 0.0
    if abs(float(trace.x[near]) - x) <= _SAME * max(reach, abs(x)):
        return Reading(trace, x, float(trace.y[near]), near)
    if trace.form == "points":
        return None
    across, up = scales[0].to(trace.x), scales[1].to(trace.y)
    good = np.isfinite(across) & np.isfinite(up)
    at_x = float(scales[0].to(x))
    if good.sum() < 2 or not across[good].min() <= at_x <= across[good].max():
        return None
    order = np.argsort(across[good], kind="stable")
    y = float(scales[1].back(np.interp(at_x, across[good][order], up[good][order])))
    return Reading(trace, x, y, None)


def reading_words(chart: Chart, look: Look, scales: tuple[Transform, Transform]) -> list[str]:
    """The line below a plot, entry by entry, what matters most first; none without a cursor."""
    if look.cursor is None:
        return []
    traces = seen_traces(chart, look)
    found = [reading for trace in traces if (reading := read(trace, look.cursor, scales)) is not None]
    words = [f"{reading.trace.name} {reading.text}" for reading in found]
    words[2:2] = _compared(chart, found)
    words += _second(look, traces, scales)
    where = f"at {_where(found, look.cursor)}"
    return [f"{where}: {words[0]}", *words[1:]] if words else [where]


def _where(found: list[Reading], x: float) -> str:
    """The place; of a histogram the bin's interval."""
    bins = next((one for one in found if one.trace.is_histogram), None)
    if bins is None or bins.point is None:
        return value_text(x)
    return f"{value_text(bins.trace.x[bins.point])}..{value_text(bins.trace.x[bins.point + 1])}"


def _compared(chart: Chart, found: list[Reading]) -> list[str]:
    """How the first differs from the second: the measured minus the simulated, or simulated over measured."""
    if len(found) < 2 or not chart.compared:
        return []
    first, second = found[0], found[1]
    if chart.compared == "difference":
        return [f"diff {first.y - second.y:+.3g}"]
    if not first.y > 0.0:
        return []
    spread = ""
    if first.trace.counts is not None and second.trace.counts is not None and None not in (first.point, second.point):
        n = (first.trace.counts[first.point or 0], second.trace.counts[second.point or 0])
        if min(n) > 0:
            spread = f" +-{second.y / first.y * float(np.sqrt(1.0 / n[0] + 1.0 / n[1])):.2g}"
    return [f"ratio {second.y / first.y:.3g}{spread}"]


def _second(look: Look, traces: list[Trace], scales: tuple[Transform, Transform]) -> list[str]:
    """What changes from the second cursor to this one."""
    if look.second is None or look.cursor is None:
        return []
    words = [f"from {value_text(look.second)}: dx {look.cursor - look.second:+.4g}"]
    for trace in traces:
        here, there = read(trace, look.cursor, scales), read(trace, look.second, scales)
        if here is not None and there is not None:
            words.append(f"{trace.name} {here.y - there.y:+.3g}")
    words[1:1] = _between(traces, *sorted((look.second, look.cursor)))
    return words


def _between(traces: list[Trace], low: float, high: float) -> list[str]:
    """How far the first two traces are apart from one cursor to the other: of what both know the root mean square."""
    if len(traces) < 2 or any(trace.is_histogram for trace in traces[:2]):
        return []
    first, second = traces[0], traces[1]
    _, at, other = np.intersect1d(np.round(first.x, 6), np.round(second.x, 6), return_indices=True)
    off = (first.y[at] - second.y[other])[(first.x[at] >= low) & (first.x[at] <= high)]
    off = off[np.isfinite(off)]
    return [f"rms {np.sqrt(np.mean(off**2)):.3g} over {len(off)}"] if off.size else []
