"""What the mouse does in a plot: the wheel zooms, dragging draws a box, moves what is seen, or moves a point."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from textual import events

from lidarcheck.tui.plots.pane import PlotPane
from lidarcheck.tui.plots.transform import Span

__all__ = ["PlotMouse"]

_LEFT, _RIGHT = 1, 3
_WHEEL = 2.0
_LEAST_BOX = 2
"""Cells that a box has at least along an axis; what is smaller is a click."""


class _Drag(NamedTuple):
    """Where it began, in cells of the data; `point`: the index of the point that is dragged, None for none; `spans`:
    what was seen at its beginning.
    """

    button: int
    column: int
    row: int
    point: int | None
    spans: tuple[Span, Span]


class PlotMouse(PlotPane):
    """`when_dragged`: gets a point of the trace `chart.drag`, its y, and whether the hand has let go."""

    def __init__(self, title: str = "", *, label: str = "", id: str | None = None) -> None:
        super().__init__(title, label=label, id=id)
        self.when_dragged: Callable[[int, float, bool], object] = lambda _index, _y, _done: None
        self.when_said: Callable[[str], object] = lambda _words: None
        self._drag: _Drag | None = None

    def _cell(self, event: events.MouseEvent) -> tuple[int, int]:
        """(column, row) of the data under the pointer; beside them below 0 or beyond."""
        left = 0 if self.drawn is None else self.drawn.left
        return event.x - left, event.y - 1

    # The wheel

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Zoom in."""
        self._wheel(event, _WHEEL)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Zoom out."""
        self._wheel(event, 1.0 / _WHEEL)

    def _wheel(self, event: events.MouseEvent, by: float) -> None:
        if self.drawn is None:
            return
        event.stop()
        axes = self.axes()
        (column, row), (x, y) = self._cell(event), axes
        across = x.transformed(float(np.clip(column, 0, x.cells - 1)))
        up = y.transformed(float(np.clip(y.cells - 1 - row, 0, y.cells - 1)))
        # Over the ticks of an axis that axis alone.
        self.look.zoom(axes, by, (across if column >= 0 else None, up if row < y.cells else None))
        self.draw_soon()

    # Dragging

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """A drag may begin."""
        if self.drawn is None or event.button not in (_LEFT, _RIGHT):
            return
        (column, row), (x, y) = self._cell(event), self.drawn.axes
        if 0 <= column < x.cells and 0 <= row < y.cells:
            point = self._point_at(column, row) if event.button == _LEFT else None
            self._drag = _Drag(event.button, column, row, point, (x.span, y.span))
            self.capture_mouse()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """The drag goes on."""
        drag, drawn = self._drag, self.drawn
        if drag is None or drawn is None:
            return
        column, row = self._cell(event)
        if drag.button == _RIGHT:
            x, y = drawn.axes
            step = [(span[1] - span[0]) / max(axis.cells - 1, 1) for span, axis in zip(drag.spans, (x, y), strict=True)]
            across, up = (drag.column - column) * step[0], (row - drag.row) * step[1]
            if (column, row) != (drag.column, drag.row):
                self.look.x = (drag.spans[0][0] + across, drag.spans[0][1] + across)
                self.look.y = (drag.spans[1][0] + up, drag.spans[1][1] + up)
        elif drag.point is not None:
            self.when_dragged(drag.point, self._height(row), False)
        else:
            self.look.box = (drag.column, drag.row, column, row)
        self.draw_soon()

    def on_mouse_up(self, event: events.MouseUp) -> None:
        """The hand lets go: zoom to the box, set the point, or read what was clicked at."""
        drag, drawn = self._drag, self.drawn
        self._drag = None
        self.release_mouse()
        if drag is None or drawn is None or drag.button == _RIGHT:
            return
        column, row = self._cell(event)
        self.look.box = None
        moved = (column, row) != (drag.column, drag.row)
        if drag.point is not None and moved:
            self.when_dragged(drag.point, self._height(row), True)
        elif min(abs(column - drag.column), abs(row - drag.row)) >= _LEAST_BOX:
            self._zoom_to(drag, column, row)
        elif not moved:
            self._read_at(column)
        self.draw_soon()

    def _height(self, row: int) -> float:
        """The y of a row."""
        assert self.drawn is not None
        y = self.drawn.axes[1]
        return y.value(float(np.clip(y.cells - 1 - row, 0, y.cells - 1)))

    def _zoom_to(self, drag: _Drag, column: int, row: int) -> None:
        assert self.drawn is not None
        x, y = self.drawn.axes
        columns = sorted(int(np.clip(one, 0, x.cells - 1)) for one in (drag.column, column))
        rows = sorted(y.cells - 1 - int(np.clip(one, 0, y.cells - 1)) for one in (drag.row, row))
        self.look.x = (x.transformed(columns[0]), x.transformed(columns[1]))
        self.look.y = (y.transformed(rows[0]), y.transformed(rows[1]))

    def _read_at(self, column: int) -> None:
        """The readout at the data point nearest to a column."""
        assert self.drawn is not None
        if self.chart is None:
            return
        x = self.drawn.axes[0]
        places = np.concatenate([trace.places for trace in self.chart.traces])
        at = x.place(places)
        if np.isfinite(at).any():
            self.look.cursor = float(places[int(np.nanargmin(np.abs(at - column - 0.5)))])

    def _point_at(self, column: int, row: int) -> int | None:
        """The point of the trace that can be dragged within a cell of the pointer."""
        chart, drawn = self.chart, self.drawn
        if chart is None or drawn is None or chart.drag is None:
            return None
        trace = chart.traces[chart.drag]
        x, y = drawn.axes
        far = np.maximum(np.abs(x.place(trace.x) - column - 0.5), np.abs(y.cells - y.place(trace.y) - row - 0.5))
        if not np.isfinite(far).any() or float(np.nanmin(far)) > 1.0:
            return None
        return int(np.nanargmin(far))
