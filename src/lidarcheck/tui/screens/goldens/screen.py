"""Goldens: what runs have proposed for them, what speaks against it, and accepting or dropping it."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.harness.review.review import ReviewReport, review
from lidarcheck.harness.review.wording import objections
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.session import SAVED
from lidarcheck.tui.context import groups_line
from lidarcheck.tui.jobs.proposals import Review, Waiting, kpi_line, reviewed, run_reviews, stamp_of, state_of, waiting
from lidarcheck.tui.screens.goldens.accept import Accepting
from lidarcheck.tui.screens.shared.background import StoppableRun, read_beside
from lidarcheck.tui.screens.shared.kpi_lines import kpi_heading, kpi_lines, moved, name_room
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, hanging, is_old, line

__all__ = ["Goldens"]

_EMPTY = (
    "nothing waits for review",
    "A run on Overview (F2, then r or R) leaves a proposal here where a value is not the golden's.",
    "R reviews every scenario of the project now, which takes 8 seeds each, and 64 where something moved.",
)


class Goldens(Accepting):
    """Proposals, their KPIs, and what speaks against them."""

    NAME = "goldens"
    WORDS: ClassVar[dict[str, str]] = {
        "proposals": "Scenarios for which a run has left a proposal, and those without a golden. A check leaves 8 or "
        "more seeds; a golden is made of all 64, which r runs. a accepts: it reviews once more, asks for a reason "
        "where one is needed, shows what is written, and writes when you agree.",
        "proposed": "The KPIs of the scenario: the golden's value, the proposed one, how far that is off in "
        "tolerances, the smallest change that the proposed value would catch as a golden, and the absolute limits. "
        "'*' marks what a accepts; without a mark it is all of the scenario.",
        "against": "What a reader of the golden would want to know: what needs a reason, which the golden then "
        "carries, and what cannot be accepted at all.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("goldens"), *MOVES]
    DEFAULT_CSS = (
        "Goldens #proposals { height: 2fr; } Goldens #proposed { height: 3fr; } Goldens #against { height: 2fr; }"
    )

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.review: Review = review
        self.waiting: list[Waiting] = []
        self.at = 0
        self.kpi_at = 0
        self.marked: set[str] = set()
        self.looks = 0
        self.states: dict[Path, str] = {}
        self._run = StoppableRun(self, "review", self._ended)

    def compose(self) -> ComposeResult:
        """The scenarios above, the KPIs of one, and what speaks against them."""
        yield Lines("Proposals", label="p", id="proposals")
        yield Lines("KPIs", label="k", id="proposed")
        yield Lines("Before you accept", label="b", id="against")

    def on_resize(self, _event: events.Resize) -> None:
        """What is wrapped is wrapped anew."""
        self.draw()

    @property
    def running(self) -> bool:
        """Whether a review goes on."""
        return self._run.running

    # What waits

    def project_changed(self) -> None:
        """Look at goldens and proposals, beside the interface."""
        paths = [entry.path for entry in self.host.project.of("scenario")]
        read_beside(self.host, "goldens", lambda: [one for one in map(waiting, paths) if one is not None], self._looked)

    def opened(self) -> None:
        """A run may have left something since."""
        self.project_changed()

    def action_look(self) -> None:
        """Look again."""
        self.project_changed()

    def _looked(self, found: Sequence[Waiting]) -> None:
        """What was found; what a review said stays with what has not changed since."""
        said = {one.path: one for one in self.waiting if one.found or one.fault}
        self.waiting = [
            said[one.path] if one.path in said and said[one.path].stamp == one.stamp else one for one in found
        ]
        self.at = self.cursor_again([one.name for one in self.waiting], self.at)
        self.looks += 1
        self.draw()
        self.inputs_changed()

    def context_line(self, width: int) -> Line | None:
        """What a review is of: the files as they are saved."""
        unsaved, scenarios = self.host.session.unsaved(), len(self.host.project.of("scenario"))
        of = f"{SAVED}, {counted(unsaved, 'edit')} not in it" if unsaved else SAVED
        waiting = f"{counted(len(self.waiting), 'proposal')} of {counted(scenarios, 'scenario')}"
        return groups_line([(of, "edited" if unsaved else "title"), (waiting, "text")], width)

    def inputs_changed(self) -> None:
        """Find out, beside the interface, whether proposals belong to them; until then nothing is said of it."""
        self.states = {}
        if self.is_chosen:
            self.draw()
            session, all_of_them = self.host.session, tuple(self.waiting)
            look = lambda: {one.path: state_of(session, one) for one in all_of_them}  # noqa: E731
            read_beside(self.host, "proposals", look, self._belong)

    def _belong(self, states: dict[Path, str]) -> None:
        if states != self.states:
            self.states = states
            self.draw()

    @property
    def chosen(self) -> Waiting | None:
        """The scenario under the cursor."""
        return self.waiting[self.at] if self.at < len(self.waiting) else None

    def draw(self) -> None:
        """All panes."""
        title = f"Proposals: {counted(len(self.waiting), 'scenario')} to review" if self.waiting else "Proposals"
        lines = [self._line(number, one) for number, one in enumerate(self.waiting)]
        pane = self.query_one("#proposals", Lines)
        lines = lines or [part for text in _EMPTY for part in hanging(text, pane.size.width, "dim")]
        pane.show(lines, title=title, cursor=self.at if self.waiting else None)
        self._draw_kpis(self.chosen)
        self._draw_against(self.chosen)

    def _line(self, number: int, one: Waiting) -> Line:
        pointer = ">" if number == self.at else " "
        fell = sum(kpi_line(kpi, one.share).fails for kpi in one.kpis)
        of = self.states.get(one.path, "")
        what = f"{counted(sum(kpi.open for kpi in one.kpis), 'KPI')}{f', {fell} in doubt' if fell else ''}"
        return (
            (f"{pointer}{one.name:24} ", "text"),
            (f"{one.state:24} ", "bad" if one.fault or fell else "text"),
            (f"{of.partition(',')[0]:11} ", "edited" if is_old(of) else "dim"),
            (what, "text"),
        )

    def kpis(self) -> list[str]:
        """The KPIs in the order that they are shown in: what speaks against itself first."""
        one = self.chosen
        if one is None:
            return []
        shown = {kpi.name: kpi_line(kpi, one.share) for kpi in one.kpis if kpi.open}
        return sorted(shown, key=lambda name: (not shown[name].fails, -abs(moved(shown[name]))))

    def _draw_kpis(self, one: Waiting | None) -> None:
        pane, names = self.query_one("#proposed", Lines), self.kpis()
        self.marked &= set(names)
        self.kpi_at = max(min(self.kpi_at, len(names) - 1), 0)
        if one is None or not names:
            words = " no proposal yet: r runs all seeds and makes one" if one else ""
            pane.show([line(words, "dim")], title="KPIs")
            return
        room = name_room(pane.size.width)
        by_name, lines, cursor = {kpi.name: kpi for kpi in one.kpis}, [kpi_heading("proposed", room)], 1
        for number, name in enumerate(names):
            cursor = len(lines) if number == self.kpi_at else cursor
            mark = "*" if name in self.marked else ">" if number == self.kpi_at else " "
            lines += kpi_lines(kpi_line(by_name[name], one.share), mark, room)
        same = len(one.kpis) - len(names)
        if same:
            lines.append(line(f" {counted(same, 'KPI')} as the golden has it", "dim"))
        pane.show(lines, title=f"KPIs of {one.name}", cursor=cursor, state=self.states.get(one.path, ""))

    def _draw_against(self, one: Waiting | None) -> None:
        pane = self.query_one("#against", Lines)
        if one is None:
            lines: list[Line] = []
        elif one.fault:
            lines = hanging(self.host.inside(one.fault), pane.size.width, "bad")
        elif one.found is None:
            lines = [line(" not reviewed yet: r runs all seeds and says what speaks against it", "dim")]
        else:
            said = [self.host.inside(text) for text in objections(one.found)]
            lines = [part for text in said for part in hanging(text, pane.size.width)] or [
                line(" nothing speaks against it: a accepts", "good")
            ]
        pane.show(lines)

    # The cursor and the marks

    def action_move(self, key: str) -> None:
        """The cursor of the pane that has the focus; words scroll."""
        pane = self.app.focused
        if not isinstance(pane, Lines) or pane.id == "against":
            self.query_one("#against", Lines).scroll_by_key(key)
            return
        rows = max(pane.rows, 1)
        if pane.id == "proposed":
            self.kpi_at = cursor_after(key, self.kpi_at, len(self.kpis()), rows)
        else:
            before, self.at = self.at, cursor_after(key, self.at, len(self.waiting), rows)
            if self.at != before:
                self.kpi_at, self.marked = 0, set()
            if self.chosen:
                self.host.state.selected[self.NAME] = self.chosen.name
        self.draw()

    def action_mark(self) -> None:
        """Mark the KPI, or not."""
        names = self.kpis()
        if not names:
            self.say("there is no KPI to mark")
            return
        self.marked ^= {names[self.kpi_at]}
        self.draw()

    # Reviews

    def action_review_one(self) -> None:
        """Review the scenario under the cursor."""
        if self.chosen is None:
            self.say("nothing waits for review; R reviews every scenario")
            return
        self.start([[self.chosen.path]])

    def action_review_every(self) -> None:
        """Review every scenario, one by one."""
        paths = [entry.path for entry in self.host.project.of("scenario")]
        if not paths:
            self.say("there is no scenario here")
            return
        self.start([[path] for path in paths])

    def start(self, groups: Sequence[Sequence[Path]], names: Sequence[str] | None = None) -> None:
        """Review groups of scenarios beside the interface; then, with `names`, ask whether these are accepted."""
        soon = self.host.soon

        def run(on_progress: ProgressCallback, stop: threading.Event) -> None:
            def on_result(paths: Sequence[Path], result: ReviewReport | LidarcheckError) -> None:
                soon(self._found, paths, result, names)

            run_reviews(groups, review=self.review, on_progress=on_progress, on_result=on_result, stop=stop)

        self._run.start(run)

    def _found(
        self, paths: Sequence[Path], result: ReviewReport | LidarcheckError, names: Sequence[str] | None
    ) -> None:
        """What a review found takes the place of what was listed."""
        if isinstance(result, LidarcheckError):
            self.say(result)
            fault = result.lines()[0].removeprefix("error: ")
            for path in paths if len(paths) == 1 else ():
                self._put(path, self._faulty(path, fault))
        else:
            by_name = {(one.layout.scenarios, one.name): one for one in result.scenarios}
            for path in paths:
                found = by_name[(path.resolve().parent, path.stem)]
                self._put(path, reviewed(path, found))
            if names is None:
                self.say("reviewed: what speaks against accepting stands below")
        self.draw()
        if names is not None and isinstance(result, ReviewReport):
            self.ask_accept(result, names)

    def _faulty(self, path: Path, fault: str) -> Waiting | None:
        now = waiting(path) or next((one for one in self.waiting if one.path == path), None)
        if now is not None:
            return dataclasses.replace(now, fault=fault, stamp=stamp_of(now.layout, now.name), found=None)
        return None

    def _put(self, path: Path, one: Waiting | None) -> None:
        """Take a scenario in at its place, or out."""
        chosen = self.chosen.path if self.chosen else path
        kept = [other for other in self.waiting if other.path != path] + ([one] if one else [])
        self.waiting = sorted(kept, key=lambda other: other.name)
        paths = [other.path for other in self.waiting]
        self.at = paths.index(chosen) if chosen in paths else min(self.at, max(len(paths) - 1, 0))

    def _ended(self, how: str) -> None:
        if how:
            self.say(how, bad=how.startswith("error"))
        elif not self.waiting:
            self.say("nothing to accept: all is as the goldens say")

    def action_stop(self) -> None:
        """Stop the review."""
        self._run.stop()

    def closing(self) -> None:
        """Let a review end."""
        self._run.close()
