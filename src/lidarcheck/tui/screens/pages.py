"""A screen that shows a workflow's pages: a list of what can be computed, and words, tables and figures of one."""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.core.jobs import Cancelled, Job, Pages
from lidarcheck.tui.screens.base import View
from lidarcheck.tui.screens.page_lines import figure_lines, word_lines
from lidarcheck.tui.widgets.lines import Line, Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.figures import Figure, Page

__all__ = ["MOVES", "PageView"]

MOVES: list[Binding] = [
    Binding(key, f"move('{key}')", show=False) for key in ("up", "down", "pageup", "pagedown", "home", "end")
]
_BOTH_FROM = 130
_TELL_S = 0.25


class PageView(View):
    """Has `jobs()` computed, one at a time, in a thread, and shows the last page of each."""

    EMPTY: ClassVar[str] = ""
    """What the list says where there is nothing to compute: what files are needed, and what they are called."""
    DEFAULT_CSS = """
    PageView #jobs { height: 5; }
    PageView #words { display: none; }
    PageView.words #words { display: block; }
    PageView.words #figures { display: none; }
    PageView.wide #words { display: block; width: 64; }
    PageView.wide #figures { display: block; }
    """

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.at = 0
        self.turned = 0
        self.kind_of: dict[str, str] = {}
        self.listed: list[Job] = []
        self.pages = Pages()
        self.faults: dict[Hashable, str] = {}
        self.running: Job | None = None
        self._stop = threading.Event()
        self._told = 0.0

    # What a screen has of its own

    def jobs(self) -> list[Job]:
        """What can be computed from the project as it is, in the order of the list. Must be quick: it reads no scan."""
        raise NotImplementedError

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """The figures that are seen at once, group after group; one figure at a time by default."""
        return [(figure,) for figure in page.figures()]

    # What is shown

    def compose(self) -> ComposeResult:
        """The list above; words and figures below, side by side where there is room."""
        yield Lines("Measurements", label="m", id="jobs")
        with Horizontal():
            yield Lines("Words", label="w", id="words")
            yield Lines("Figures", label="f", id="figures")

    def on_mount(self) -> None:
        """Figures are drawn for the room that there is."""
        for name in ("words", "figures"):
            self.query_one(f"#{name}", Lines).when_resized = self.draw

    def on_resize(self, event: events.Resize) -> None:
        """Words and figures side by side, or one of them."""
        self.set_class(event.size.width >= _BOTH_FROM, "wide")

    def opened(self) -> None:
        """Show the project's files as they are now."""
        self.project_changed()

    def project_changed(self) -> None:
        """List the jobs, with the cursor on the one it was on."""
        self.listed = self.jobs()
        wanted = self.ours.state.selected.get(self.NAME, "")
        names = [job.name for job in self.listed]
        self.at = names.index(wanted) if wanted in names else min(self.at, max(len(names) - 1, 0))
        self.draw()

    @property
    def job(self) -> Job | None:
        """What is under the cursor."""
        return self.listed[self.at] if self.listed else None

    @property
    def page(self) -> Page | None:
        """The page of what is under the cursor, where it was computed."""
        return self.pages.of(self.job) if self.job is not None else None

    def draw(self) -> None:
        """All panes."""
        lines = [self._job_line(job) for job in self.listed]
        empty = [line(f"  {self.EMPTY}", "dim")]
        self.query_one("#jobs", Lines).show(lines or empty, cursor=self.at if lines else None)
        page = self.page
        words, figures = self.query_one("#words", Lines), self.query_one("#figures", Lines)
        if page is None:
            words.show(self._no_page(), title="Words")
            figures.show(self._no_page(), title="Figures")
            return
        words.show(word_lines(page, max(words.size.width - 1, 20)), title=page.title)
        groups = self.groups(page)
        self.turned = min(self.turned, max(len(groups) - 1, 0))
        group = groups[self.turned] if groups else ()
        title = f"Figures {self.turned + 1} of {len(groups)}" if groups else "Figures: none"
        room = (figures.size.width, figures.rows)
        figures.show(figure_lines(group, self.kind_of, room), title=title)

    def _job_line(self, job: Job) -> Line:
        if job.fault or self.faults.get(job.key()):
            return (
                (f" {job.name:26} ", "text"),
                ("cannot   ", "bad"),
                (self.ours.inside(job.fault or self.faults[job.key()]), "dim"),
            )
        state = "running" if self.running is job else "computed" if self.pages.of(job) is not None else "-"
        return (
            (f" {job.name:26} ", "text"),
            (f"{state:9}", "good" if state == "computed" else "dim"),
            (job.words, "dim"),
        )

    def _no_page(self) -> list[Line]:
        job = self.job
        if job is None:
            return []
        fault = job.fault or self.faults.get(job.key(), "")
        if fault:
            return [line(f" {self.ours.inside(fault)}", "bad")]
        return [line(" computing ..." if self.running is job else " not computed yet: r computes it", "dim")]

    # Actions

    def action_move(self, key: str) -> None:
        """The cursor in the list; in the other panes the keys scroll."""
        for name in ("words", "figures"):
            if self.query_one(f"#{name}", Lines).has_focus:
                self.query_one(f"#{name}", Lines).page(-1 if key in ("up", "pageup", "home") else 1)
                return
        last = max(len(self.listed) - 1, 0)
        steps = {"up": -1, "down": 1, "pageup": -4, "pagedown": 4, "home": -last, "end": last}
        self.at = max(min(self.at + steps[key], last), 0)
        if self.job is not None:
            self.ours.state.selected[self.NAME] = self.job.name
        self.draw()

    def action_turn(self, by: int) -> None:
        """Other figures of the page."""
        page = self.page
        count = len(self.groups(page)) if page is not None else 0
        if count:
            self.turned = (self.turned + by) % count
            self.draw()

    def action_kind(self) -> None:
        """Draw the figures that are seen as the next kind."""
        from lidarcheck.plots.panels import kinds_of

        page = self.page
        groups = self.groups(page) if page is not None else []
        group = groups[self.turned] if groups else ()
        for family in {kinds_of(figure) for figure in group if kinds_of(figure)}:
            now = self.kind_of.get(family[0], family[0])
            self.kind_of[family[0]] = family[(family.index(now) + 1) % len(family)]
            self.say(f"drawn as: {self.kind_of[family[0]]}")
        self.draw()

    def action_words(self) -> None:
        """Words instead of figures, or figures again."""
        self.toggle_class("words")
        shown = self.query_one("#words" if self.has_class("words") else "#figures", Lines)
        self.call_after_refresh(self.draw)
        shown.focus()

    def action_look_again(self) -> None:
        """Read the project again."""
        self.ours.read_project()

    # Computing

    def action_compute(self) -> None:
        """Compute what is under the cursor, beside the interface."""
        job = self.job
        if job is None:
            self.say("there is nothing to compute here")
        elif job.fault:
            self.say(self.ours.inside(job.fault), bad=True)
        elif self.running is not None:
            self.say(f"{self.running.name} is being computed; x stops it")
        else:
            self.running, self._stop = job, threading.Event()
            self.draw()
            threading.Thread(
                target=self._compute, args=(job, job.key(), self._stop), name=job.name, daemon=True
            ).start()

    def _compute(self, job: Job, key: Hashable, stop: threading.Event) -> None:
        """In a thread. A fault in a computation must not take the interface with it."""

        def tell(done: int, of: int, now: str) -> None:
            if stop.is_set():
                raise Cancelled
            if time.monotonic() - self._told > _TELL_S:
                self._told = time.monotonic()
                self.ours.soon(self._progress, job, f"{job.name}: {now} {done}/{of}   x stops it")

        try:
            tell(0, 1, "reading")
            page = job.compute(tell)
            tell(1, 1, "done")
            self.ours.soon(self._computed, job, key, page)
        except Cancelled:
            self.ours.soon(self._failed, job, key, "", f"{job.name}: stopped")
        except LidarcheckError as error:
            self.ours.soon(self._failed, job, key, "; ".join(error.lines()), error)
        except Exception as error:  # noqa: BLE001 - see above
            words = f"internal error, {type(error).__name__}: {error}"
            self.ours.soon(self._failed, job, key, words, f"error: {job.name}: {words}")

    def _progress(self, job: Job, text: str) -> None:
        if self.running is job:
            self.ours.progress(text)

    def _computed(self, job: Job, key: Hashable, page: Page) -> None:
        self.pages.keep(key, page)
        self.faults.pop(key, None)
        self._ended(job)
        self.say(f"{job.name}: {page.summary}")

    def _failed(self, job: Job, key: Hashable, fault: str, say: Any) -> None:
        if fault:
            self.faults[key] = fault
        self._ended(job)
        self.say(say, bad=bool(fault))

    def _ended(self, job: Job) -> None:
        if self.running is job:
            self.running = None
            self.ours.progress("")
        if self.is_mounted:
            self.draw()

    def action_stop(self) -> None:
        """Stop what is computed."""
        self._stop.set()
        self.say("stopping" if self.running is not None else "nothing is computed")

    def closing(self) -> None:
        """Let a computation end."""
        self._stop.set()


def together(figures: Sequence[Figure], most: int) -> list[tuple[Figure, ...]]:
    """Figures in groups of at most so many."""
    return [tuple(figures[i : i + most]) for i in range(0, len(figures), most)]
