"""How a chart is looked at: zoom, cursors, hidden traces, scales. It is kept by the chart's key, through edits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.scales import equal_spans, round_ticks
from lidarcheck.tui.plots.chart import Chart, Trace
from lidarcheck.tui.plots.transform import Axis, Scale, Span, Transform, limits, next_scale, panned, zoomed

__all__ = ["Look", "axes_of", "moved_cursor", "seen_traces"]

_MARGIN_UP = 0.04
_DECADES = 307.0
"""Of a double."""


@dataclass
class Look:
    """`x`, `y`: what is seen, transformed; None for all. `cursor`, `second`: x of the readout, in the data's numbers.

    `active`: which trace the cursor goes along. `hidden`: names of traces. `scales`: chosen instead of the chart's own.
    `box`: (column, row) twice, the corners of a box that is being dragged.
    """

    x: Span | None = None
    y: Span | None = None
    cursor: float | None = None
    second: float | None = None
    active: int = 0
    hidden: set[str] = field(default_factory=set)
    box: tuple[int, int, int, int] | None = None
    scales: dict[str, Scale] = field(default_factory=dict)

    @property
    def zoomed(self) -> bool:
        """Whether less than all is seen."""
        return self.x is not None or self.y is not None

    def fit(self) -> None:
        """See all again."""
        self.x = self.y = None

    def zoom(self, axes: tuple[Axis, Axis], by: float, about: tuple[float | None, float | None]) -> None:
        """Zoom `by` about a transformed place on each axis; None leaves the axis as it is."""
        if about[0] is not None:
            self.x = zoomed(axes[0].span, about[0], by)
        if about[1] is not None:
            self.y = zoomed(axes[1].span, about[1], by)

    def pan(self, axes: tuple[Axis, Axis], across: float, up: float) -> None:
        """Move what is seen by parts of itself."""
        if across:
            self.x = panned(axes[0].span, across)
        if up:
            self.y = panned(axes[1].span, up)

    def scale_next(self, chart: Chart, axis: str) -> Scale:
        """The next scale of an axis, `x` or `y`, that can show its numbers; that axis shows all again."""
        now = self.scales.get(axis, chart.x_scale if axis == "x" else chart.y_scale)
        self.scales[axis] = scale = next_scale(now, chart.xs() if axis == "x" else chart.ys())
        setattr(self, axis, None)
        return scale


def seen_traces(chart: Chart, look: Look) -> list[Trace]:
    """The traces that are not hidden."""
    return [trace for trace in chart.traces if trace.name not in look.hidden]


def axes_of(chart: Chart, look: Look, cells: tuple[int, int]) -> tuple[Axis, Axis]:
    """The axes, x and y, over `cells` (columns, rows) with what is seen of them."""
    seen = replace(chart, traces=tuple(seen_traces(chart, look)))
    x, y = (Transform.of(look.scales.get(name, own), values) for name, own, values in
            (("x", chart.x_scale, chart.xs()), ("y", chart.y_scale, chart.ys())))  # fmt: skip
    across = limits(x.to(chart.xs()), room=_room(x))
    up = _round_limits(y, seen.ys(), chart)
    if chart.equal:
        # A cell is about twice as high as wide.
        across, up, _ = equal_spans(across, up, float(cells[0]), 2.0 * cells[1])
    return Axis(x, look.x or across, cells[0]), Axis(y, look.y or up, cells[1])


def _round_limits(transform: Transform, values: FloatArray, chart: Chart) -> Span:
    """Limits on round numbers, so that they, and the frame with them, stay where they are while a value is edited."""
    t = transform.to(values)
    if any(trace.is_histogram for trace in chart.traces) and transform.scale == "lin":
        t = np.append(t, 0.0)
    low, high = limits(t, room=_room(transform))
    if chart.equal or chart.y_names:
        return limits(t, _MARGIN_UP)
    if transform.scale != "lin":
        step = 0.25 if high - low < 4.0 else 0.5
    else:
        at, _ = round_ticks(low, high, 8, False)
        step = at[1] - at[0] if len(at) > 1 else 0.0
    if step <= 0.0:
        return limits(t, _MARGIN_UP)
    low, high = float(np.floor(low / step + 1e-9) * step), float(np.ceil(high / step - 1e-9) * step)
    return (low, high) if transform.scale == "lin" else (max(low, -_DECADES), min(high, _DECADES))


def _room(transform: Transform) -> float | None:
    """What is seen on both sides of a single number: a quarter of a decade on an axis of decades."""
    return None if transform.scale == "lin" else 0.25


def moved_cursor(chart: Chart, look: Look, axis: Axis, by: int) -> float | None:
    """The x of the data point `by` further on the active trace; of none yet, the one nearest to the middle."""
    traces = seen_traces(chart, look)
    if not traces:
        return None
    trace = traces[min(look.active, len(traces) - 1)]
    own = trace.places[np.isfinite(trace.y)]
    places = np.unique(own[np.isfinite(axis.transform.to(own))])
    if not places.size:
        return None
    if look.cursor is None:
        middle = axis.value(0.5 * (axis.cells - 1))
        return float(places[np.argmin(np.abs(places - middle))])
    at = int(np.searchsorted(places, look.cursor, side="left"))
    if by > 0 and at < len(places) and places[at] <= look.cursor + 1e-9 * max(abs(look.cursor), 1e-9):
        at += by
    elif by > 0:
        at += by - 1
    else:
        at += by
    return float(places[min(max(at, 0), len(places) - 1)])
