"""A pane that shows a chart: drawn anew for its size, for what is looked at of it, and when the chart is another."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence
from typing import Any, cast

from rich.cells import cell_len
from textual import events

from lidarcheck.figures.words import squeezed
from lidarcheck.tui.plots.chart import Chart
from lidarcheck.tui.plots.draw import Drawn, drawn, legend
from lidarcheck.tui.plots.look import Look, axes_of
from lidarcheck.tui.plots.marks import Level
from lidarcheck.tui.plots.transform import Axis
from lidarcheck.tui.widgets.lines import Line, Lines, line, printable

__all__ = ["PlotPane"]

_EVERY_S = 0.1
"""While a key is held a plot is drawn ten times a second at most."""


class PlotPane(Lines):
    """`looks`: how each chart is looked at, by its key; panes of one screen may share it. `level`: its marks, those of
    the app where it says nothing of its own.
    """

    def __init__(self, title: str = "", *, label: str = "", id: str | None = None) -> None:
        super().__init__(title, label=label, id=id)
        self.chart: Chart | None = None
        self.drawn: Drawn | None = None
        self.looks: dict[Hashable, Look] = {}
        self._shown_s = float("-inf")
        self._before = ""
        self._timer: Any = None

    @property
    def level(self) -> Level:
        """The marks of the terminal, as the app has them."""
        return cast("Level", getattr(self.app, "marks", "braille"))

    @property
    def look(self) -> Look:
        """How the chart is looked at; of none, a new one."""
        if self.chart is None:
            return Look()
        return self.looks.setdefault(self.chart.key, Look())

    def plot(self, chart: Chart, *, state: str = "", before: str = "") -> None:
        """Show a chart; `state` as of `show`, `before`: what stands before its title."""
        self.chart, self.state, self._before = chart, state, before
        self.look.active = min(self.look.active, max(len(chart.traces) - 1, 0))
        self.draw_now()

    def show(
        self, lines: Sequence[Line], *, title: str | None = None, cursor: int | None = None, state: str = ""
    ) -> None:
        """Show lines in the place of a chart."""
        self.chart = self.drawn = None
        super().show(lines, title=title, cursor=cursor, state=state)

    def axes(self) -> tuple[Axis, Axis]:
        """What is looked at now, which may not be drawn yet: keys come faster than drawings."""
        assert self.chart is not None
        assert self.drawn is not None
        x, y = self.drawn.axes
        return axes_of(self.chart, self.look, (x.cells, y.cells))

    def draw_soon(self) -> None:
        """Draw what is looked at now, soon after the last time at the earliest."""
        wait = _EVERY_S - (time.monotonic() - self._shown_s)
        if wait <= 0.0:
            self.draw_now()
        elif self._timer is None:
            self._timer = self.set_timer(wait, self.draw_now)

    def draw_now(self) -> None:
        """Draw the chart."""
        self._timer = None
        if self.chart is None or not self.size.area:
            return
        self._shown_s = time.monotonic()
        self._title = f"{self._before}{self.chart.title}"
        more = self._words_and_legend()[2]
        self.drawn = drawn(self.chart, self.look, (self.size.width, self.rows), self.level, more)
        lines = [line(" no room for a plot here", "dim")] if self.drawn is None else self.drawn.lines
        super().show(lines, title=self._title, state=self.state)

    def _heading(self) -> Line:
        """The title, how far it is zoomed, and as much of the legend as has room."""
        if self.chart is None:
            return super()._heading()
        words, marks, _ = self._words_and_legend()
        rest = self._title_room() - cell_len(words) - sum(cell_len(text) for text, _ in marks)
        look = line(words, "focus" if self.has_focus else "title")
        return (*look, *marks, *line(" " * (rest + (1 if self.state else 0))))

    def _title_room(self) -> int:
        return max(self.size.width - (cell_len(printable(self._short_state)) + 1 if self.state else 0), 0)

    def _words_and_legend(self) -> tuple[str, Line, Line]:
        """The words of the title, the legend behind it, and what of that has no room there."""
        assert self.chart is not None
        label = f"[{self.label}] " if self.label else ""
        words = printable(f"{'>' if self.has_focus else ' '}{label}{self._title}{self._zoom_words()}")
        room = self._title_room()
        if cell_len(words) > room:
            words = squeezed(words, room, "..")[:room]
        return words, *legend(self.chart, self.look, self.level, room - cell_len(words) - 1)

    def _zoom_words(self) -> str:
        """How far it is zoomed."""
        if self.drawn is None or self.chart is None or not self.look.zoomed:
            return ""
        factor = self.drawn.zoom
        return f" x {factor:.3g}"

    def on_resize(self, _event: events.Resize) -> None:
        """Another size, another drawing; zoom and cursor stay. The base's own is called besides, by Textual."""
        if self.chart is not None:
            self.draw_now()
