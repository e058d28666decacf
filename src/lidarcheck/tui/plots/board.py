"""Several plots beside and below each other: the figures of a page, each in a pane of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from textual import events
from textual.app import ComposeResult
from textual.containers import Grid

from lidarcheck.tui.plots.look import Look
from lidarcheck.tui.plots.plot import Plot
from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure

__all__ = ["LEAST_HEIGHT", "LEAST_WIDTH", "PlotBoard"]

LEAST_WIDTH, LEAST_HEIGHT = 38, 10
"""What a figure with its title needs to be read."""
_GAP, _MOST, _WIDE = 2, 9, 60
"""Columns between figures; how many there are at most; columns from which on a title says which of how many it is."""


class PlotBoard(Grid):
    """`across`: how many are side by side at most. `when_resized`: there is other room."""

    DEFAULT_CSS = "PlotBoard { width: 1fr; height: 1fr; }"

    def __init__(self) -> None:
        super().__init__(id="board")
        self.when_resized: Callable[[], object] = lambda: None
        self.when_said: Callable[[str], object] = lambda _words: None
        self.across = _MOST
        self._looks: dict[Hashable, Look] = {}
        self._figures: list[tuple[Figure, str]] = []
        self._title, self._state, self._common = "", "", ""

    def compose(self) -> ComposeResult:
        """One is seen at first."""
        for number in range(1, _MOST + 1):
            one = Plot(
                "Figures", label="f" if number == 1 else str(number), id=f"figures{number if number > 1 else ''}"
            )
            one.display = number == 1
            yield one

    def on_mount(self) -> None:
        """All panes look at a figure alike, in whichever of them it is."""
        for number, pane in enumerate(self.tiles()):
            pane.looks, pane.when_said = self._looks, self._say
            pane.when_resized = lambda number=number: self._draw(number)  # type: ignore[misc]
            pane.when_entered = lambda reading: self._say(f"{reading.trace.name} at {reading.x:g}: {reading.text}")

    def _say(self, words: str) -> None:
        self.when_said(words)

    def tiles(self) -> list[Plot]:
        """All panes, seen or not."""
        return list(self.query(Plot))

    @property
    def beside(self) -> int:
        """How many figures have room side by side."""
        return max(min((self.size.width + _GAP) // (LEAST_WIDTH + _GAP), self.across), 1)

    def room(self, most: int) -> int:
        """How many figures, up to so many, can be seen at once."""
        return max(min(self.beside * max(self.size.height // LEAST_HEIGHT, 1), most, _MOST), 1)

    @property
    def columns(self) -> int:
        """Of the first pane, for words in it."""
        return self.tiles()[0].size.width

    def show_lines(self, lines: Sequence[Line], title: str, state: str = "") -> None:
        """Words in the place of figures."""
        self._figures = []
        self._lay_out(1)
        self.tiles()[0].show(lines, title=title, state=state)

    def show_figures(self, figures: Sequence[tuple[Figure, str]], title: str, state: str) -> None:
        """Figures, each with the kind that it is drawn as; `title`: what they are, said before the first one's own."""
        self._figures = list(figures[: self.room(len(figures))])
        self._title, self._state = title, state
        self._common = _common([figure.title for figure, _ in self._figures])
        if not figures:
            self.show_lines([line(" there is no figure", "dim")], title, state)
            return
        self._lay_out(len(self._figures))
        for number in range(len(self._figures)):
            self._draw(number)

    def _lay_out(self, count: int) -> None:
        beside = min(count, self.beside)
        down = math.ceil(count / beside)
        if (self.styles.grid_size_columns, self.styles.grid_size_rows) != (beside, down):
            self.styles.grid_gutter_vertical = _GAP if beside > 1 else 0
            self.styles.grid_size_columns, self.styles.grid_size_rows = beside, down
        for number, pane in enumerate(self.tiles()):
            if pane.display and number >= count and pane.has_focus:
                self.tiles()[0].focus()
            pane.display = number < count

    def _draw(self, number: int) -> None:
        pane = self.tiles()[number]
        if number >= len(self._figures) or not pane.size.area:
            return
        figure, kind = self._figures[number]
        from lidarcheck.tui.plots.from_figure import chart_of

        chart = chart_of(figure, kind, pane.size.width)
        before = f"{self._title} " if number == 0 and self._title and pane.size.width >= _WIDE else ""
        if chart is not None:
            pane.plot(replace(chart, title=chart.title.removeprefix(self._common)), state=self._state, before=before)
        else:
            from lidarcheck.figures.terminal import figure_text

            text = figure_text(figure, width=pane.size.width, height=pane.rows + 1, plain=pane.level == "ascii")
            title, *rows = text.splitlines()
            title = f"{before}{title.removeprefix(self._common)}"
            pane.show([line(row) for row in rows], title=title, state=self._state)

    def on_resize(self, _event: events.Resize) -> None:
        """There is other room."""
        self.when_resized()


def _common(titles: Sequence[str]) -> str:
    """What all of several titles begin with, up to a colon: it is said by the list, and leaves a legend no room."""
    before = titles[0].rpartition(": ")[0] if titles else ""
    return f"{before}: " if before and len(titles) > 1 and all(one.startswith(f"{before}: ") for one in titles) else ""
