"""A screen that shows a workflow's pages: a list of what can be computed, and words, tables and figures of one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal

from lidarcheck.session.model_choice import NONE, model_after
from lidarcheck.session.project import Entry
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.plots.board import PlotBoard
from lidarcheck.tui.screens.pages.export import Export, Exports
from lidarcheck.tui.screens.pages.lines import (
    job_line,
    name_room,
    no_page_lines,
    note_lines,
    word_lines,
)
from lidarcheck.tui.screens.pages.work import PageWork
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, wrapped

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["PAGE_ROWS", "PageView"]

PAGE_ROWS = 4
"""How far Page Up and Page Down go in a short list."""
_BOTH_FROM = 130
_REST_S = 0.15


class PageView(PageWork):
    """Has `jobs()` computed, one at a time, in a thread, and shows the last page of each."""

    EMPTY: ClassVar[str] = ""
    """What the list says where there is nothing to compute: what files are needed, and what they are called."""
    DEFAULT_CSS = """
    PageView #jobs { height: 5; }
    PageView #words { display: none; }
    PageView.words #words { display: block; }
    PageView.words #board { display: none; }
    PageView.wide #words { display: block; width: 64; }
    PageView.wide #board { display: block; }
    """

    def __init__(self) -> None:
        super().__init__()
        self.at = 0
        self.turned = 0
        self.kind_of: dict[str, str] = {}
        self.listed: list[Job] = []
        self.exports = Exports(self)
        self._rest: Any = None
        self._renews: Any = None
        self._drawn = 0.0

    # What a screen has of its own

    def jobs(self) -> list[Job]:
        """What can be computed from the project as it is, in the order of the list. Must be quick: it reads no scan."""
        raise NotImplementedError

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """The figures that are seen at once, group after group; one figure at a time by default."""
        return [(figure,) for figure in page.figures()]

    def shown(self, page: Page) -> tuple[str, list[tuple[Figure, str]]]:
        """The title of the figures' pane, and the figures that are seen now, each with the kind it is drawn as."""
        from lidarcheck.figures.axes import kinds_of

        groups = self.groups(page)
        self.turned = min(self.turned, max(len(groups) - 1, 0))
        if not groups:
            return "Figures: none", []
        figures = groups[self.turned]
        families = [kinds_of(figure) or ("histogram",) for figure in figures]
        kinds = [self.kind_of.get(family[0], family[0]) for family in families]
        return f"{self.turned + 1}/{len(groups)}" if len(groups) > 1 else "", list(zip(figures, kinds, strict=True))

    def waited_for(self) -> str:
        """What is being written is written to its end."""
        return f"{self.exports.writing}: still being written ..." if self.exports.writing else ""

    def more_files(self, made: Computed, kind: str) -> Mapping[str, Writer]:
        """What else the command writes to its directory, by the name of the file; a thread writes it."""
        return {}

    # What is shown

    def compose(self) -> ComposeResult:
        """The list above; words and figures below, side by side where there is room."""
        yield Lines("Measurements", label="m", id="jobs")
        with Horizontal():
            yield Lines("Words", label="w", id="words")
            yield PlotBoard()

    @property
    def board(self) -> PlotBoard:
        """The panes of the figures."""
        return self.query_one(PlotBoard)

    def panes(self) -> list[Lines]:
        """Those that can have the focus, without figures' panes that are empty."""
        return [pane for pane in super().panes() if pane.display]

    def on_mount(self) -> None:
        """Figures are drawn for the room that there is."""
        self.query_one("#words", Lines).when_resized = self.board.when_resized = self._draw_page
        self.board.when_said = self.say
        self.query_one("#jobs", Lines).when_resized = self._draw_list

    def on_resize(self, event: events.Resize) -> None:
        """Words and figures side by side, or one of them."""
        wide = event.size.width >= _BOTH_FROM
        self.set_class(wide, "wide")
        if not wide and not self.has_class("words") and self.query_one("#words", Lines).has_focus:
            self.board.tiles()[0].focus()

    def opened(self) -> None:
        """Show the project's files as they are now."""
        self.project_changed()
        self.inputs_changed()

    def inputs_changed(self) -> None:
        """Say what does not belong to them any more, and compute it again once the hand rests, where that is quick."""
        if not self.is_chosen:
            return
        self.draw()
        if self._renews is not None:
            self._renews.stop()
        self._renews = self.set_timer(_REST_S, self.renew)

    def project_changed(self) -> None:
        """List the jobs, with the cursor on the one it was on."""
        self.listed = self.jobs()
        self.at = self.cursor_again([job.name for job in self.listed], self.at)
        self.follow()
        self.draw()

    def choice_changed(self) -> None:
        """Go to the measurement that was chosen, where the list has it."""
        if self.is_mounted and self.listed:
            self.listed = self.jobs()
            self.follow()
            self.draw()

    def measured_files(self, number: int) -> tuple[Path, ...]:
        """The files of a job that may be a measurement that all screens look at."""
        return self.listed[number].files

    def follow(self) -> None:
        """Put the cursor on what the chosen measurement is in, unless it is there."""
        path = self.host.choice.measured(self.host.project)
        if path is None or self.job is None or path in self.measured_files(self.at):
            return
        name = self.host.choice.of("measurement")
        having = [number for number in range(len(self.listed)) if path in self.measured_files(number)]
        self.at = next((n for n in having if self.listed[n].name == name), having[0] if having else self.at)

    def choose_measured(self) -> None:
        """What is under the cursor is looked at from now on, on every screen; nothing where several are."""
        own = {entry.path for kind in ("scan", "profile") for entry in self.host.project.of(kind, sound=False)}
        files = [path for path in self.measured_files(self.at) if path in own] if self.job is not None else []
        if files and self.host.choice.measured(self.host.project) not in files:
            self.host.choice.choose_measured(files[0], self.host.project)

    @property
    def job(self) -> Job | None:
        """What is under the cursor."""
        return self.listed[self.at] if self.listed else None

    @property
    def made(self) -> Computed | None:
        """What was computed of what is under the cursor, with these choices; its files may be others now: `state`."""
        return self.known(self.job)[1] if self.job is not None else None

    @property
    def state(self) -> str:
        """Whether that belongs to what is set, in words."""
        return self.known(self.job)[0] if self.job is not None else ""

    @property
    def page(self) -> Page | None:
        """Its page."""
        made = self.made
        return None if made is None else made.page

    def draw(self) -> None:
        """The list at once; the page too, but while a key is held down only when it rests."""
        self._draw_list()
        if self._rest is not None:
            self._rest.stop()
            self._rest = None
        now = time.monotonic()
        if now - self._drawn > _REST_S:
            self._draw_page()
        else:
            self._rest = self.set_timer(_REST_S, self._draw_page)
        self._drawn = now

    def _draw_list(self) -> None:
        lines = [self._job_line(number, job) for number, job in enumerate(self.listed)]
        pane = self.query_one("#jobs", Lines)
        pane.show(lines or wrapped(self.EMPTY, pane.size.width - 1, "dim"), cursor=self.at if lines else None)

    def _draw_page(self) -> None:
        made, job = self.made, self.job
        if not self.size.width:
            return  # another screen is seen
        words, board = self.query_one("#words", Lines), self.board
        # A pane that is not seen is made ready for the place that it will have.
        width = (words.size.width or self.size.width) - 1
        if made is None or job is None:
            words.show(self._no_page(width), title="Words")
            board.show_lines(self._no_page((board.size.width or self.size.width) - 1), "Figures")
            return
        lines = note_lines(job, width) + word_lines(made.page, max(width, 20), self.host.inside)
        state = self.state
        words.show(lines, title=f"{job.name}: {made.page.title}", state=state)
        if board.size.width:
            title, drawn = self.shown(made.page)
            board.show_figures(drawn, title, state)

    def _job_line(self, number: int, job: Job) -> Line:
        return job_line(job, self.known(job)[0], self.fault_of(job), number == self.at, name_room(self.listed))

    def _no_page(self, width: int) -> list[Line]:
        job = self.job
        if job is None:
            return wrapped(self.EMPTY, width, "dim")
        return no_page_lines(job, self.is_computing(job), self.fault_of(job), width)

    def next_model(self, now: Entry | None, alone: str) -> None:
        """Simulate with the model after `now`, or with none, which leaves what `alone` says. What was computed with
        another one is kept.
        """
        project = self.host.project
        if not project.of("model"):
            self.say("there is no model in the project")
            return
        name = model_after(project, now)
        self.say(f"no model: {alone} alone" if name == NONE else f"model: {name}; r computes with it")
        self.host.choice.choose("model", name)
        self.project_changed()

    # Actions

    def action_move(self, key: str) -> None:
        """The cursor in the list; in the other panes the keys scroll."""
        for pane in (self.query_one("#words", Lines), *self.board.tiles()):
            if pane.has_focus:
                pane.scroll_by_key(key)
                return
        self._move_in_list(key)

    def _move_in_list(self, key: str) -> None:
        before, self.at = self.at, cursor_after(key, self.at, len(self.listed), PAGE_ROWS)
        if self.at != before:
            self.turned = 0
            self.query_one("#words", Lines).page(-(10**6))
        if self.job is not None:
            self.host.state.selected[self.NAME] = self.job.name
            self.choose_measured()
        self.draw()

    def action_turn(self, by: int) -> None:
        """Other figures of the page."""
        page = self.page
        count = len(self.groups(page)) if page is not None else 0
        if page is None:
            self.say("nothing is computed here yet: r computes it")
        elif count < 2:
            self.say("there are no other figures")
        else:
            self.turned = (self.turned + by) % count
            self.say(f"figures {self.turned + 1} of {count}")
            self.draw()

    def action_next_distance(self, by: int) -> None:
        """The next measurement of the list, wherever the focus is."""
        self._move_in_list("down" if by > 0 else "up")

    def action_kind(self) -> None:
        """Draw the figures that are seen as the next kind."""
        from lidarcheck.figures.axes import kinds_of

        page = self.page
        drawn = self.shown(page)[1] if page is not None else []
        families = dict.fromkeys(kinds_of(figure) for figure, _ in drawn if kinds_of(figure))
        if not families:
            self.say("these figures are drawn in one way" if drawn else "there is no figure")
            return
        for family in families:
            now = self.kind_of.get(family[0], family[0])
            self.kind_of[family[0]] = family[(family.index(now) + 1) % len(family)]
        self.say(f"drawn as: {', '.join(self.kind_of[family[0]] for family in families)}")
        self.draw()

    def action_words(self) -> None:
        """Words instead of figures, or figures again."""
        self.toggle_class("words")
        shown = self.query_one("#words", Lines) if self.has_class("words") else self.board.tiles()[0]
        self.call_after_refresh(self.draw)
        shown.focus()

    def action_look_again(self) -> None:
        """Read the project again."""
        self.host.read_project()

    def action_export(self) -> None:
        """Write page, numbers and pictures to a directory that is asked for."""
        job, made = self.job, self.made
        if job is None or made is None:
            self.say("nothing is computed here yet: r computes it")
        else:
            kind = self.kind_of.get("histogram", "histogram")
            files = self.more_files(made, kind)
            self.exports.ask_directory(Export(job, made, kind, files, self.state, self.origin_of(job)))
