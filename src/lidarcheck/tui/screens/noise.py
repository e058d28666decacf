"""Noise: the panels of a laboratory, what the sensor shows of each and of all, and the model's beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal

from lidarcheck.session.model_choice import chosen_model
from lidarcheck.tui.jobs.job import Job
from lidarcheck.tui.jobs.noise import NoisePage, halls_of, noise_jobs
from lidarcheck.tui.plots.board import PlotBoard
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PAGE_ROWS, PageView
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, line

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page, Table

__all__ = ["Noise"]

_ALL = "noise.all"
_TALL_FROM = 40
_OF_A_PANEL = 3
"""Figures of each panel: amplitude, distance, walk."""


class Noise(PageView):
    """Halls, the panels of one, and figures of a panel or of all."""

    NAME = "noise"
    EMPTY = "no frames of panels: scans of one scene, numbered (frame_00.txt, frame_01.txt), or called panel, lab, hall"
    WORDS: ClassVar[dict[str, str]] = {
        "jobs": "Frames of one hall with panels: scans of one directory whose names differ by the number at their end, "
        "and single scans called panel, lab or hall. An ideal scan beside them says where panels are and what they "
        "are of; with it a model simulates the same; o chooses which. Enter or r computes, Ctrl+R looks at the "
        "files again.",
        "panels": "The panels that were found, in order of range, with how often each is detected. '>' marks the one "
        "whose figures are shown; n and p go on, and so do the arrows here.",
        "words": "What lidarcheck panels says of them: tables of all panels, distances between real and simulated.",
        "figures": "Amplitude, distance and walk of the panel with the '>'; b shows all panels instead: detection, "
        "noise, amplitude over range, walk and noise over amplitude. v draws distributions in another way.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("noise"), *MOVES]
    DEFAULT_CSS = """
    Noise #jobs { height: 3; }
    Noise #panels { height: 5; }
    Noise.tall #jobs { height: 6; }
    Noise.tall #panels { height: 14; }
    """

    def __init__(self) -> None:
        super().__init__()
        self.all = False
        self._elsewhere = 0

    def compose(self) -> ComposeResult:
        """Halls, their panels, and words and figures below."""
        yield Lines("Measurements", label="m", id="jobs")
        yield Lines("Panels", label="p", id="panels")
        with Horizontal():
            yield Lines("Words", label="w", id="words")
            yield PlotBoard()

    def on_mount(self) -> None:
        """What was seen last; the base's own is called besides, by Textual."""
        self.all = self.host.state.selected.get(_ALL) == "yes"

    def on_resize(self, event: events.Resize) -> None:
        """More of the lists where there is room."""
        self.set_class(event.size.height >= _TALL_FROM, "tall")

    def jobs(self) -> list[Job]:
        """The halls."""
        return noise_jobs(self.host.project, self.host.choice.of("model"))

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """A panel's figures together; of all panels so many as can be read."""
        assert isinstance(page, NoisePage)
        if self.all:
            return together(page.over_all, self.board.room(4))
        return [group for own in page.own for group in together(own, self._room)]

    @property
    def _room(self) -> int:
        """How many figures of a panel are seen at once."""
        return self.board.room(_OF_A_PANEL)

    def _panel(self, page: NoisePage) -> int:
        """The number of the panel that is looked at."""
        parts = [number for number, own in enumerate(page.own) for _ in together(own, self._room)]
        at = self._elsewhere if self.all else self.turned
        return parts[min(at, len(parts) - 1)] if parts else 0

    def _go_to(self, page: NoisePage, panel: int) -> None:
        """Look at the first figures of a panel."""
        self.turned = sum(len(together(own, self._room)) for own in page.own[:panel])

    def draw(self) -> None:
        """The panels as well."""
        super().draw()
        page, pane = self.page, self.query_one("#panels", Lines)
        if not isinstance(page, NoisePage) or page.panels is None:
            pane.show([line("  none found yet", "dim")] if self.listed else [], title="Panels")
            return
        last = len(page.panels.rows) - 1
        at = min(self._panel(page), last)
        title = "Panels, figures of all of them (b: of one)" if self.all else f"Panel {at + 1} of {last + 1}"
        pane.show(_panel_lines(page.panels, at), title=title, cursor=at + 1)

    def action_move(self, key: str) -> None:
        """In the panels' pane the arrows choose the panel."""
        if not self.query_one("#panels", Lines).has_focus:
            super().action_move(key)
        elif isinstance(self.page, NoisePage):
            if self.all:
                self.action_over_all()
            page = self.page
            self._go_to(page, cursor_after(key, self._panel(page), len(page.own), PAGE_ROWS))
            self.draw()

    def action_next_distance(self, by: int) -> None:
        """The next panel."""
        self.action_turn(by)

    def action_over_all(self) -> None:
        """All panels' figures, or those of the panel that was looked at."""
        self.all = not self.all
        self.turned, self._elsewhere = self._elsewhere, self.turned
        self.host.state.selected[_ALL] = "yes" if self.all else ""
        self.say("figures of all panels" if self.all else "figures of one panel")
        self.draw()

    def action_model(self) -> None:
        """Another model; what was computed with this one is kept."""
        project, chosen = self.host.project, self.host.choice.of("model")
        hall = next((hall for hall in halls_of(project) if self.job is not None and hall.name == self.job.name), None)
        beside, variant = (project.root, "") if hall is None else ((project.root / hall.name).parent, hall.variant)
        self.next_model(chosen_model(project, chosen, beside, variant), "real frames")


def _panel_lines(table: Table, at: int) -> list[Line]:
    """The header and a line for each panel, '>' before the one that is looked at."""
    widths = [max(map(len, column)) for column in zip(table.header, *table.rows, strict=True)]
    texts = [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in (table.header, *table.rows)
    ]
    marked = (line(f"{'>' if i == at else ' '} {text}") for i, text in enumerate(texts[1:]))
    return [line(f"  {texts[0]}", "title"), *marked]
