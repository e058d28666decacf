"""Overview: what is measured with its number, what each edit did, scenarios with verdicts and KPIs, files at fault."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical

from lidarcheck.formats.table import counted
from lidarcheck.session.measurements import Measurement
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.project import Entry
from lidarcheck.session.session import OLD, SAVED, Session
from lidarcheck.tui.jobs.checks import Check, Outcome, Runs, run_scenarios
from lidarcheck.tui.screens.overview.measured import detail, edit_lines, measured_lines, screen_of, summary
from lidarcheck.tui.screens.shared.background import StoppableRun, read_beside
from lidarcheck.tui.screens.shared.kpi_lines import kpi_heading, kpi_lines, moved, name_room
from lidarcheck.tui.screens.shared.view import MOVES, View, bindings
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, is_old, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["Overview"]

_NOTHING = "no scan or profile was measured here: see docs/own-recording.md"
_WIDE, _TALL = 120, 30
_ROLES: dict[str, Role] = {"fell out": "bad", "fault": "bad", "changed": "edited", "holds": "good"}


class Overview(View):
    """The first screen. `check` stands in for the harness's in tests."""

    NAME = "overview"
    WORDS: ClassVar[dict[str, str]] = {
        "measured": "Every measurement with its number: how far what was measured is from what the model shows, in "
        "standard deviations of one beam. Of an edit of blooming tables that is the misfit of the target's profile, "
        "of all else the gap that explain prints. 'edit': what the last step changed, 'start': what has changed since "
        "the interface was started. r computes the number again, R whole frames of all with 64 seeds, Enter goes to "
        "the screen that shows the measurement, n and p to the next distance, B makes what is set now the baseline.",
        "edits": "The edits of this session, the last one first, with the number after each and its change; from 120 "
        "columns on the change at each distance.",
        "scenarios": "Every scenario with the verdict of its last run against its golden, and files that have a fault. "
        "'changed' moved within what does not matter; 'fell out' fails the gate. Behind it stands whether that is of "
        "what is set: OLD, where the scenario, its golden, the model or a table has changed since; 'saved model', "
        "where edits that are not saved are not in it.",
        "kpis": "The KPIs of the scenario: the golden's value, the last run's, how far it moved over the "
        "tolerance, the "
        "tolerance, the smallest change that would be caught, and the absolute limits.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("overview"), *MOVES]
    DEFAULT_CSS = """
    Overview #lists { layout: vertical; height: 1fr; }
    Overview #measured { height: 11; max-height: 11; }
    Overview #edits { height: 4; dock: bottom; }
    Overview #kpis { height: 9; dock: bottom; display: none; }
    Overview.verdicts #measured { max-height: 6; }
    Overview.verdicts #edits { display: none; }
    Overview.verdicts #kpis { display: block; }
    Overview.wide #lists { layout: grid; grid-size: 2; grid-gutter: 0 1; grid-columns: 80 1fr; }
    Overview.wide #lists Lines { height: 1fr; max-height: 100%; dock: none; display: block; }
    """

    def __init__(self, runs: Runs, check: Check | None = None) -> None:
        super().__init__(id=self.NAME)
        self.check = check
        self.runs = runs
        self.at = 0
        self.fallen_only = False
        self._run = StoppableRun(self, "run", self._ended)
        self._entries: list[Entry] = []
        self.states: dict[str, str] = {}

    def compose(self) -> ComposeResult:
        """Measurements, scenarios, and below these the edits, or the KPIs of a scenario."""
        with Vertical(id="lists"):
            yield Lines("Measured", label="s", id="measured")
            yield Lines("Edits", label="h", id="edits")
            yield Lines("Scenarios", label="c", id="scenarios")
            yield Lines("KPIs", label="k", id="kpis", folds=True)

    def on_mount(self) -> None:
        """Lines are as long as there is room."""
        for name in ("measured", "edits"):
            self.query_one(f"#{name}", Lines).when_resized = self._draw_numbers

    def on_resize(self, event: events.Resize) -> None:
        """All four side by side, or the KPIs in the place of the edits while scenarios are looked at."""
        wide = event.size.width >= _WIDE and event.size.height >= _TALL
        self.set_class(wide, "wide")
        if wide:
            self.query_one("#measured", Lines).styles.height = "1fr"

    def on_descendant_focus(self, _event: events.DescendantFocus) -> None:
        """Where there is room for one of both, the edits go with measurements and the KPIs with scenarios."""
        focused = self.app.focused
        self.set_class(focused is not None and focused.id in ("scenarios", "kpis"), "verdicts")

    def panes(self) -> list[Lines]:
        """Those that are seen; the others can be jumped to."""
        order = ("measured", "scenarios", "kpis", "edits")
        return [self.query_one(f"#{name}", Lines) for name in order]

    def _is_on(self, name: str) -> bool:
        return self.query_one(f"#{name}", Lines).has_focus

    @property
    def on_scenarios(self) -> bool:
        """Whether keys are for scenarios: they, or their KPIs, have the focus."""
        return self._is_on("scenarios") or self._is_on("kpis")

    @property
    def running(self) -> bool:
        """Whether scenarios run."""
        return self._run.running

    # What is shown

    def project_changed(self) -> None:
        """Show the new files, with the cursor on the one it was on."""
        faults = [entry for entry in self.host.project.faults if entry.kind != "scenario"]
        self._entries = [*self.host.project.of("scenario", sound=False), *faults]
        self.at = self.cursor_again([entry.name for entry in self.entries()], self.at)
        self.draw()
        last, session = dict(self.runs.last), self.host.session
        read_beside(self.host, "the last runs", lambda: _states(session, last, wait=True), self._looked)

    def _looked(self, states: dict[str, str]) -> None:
        self.states = states
        self.draw()

    def opened(self) -> None:
        """The screen is seen."""
        self.inputs_changed()

    def inputs_changed(self) -> None:
        """Say of each verdict whether it belongs to them."""
        if not self.is_mounted:
            return
        self.states = _states(self.host.session, self.runs.last)
        self.draw()

    def choice_changed(self) -> None:
        """The cursor goes to what is looked at."""
        self.numbers_changed()

    def numbers_changed(self) -> None:
        """A number, or what is known of it, is another."""
        if self.is_mounted:
            self._draw_numbers()

    def measured(self) -> list[Measurement]:
        """The measurements, those without a number last."""
        numbers = self.host.numbers
        return sorted(numbers.measured.all, key=lambda one: numbers.asked(one).request is None)

    @property
    def seen(self) -> Measurement | None:
        """The measurement under the cursor: the one that all screens look at."""
        return self.host.numbers.seen

    def _draw_numbers(self) -> None:
        """Measurements and edits."""
        pane, numbers, order = self.query_one("#measured", Lines), self.host.numbers, self.measured()
        if not pane.size.width:
            return
        edits = self.query_one("#edits", Lines)
        title, lines = edit_lines(numbers, edits.size.width, several=self.has_class("wide"))
        edits.show(lines, title=title)
        if not order or self.seen is None:
            pane.show([line(f"  {_NOTHING}", "dim")], title="Measured: nothing")
            return
        at = order.index(self.seen)
        listed, (did, mean) = measured_lines(numbers, order, at, pane.size.width), summary(numbers, order)
        above, below = [detail(numbers, self.seen)], [line(f" {mean}", "dim")] if mean else []
        shown = [*above, *listed.lines, *below]
        models = counted(len(self.host.project.of("model")), "model")
        words = f"Measured: {counted(len(order), 'set')}, {models}{f'; {did}' if did else ''}"
        if not self.has_class("wide"):
            pane.styles.height = len(shown) + 1  # and no more than there is room for
        pane.show(shown, title=words, cursor=listed.rows[at] + len(above))

    def entries(self) -> list[Entry]:
        """What the list shows: scenarios, then other files with faults."""
        return [
            entry for entry in self._entries if not self.fallen_only or self._verdict(entry) in ("fell out", "fault")
        ]

    def _verdict(self, entry: Entry) -> str:
        if entry.fault:
            return "fault"
        outcome = self.runs.last.get(entry.path.stem)
        return "not run" if outcome is None else outcome.verdict

    def draw(self) -> None:
        """All panes."""
        self._draw_numbers()
        entries = self.entries()
        self.at = max(min(self.at, len(entries) - 1), 0)
        lines = [self._line(entry) for entry in entries]
        empty = "no scenario here: press F1, or see docs/scenarios.md" if not self.fallen_only else "nothing fell out"
        last = [
            self.runs.last[e.path.stem] for e in self._entries if e.kind == "scenario" and e.path.stem in self.runs.last
        ]
        fell = sum(outcome.verdict in ("fell out", "fault") for outcome in last)
        scenarios = sum(entry.kind == "scenario" for entry in self._entries)
        faults = len(self.host.project.faults)
        title = f"Scenarios: {scenarios}, {len(last)} run, {fell} fell out; {faults} files with a fault"
        unsaved = self.host.session.unsaved()
        state = f"{SAVED}, without {counted(unsaved, 'edit')}" if last and unsaved else ""
        self.query_one("#scenarios", Lines).show(
            lines or [line(f"  {empty}", "dim")], title=title, cursor=self.at if entries else None, state=state
        )
        self._draw_kpis(entries[self.at] if entries else None)

    def _line(self, entry: Entry) -> Line:
        verdict = self._verdict(entry)
        name = entry.path.stem if entry.kind == "scenario" and not entry.fault else entry.name
        outcome = None if entry.fault else self.runs.last.get(entry.path.stem)
        text = ""
        if entry.fault:
            text = f"  {self.host.inside(entry.fault)}"
        elif outcome is not None:
            when = time.strftime("%m-%d %H:%M", time.localtime(outcome.time))
            counts = f"{len(outcome.kpis) - outcome.fallen}/{len(outcome.kpis)} KPIs"
            moved = f"{outcome.moved} moved" if outcome.moved else ""
            text = f"{counts:10} {moved:8} {when}"
        state = self.states.get(entry.path.stem, "") if outcome else ""
        role: Role = "dim" if is_old(state) else _ROLES.get(verdict, "dim")
        of = f"{state.partition(',')[0]:12}" if outcome else ""
        look: Role = "edited" if is_old(state) else "dim"
        return ((f" {name:26} ", "text"), (f"{verdict:9}", role), (of, look), (text, "dim"))

    def _draw_kpis(self, entry: Entry | None) -> None:
        pane = self.query_one("#kpis", Lines)
        if entry is None:
            pane.show([], title="KPIs")
            return
        outcome = self.runs.last.get(entry.path.stem) if entry.kind == "scenario" and not entry.fault else None
        if outcome is None:
            words = self.host.inside(entry.fault) if entry.fault else "not run yet: r runs it, R all"
            pane.show([line(f" {words}", "bad" if entry.fault else "dim")], title=entry.name)
            return
        room = name_room(pane.size.width)
        lines = [line(f" {self.host.inside(problem)}", "bad") for problem in outcome.problems]
        if outcome.kpis:
            lines.append(kpi_heading("now", room))
        order = sorted(outcome.kpis, key=lambda kpi: (not kpi.fails, -abs(moved(kpi))))
        for kpi in order:
            lines += kpi_lines(kpi, room=room)
        pane.show(lines, title=f"KPIs of {entry.path.stem}", state=self.states.get(entry.path.stem, ""))

    # Actions

    def action_move(self, key: str) -> None:
        """The cursor; in the KPIs and the edits the keys scroll."""
        for name in ("kpis", "edits"):
            if self._is_on(name):
                self.query_one(f"#{name}", Lines).scroll_by_key(key)
                return
        if self._is_on("scenarios"):
            rows = max(self.query_one("#scenarios", Lines).rows, 1)
            self.at = cursor_after(key, self.at, len(self.entries()), rows)
            if self.entries():
                self.host.state.selected[self.NAME] = self.entries()[self.at].name
            self.draw()
            return
        order = self.measured()
        if self.seen is not None:
            at = cursor_after(key, order.index(self.seen), len(order), max(self.query_one("#measured", Lines).rows, 1))
            self.host.numbers.choose(order[at])

    # Numbers

    def action_go(self) -> None:
        """The screen that shows the measurement; in the scenarios run the one under the cursor."""
        if self.on_scenarios:
            self.action_run_one()
        elif self.seen is not None:
            self.host.show_screen(screen_of(self.host.numbers.measured.kind(self.seen)))

    def action_renew(self) -> None:
        """The number of the measurement under the cursor; in the scenarios run the one under the cursor."""
        numbers, seen = self.host.numbers, self.seen
        if self.on_scenarios:
            self.action_run_one()
        elif seen is None:
            self.say("nothing is measured here")
        elif not numbers.engine.renew(numbers.asked(seen)):
            state = self.host.inside(numbers.known(seen).state) or "no number is computed here"
            self.say(f"{numbers.measured.words(seen)}: {state}")

    def action_all(self) -> None:
        """Whole frames of all measurements; in the scenarios run all of them."""
        if self.on_scenarios:
            self.action_run_all()
            return
        count = self.host.numbers.engine.run_all()
        words = "whole frames, 64 seeds; x stops" if count else "nothing to compute"
        self.say(f"{counted(count, 'number')}: {words}" if count else words)

    # Scenarios

    def action_run_one(self) -> None:
        """Run the scenario under the cursor."""
        entries = self.entries()
        entry = entries[self.at] if entries else None
        if entry is None or entry.kind != "scenario":
            self.say("there is no scenario under the cursor")
            return
        self._start([entry.path])

    def action_run_all(self) -> None:
        """Run all scenarios."""
        self._start([entry.path for entry in self._entries if entry.kind == "scenario"])

    def _start(self, paths: list[Path]) -> None:
        if not paths and not self.running:
            self.say("there is no scenario to run here")
            return
        soon = self.host.soon

        def run(on_progress: ProgressCallback, stop: threading.Event) -> None:
            found = partial(soon, self._found)
            run_scenarios(paths, on_progress=on_progress, on_outcome=found, stop=stop, check=self.check)

        self._run.start(run)

    def _found(self, outcome: Outcome) -> None:
        """An outcome."""
        self.runs.add(outcome)
        self.inputs_changed()

    def _ended(self, how: str) -> None:
        self.say(how or "the run has ended", bad=how.startswith("error"))

    def action_stop(self) -> None:
        """Stop the run, and the numbers that are computed."""
        if self.host.numbers.engine.stop() and not self.running:
            self.say("numbers: stopped; r computes one again")
        else:
            self._run.stop()

    def action_only_fallen(self) -> None:
        """What fell out or has a fault, or everything again."""
        self.fallen_only = not self.fallen_only
        self.at = 0
        self.draw()

    def action_look_again(self) -> None:
        """Read the project again."""
        self.host.read_project()

    def closing(self) -> None:
        """Let a run end."""
        self._run.close()


def _states(session: Session, last: Mapping[str, Outcome], *, wait: bool = False) -> dict[str, str]:
    """The state of each outcome; one of an older version does not say what it read."""
    return {
        name: session.state_of(one.read, one.code, wait=wait) if one.read else f"{OLD}, of another lidarcheck"
        for name, one in last.items()
    }
