"""Commands from the interface: their forms, filled with what is looked at; and what is done when they have ended."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.own_files import content_hash
from lidarcheck.session.runs import Plan, Run
from lidarcheck.tui.host import Host
from lidarcheck.tui.jobs.forms.form import CommandForm
from lidarcheck.tui.jobs.forms.measured import (
    Looked,
    calibrate_form,
    compare_form,
    explain_form,
    ghosts_form,
    measured_of,
    simulate_form,
)
from lidarcheck.tui.runs.models import OpenModels
from lidarcheck.tui.runs.running import CommandRuns
from lidarcheck.tui.runs.taking import ask_model, offered_model
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.form import Form, Pick

__all__ = ["FORMS", "Commands"]

FORMS: dict[str, Callable[[Looked], CommandForm]] = {
    "calibrate": calibrate_form,
    "simulate": simulate_form,
    "compare": compare_form,
    "ghosts fit": ghosts_form,
    "explain": explain_form,
}
"""The forms by the command that they start."""


class Commands:
    """`runs`: the run that goes on and those before; `models`: the model files that are open. `view`: a screen by its
    name: Blooming is offered tables, Explain cases.
    """

    def __init__(self, host: Host, view: Callable[[str], Any]) -> None:
        self.host = host
        self.models = OpenModels(host)
        self.runs = CommandRuns(host)
        self.runs.on_end = self._ended
        self.runs.on_change = lambda: view("overview").runs_changed()
        self._view = view

    def model_of(self, case: Path) -> Path | None:
        """The model that a case's own is a copy of, where the case was made here; None where it was not."""
        root = self.host.project.root
        for run in self.runs.book.runs:
            if "case" in run.takes and os.path.realpath(root / run.takes["case"]) == os.path.realpath(case):
                model = root / run.takes.get("of", "")
                return model if model.is_file() and model.resolve().is_relative_to(root.resolve()) else None
        return None

    # Starting

    def open(self, name: str, screen: str) -> None:
        """The form of a command, filled with what is looked at."""
        choice = self.host.choice
        looked = Looked(self.host.project, measured_of(self.host.project), choice.of("model"), choice.of("measurement"))
        self.ask(FORMS[name](looked), screen)

    def ask(self, form: CommandForm, screen: str) -> None:
        """Show a form, and start its command when that is wanted. `screen`: where the progress is told."""
        if self.runs.running:
            self.host.say("a command is running; x stops it")
            return
        dialog = Form(form, self.runs.book.next_directory, self.host.ask)
        self.host.ask(dialog, lambda start: self._start(form, screen) if start else None)

    def _start(self, form: CommandForm, screen: str) -> None:
        edited = self._edited(form)
        if edited:
            name = self.host.inside(edited)
            self.host.say(
                f"{name} has edits that are not saved, and the command reads the disk: S saves them", bad=True
            )
            return
        try:
            plan = form.plan(self.runs.book.next_directory)
            plan = self._noted(plan)
        except LidarcheckError as error:
            self.host.say(error)
            return
        self.runs.start(plan, screen)

    def _edited(self, form: CommandForm) -> str:
        """A file with edits that are not saved, which the command would read without them; empty for none."""
        session, copied = self.host.session, {os.path.realpath(path) for path in form.copied}
        read = session.inputs().with_named(form.reads(form.values))
        edited = session.edited_of(read)
        return next((name for name in edited if os.path.realpath(name) not in copied), "")

    def _noted(self, plan: Plan) -> Plan:
        """The plan with what the model that it is for is now, so that it is known when that has changed meanwhile."""
        if "model" not in plan.takes:
            return plan
        try:
            before = content_hash((self.host.project.root / plan.takes["model"]).read_bytes())
        except OSError:
            return plan
        return Plan(plan.name, plan.steps, plan.makes, {**plan.takes, "before": before}, plan.copies)

    # What is done when it has ended

    def _ended(self, run: Run) -> None:
        if {"file", "case"} & run.takes.keys():
            self.host.read_project()
        if "case" in run.takes:
            self._view("explain").explain_when_there(Path(run.takes["case"]))
        else:
            self.take(run)

    def take(self, run: Run) -> None:
        """Show what a run that is done has found, and offer to take it over."""
        taken = self._taken(run)
        if "table" in run.takes:
            self._view("blooming").offer(run, taken)
        elif "model" in run.takes:
            change = offered_model(self.host, self.models, run)
            if change is not None:
                ask_model(self.host, change, taken)
        elif "words" in run.takes:
            self.host.ask(Ask(f"{run.name}, run {run.number}", self.runs.words(run, Ask.widest - 6), {}, unasked=True))
        elif "file" in run.takes:
            self.host.say(f"{run.takes['file']}: written")

    def _taken(self, run: Run) -> Callable[[], object]:
        def noted() -> None:
            try:
                self.runs.book.took(run)
            except (LidarcheckError, OSError) as error:
                self.host.note(f"the run is not noted: {error}", True)
            self.runs.on_change()

        return noted

    def list(self) -> None:
        """The runs, of which one is looked at."""
        runs = {_called(run): run for run in self.runs.book.runs}
        if not runs:
            self.host.say("no command was started here")
            return
        self.host.ask(Pick("Runs", list(runs)), lambda name: self._look_at(runs.get(name or "")))

    def _look_at(self, run: Run | None) -> None:
        if run is None:
            return
        able = run.state == "done" and ({"table", "model"} & run.takes.keys())
        answers = {"t": "take it over"} if able else {}
        ask = Ask(_called(run), self.runs.words(run, Ask.widest - 6), answers)
        self.host.ask(ask, lambda key: self.take(run) if key == "t" else None)

    # The interface

    def look_back(self) -> None:
        """What an earlier session has left: edits of models, runs that went on."""
        self.models.look_back()
        self.runs.look()

    def closing(self) -> None:
        """The interface ends."""
        self.runs.closing()
        self.models.closing()


def _called(run: Run) -> str:
    return f"{run.number:>3} {run.name:12} {'done, taken over' if run.taken else run.state}"
