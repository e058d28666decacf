"""The lower half of Overview: scenarios with their verdicts, the KPIs of one of them, and files that have faults."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from lidarcheck.formats.table import counted
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.project import Entry
from lidarcheck.session.session import OLD, SAVED, Session
from lidarcheck.tui.jobs.checks import Check, Outcome, Runs, run_scenarios
from lidarcheck.tui.screens.shared.background import StoppableRun, read_beside
from lidarcheck.tui.screens.shared.kpi_lines import kpi_heading, kpi_lines, moved, name_room
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, is_old, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["Scenarios"]

_ROLES: dict[str, Role] = {"fell out": "bad", "fault": "bad", "changed": "edited", "holds": "good"}


class Scenarios(View):
    """`runs`: the last outcome of each scenario; `states`: which of them belong to what is set."""

    def __init__(self, runs: Runs, check: Check | None = None) -> None:
        super().__init__(id=self.NAME)
        self.check = check
        self.runs = runs
        self.at = 0
        self.fallen_only = False
        self._run = StoppableRun(self, "run", self._ended)
        self._entries: list[Entry] = []
        self.states: dict[str, str] = {}

    def draw(self) -> None:
        """All panes."""
        raise NotImplementedError

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

    def draw_scenarios(self) -> None:
        """The scenarios, and the KPIs of the one under the cursor."""
        entries = self.entries()
        self.at = max(min(self.at, len(entries) - 1), 0)
        lines = [self._line(entry) for entry in entries]
        empty = "no scenario here: press ?, or see docs/scenarios.md" if not self.fallen_only else "nothing fell out"
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

    def move_in_scenarios(self, key: str) -> None:
        """The cursor."""
        rows = max(self.query_one("#scenarios", Lines).rows, 1)
        self.at = cursor_after(key, self.at, len(self.entries()), rows)
        if self.entries():
            self.host.state.selected[self.NAME] = self.entries()[self.at].name
        self.draw()

    # Runs

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

    def stop_scenarios(self) -> None:
        """Stop the run."""
        self._run.stop()

    def action_only_fallen(self) -> None:
        """What fell out or has a fault, or everything again."""
        self.fallen_only = not self.fallen_only
        self.at = 0
        self.draw()

    def closing(self) -> None:
        """Let a run end."""
        self._run.close()


def _states(session: Session, last: Mapping[str, Outcome], *, wait: bool = False) -> dict[str, str]:
    """The state of each outcome; one of an older version does not say what it read."""
    return {
        name: session.state_of(one.read, one.code, wait=wait) if one.read else f"{OLD}, of another lidarcheck"
        for name, one in last.items()
    }
