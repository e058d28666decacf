"""The plot: a readout that goes from data point to data point, zoom, pan, and traces that can be hidden."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from textual.binding import Binding

from lidarcheck.tui.plots.look import moved_cursor, seen_traces
from lidarcheck.tui.plots.mouse import PlotMouse
from lidarcheck.tui.plots.readout import Reading, read

__all__ = ["PLOT_KEYS", "PLOT_WORDS", "Plot"]

PLOT_WORDS = (
    "Left and Right read the data from point to point, Up and Down from curve to curve, Space sets a second cursor; "
    "+ and - zoom about the cursor, < and > X alone, Shift and arrows move what is seen, 0 shows all; X and Y change "
    "the axes' scales, 1 to 8 hide curves. The wheel zooms at the pointer, a box that is drawn is zoomed to, the "
    "right button moves what is seen."
)
"""The keys and the mouse in a plot, for help."""

PLOT_KEYS: tuple[tuple[str, str, str, str], ...] = (
    ("left,h", "cursor(-1)", "", "readout: the data point before"),
    ("right,l", "cursor(1)", "Read", "readout: the next data point"),
    ("up,k", "curve(-1)", "", "readout: the curve before"),
    ("down,j", "curve(1)", "", "readout: the next curve"),
    ("space", "second", "", "a second cursor here: the readout says what changes between the two; again: none"),
    ("plus,equals_sign", "zoom(2.0)", "Zoom", "zoom in at the cursor"),
    ("minus", "zoom(0.5)", "", "zoom out"),
    ("less_than_sign", "zoom_x(0.5)", "", "zoom out along X alone"),
    ("greater_than_sign", "zoom_x(2.0)", "", "zoom in along X alone"),
    ("shift+left", "pan(-1, 0)", "", "move what is seen to the left"),
    ("shift+right", "pan(1, 0)", "", "move what is seen to the right"),
    ("shift+up", "pan(0, 1)", "", "move what is seen up"),
    ("shift+down", "pan(0, -1)", "", "move what is seen down"),
    ("0", "fit", "Fit", "see all again"),
    ("X", "scale('x')", "", "X axis: linear, log, symlog"),
    ("Y", "scale('y')", "", "Y axis: linear, log, symlog"),
    ("enter", "enter", "", "what is under the cursor: row or beams"),
    *((str(n), f"hide({n})", "", f"show or hide curve {n}") for n in range(1, 9)),
)
"""(keys, action of the plot, word for the footer, help) of all keys of a plot that has the focus."""
_PAN = 0.25


class Plot(PlotMouse):
    """`when_entered`: gets what is under the cursor. `when_said`: gets words for the status line."""

    KIND = "plot"
    BINDINGS: ClassVar[list[Any]] = [Binding(keys, action, show=False) for keys, action, _, _ in PLOT_KEYS]

    def __init__(self, title: str = "", *, label: str = "", id: str | None = None) -> None:
        super().__init__(title, label=label, id=id)
        self.when_entered: Callable[[Reading], object] = lambda _reading: None

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Without a chart the keys belong to the screen."""
        return self.chart is not None or action not in {action.partition("(")[0] for _, action, _, _ in PLOT_KEYS}

    def action_cursor(self, by: int) -> None:
        """The readout's cursor, to another data point; what is seen follows it."""
        if self.chart is None or self.drawn is None:
            return
        axis, look = self.axes()[0], self.look
        look.cursor = moved_cursor(self.chart, look, axis, by)
        if look.cursor is not None and look.x is not None:
            at = float(axis.transform.to(look.cursor))
            low, high = look.x
            shift = min(at - low, 0.0) + max(at - high, 0.0)
            look.x = (low + shift, high + shift)
        self.draw_soon()

    def action_curve(self, by: int) -> None:
        """The cursor goes along another trace."""
        count = len(seen_traces(self.chart, self.look)) if self.chart is not None else 0
        if count:
            self.look.active = (self.look.active + by) % count
            if self.look.cursor is None:
                self.action_cursor(0)
            self.draw_soon()

    def action_second(self) -> None:
        """A second cursor where the first one is, or none."""
        look = self.look
        if look.second is not None:
            look.second = None
        else:
            if look.cursor is None:
                self.action_cursor(0)
            look.second = look.cursor
        self.draw_soon()

    def action_zoom(self, by: float) -> None:
        """Zoom about the cursor; without one about the middle."""
        self._zoom(by, True)

    def action_zoom_x(self, by: float) -> None:
        """Zoom the X axis alone."""
        self._zoom(by, False)

    def _zoom(self, by: float, both: bool) -> None:
        if self.drawn is None:
            return
        axes = self.axes()
        about = [0.5 * sum(axis.span) for axis in axes]
        here = self.here()
        if here is not None:
            for number, value in enumerate((here.x, here.y)):
                at = float(axes[number].transform.to(value))
                if axes[number].span[0] <= at <= axes[number].span[1]:
                    about[number] = at
        self.look.zoom(axes, by, (about[0], about[1] if both else None))
        self.draw_soon()

    def action_pan(self, across: int, up: int) -> None:
        """Move what is seen by a quarter."""
        if self.drawn is not None:
            self.look.pan(self.axes(), _PAN * across, _PAN * up)
            self.draw_soon()

    def action_fit(self) -> None:
        """See all again."""
        self.look.fit()
        self.draw_soon()

    def action_scale(self, axis: str) -> None:
        """The next scale of an axis."""
        if self.chart is not None:
            scale = self.look.scale_next(self.chart, axis)
            self.when_said(f"{axis.upper()} axis: { {'lin': 'linear'}.get(scale, scale) }")
            self.draw_soon()

    def action_hide(self, number: int) -> None:
        """Show or hide a trace; the last one that is seen stays."""
        traces = self.chart.traces if self.chart is not None else ()
        if number > len(traces):
            self.when_said(f"there are {len(traces)} curves" if traces else "there is no curve")
            return
        name, hidden = traces[number - 1].name, self.look.hidden
        if name in hidden:
            hidden.discard(name)
        elif len(hidden) + 1 < len(traces):
            hidden.add(name)
        self.draw_soon()

    def here(self) -> Reading | None:
        """What is under the cursor, on the trace that it goes along."""
        if self.chart is None or self.drawn is None or self.look.cursor is None:
            return None
        traces = seen_traces(self.chart, self.look)
        scales = (self.drawn.axes[0].transform, self.drawn.axes[1].transform)
        return read(traces[min(self.look.active, len(traces) - 1)], self.look.cursor, scales) if traces else None

    def action_enter(self) -> None:
        """What is under the cursor."""
        reading = self.here()
        if reading is None:
            self.action_cursor(0)
        else:
            self.when_entered(reading)
