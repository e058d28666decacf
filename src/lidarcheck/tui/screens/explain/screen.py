"""Explain: the cases of the project, explaining one of them in a process of its own, and its answer."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.context import groups_line
from lidarcheck.tui.host import STOPS
from lidarcheck.tui.jobs.explain_cases import CaseState, case_files, look_at, make_results_directory
from lidarcheck.tui.jobs.explain_process import PROGRAM, ExplainProcess, command_of
from lidarcheck.tui.screens.explain.accept import Adopting
from lidarcheck.tui.screens.explain.lines import answer_parts, far_in_words, found_lines, gap_words, step_lines
from lidarcheck.tui.screens.explain.options import Options
from lidarcheck.tui.screens.shared.background import read_beside
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Line, Lines, cursor_after, hanging, is_old, line

__all__ = ["Explain"]

_EVERY_S = 0.3
_EMPTY = (
    "no case in this project",
    "A case is a directory with case.toml: a model, and three frames or more, each with what its beams meet",
    "and what was measured. docs/explain.md shows one to try.",
)


class Explain(Adopting, Options):
    """Cases, the steps of a run, and the answer."""

    NAME = "explain"
    WORDS: ClassVar[dict[str, str]] = {
        "cases": "Every case of the project with what its last run found, and whether that is of what is set: OLD, "
        "where the model, a table or a frame has changed since; 'saved model', where edits that are not saved are not "
        "in it. r explains a case, which takes a minute or more on all cores; x stops it, and what was done is kept.",
        "steps": "The steps of the run that is going on, how far each is, and the time that is left.",
        "answer": "What is missing in the model, with intervals and how sure that is; how much of the gap is gone on "
        "frames that no fit has seen; where model and measurement disagree; every candidate with its scores; what "
        "these scenes cannot show; what changes in the model. v goes from part to part. While a run goes on: what it "
        "has found so far.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("explain"), *MOVES]
    DEFAULT_CSS = """
    Explain #cases { height: 20%; min-height: 4; }
    Explain #steps { height: 7; display: none; }
    Explain.runs #steps { display: block; }
    """

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.program: Sequence[str] = PROGRAM
        self.cases: list[CaseState] = []
        self.at = 0
        self.part = 0
        self.run: ExplainProcess | None = None
        self.of: CaseState | None = None
        self.looks = 0
        self._waits = False
        self._awaited = ""
        self._faults: dict[Path, str] = {}

    def compose(self) -> ComposeResult:
        """The cases above, the steps of a run, and the answer."""
        yield Lines("Cases", label="c", id="cases")
        yield Lines("Steps", label="s", id="steps")
        yield Lines("Answer", label="a", id="answer")

    def on_mount(self) -> None:
        """The answer is laid out for its width."""
        self.query_one("#answer", Lines).when_resized = self.draw
        self.set_interval(2.0, self._look_at_models)

    def _look_at_models(self) -> None:
        if self.is_on_screen:
            self.host.commands.models.look_at_disk()

    # What is there

    def project_changed(self) -> None:
        """Look at the cases and at what earlier runs have left, beside the interface."""
        root, paths, disk = self.host.project.root, case_files(self.host.project), self.host.session.disk
        read_beside(self.host, "the cases", lambda: [look_at(root, path, disk) for path in paths], self._looked)

    def inputs_changed(self) -> None:
        """Say of each answer whether it belongs to them."""
        if self.is_chosen:
            self.draw()

    def state_of(self, case: CaseState) -> str:
        """Whether the answer to a case belongs to what is set, in words; empty without one."""
        return self.host.session.state_of(case.read) if case.found is not None else ""

    def action_look(self) -> None:
        """Look again, as if nothing had been refused."""
        self._faults.clear()
        self.project_changed()

    def explain_when_there(self, case: Path) -> None:
        """Explain a case of the project as soon as it was read."""
        self._awaited = os.path.realpath(self.host.project.root / case)
        self.host.show_screen(self.NAME)

    def _explain_awaited(self) -> None:
        names = [os.path.realpath(case.path) for case in self.cases]
        if self._awaited in names:
            self.at, self._awaited = names.index(self._awaited), ""
            self.host.state.selected[self.NAME] = self.cases[self.at].name
            self.action_explain()

    def _looked(self, found: Sequence[CaseState]) -> None:
        self.cases = [self._with_fault(case) for case in found]
        self.at = self.cursor_again([case.name for case in self.cases], self.at)
        self.looks += 1
        self._explain_awaited()
        self.draw()

    def _with_fault(self, case: CaseState) -> CaseState:
        """What the last run of this session refused it for, until it is run again."""
        fault = case.fault or self._faults.get(case.path, "")
        return dataclasses.replace(case, fault=fault)

    @property
    def chosen(self) -> CaseState | None:
        """The case under the cursor."""
        return self.cases[self.at] if self.at < len(self.cases) else None

    @property
    def running(self) -> bool:
        """Whether a run is going on."""
        return self.run is not None

    def opened(self) -> None:
        """The screen is seen."""
        self.draw()

    # What is shown

    def context_line(self, width: int) -> Line | None:
        """The case under the cursor, its model, and how much of its gap an explanation has closed."""
        case = self.chosen
        if case is None:
            return None
        gap = "" if case.found is None else gap_words(case.found.gap)
        model = "" if case.model is None else case.model.name
        return groups_line([(f"case {case.name}", "title"), (gap, "focus"), (model, "text")], width)

    def draw(self) -> None:
        """All panes."""
        if self.is_chosen:
            self.host.show_context()
        self.set_class(self.running, "runs")
        lines = [self._line(number, case) for number, case in enumerate(self.cases)]
        shown = lines or [line(f" {text}", "dim") for text in _EMPTY]
        title = f"Cases: {len(self.cases)}; {self._how()}" if self.cases else "Cases"
        self.query_one("#cases", Lines).show(shown, title=title, cursor=self.at if self.cases else None)
        if self.run is not None:
            title = f"Steps: {far_in_words(self.run.progress)}"
            self.query_one("#steps", Lines).show(step_lines(self.run.progress), title=title)
        self._draw_answer(self.chosen)

    def _how(self) -> str:
        seed, exclude = self.option("seed") or "0", self.option("exclude")
        return f"seed {seed}{f', never {exclude}' if exclude else ''}"

    def _line(self, number: int, case: CaseState) -> Line:
        pointer = ">" if number == self.at else " "
        runs = self.run is not None and self.of is not None and case.path == self.of.path
        state = f"running, {100.0 * self.run.progress.part:.0f} %" if runs and self.run else case.state
        role = "bad" if case.fault else "edited" if runs else "text"
        of = "" if runs or case.fault else self.state_of(case)
        belongs = ((f"  {of}", "edited" if is_old(of) else "dim"),) if of else ()
        return ((f"{pointer}{case.name:34} ", "text"), (state, "bad" if role == "bad" else "text"), *belongs)

    def parts(self) -> dict[str, list[Line]]:
        """The parts of the answer for the case under the cursor, by their titles."""
        case, width = self.chosen, max(self.query_one("#answer", Lines).size.width, 1)
        if case is None:
            return {"": []}
        if self.run is not None and self.of is not None and case.path == self.of.path:
            return {"found so far": found_lines(self.run.progress, width)}
        if case.fault:
            return {"fault": hanging(self.host.inside(case.fault), width, "bad")}
        if case.found is None:
            words = "stopped before it was done: r goes on" if case.kept else "not explained yet: r does it"
            return {"none yet": [line(f" {words}", "dim")]}
        return answer_parts(case, width, self.host.inside(str(case.page)) if case.page else "")

    def _draw_answer(self, case: CaseState | None) -> None:
        pane, parts = self.query_one("#answer", Lines), self.parts()
        self.part %= len(parts)
        name = list(parts)[self.part]
        of = f" {self.part + 1}/{len(parts)}" if len(parts) > 1 else ""
        # What is found grows: its end is seen, until somebody reads in it.
        last = len(parts[name]) - 1 if "found so far" in parts and not pane.has_focus else None
        shown = case is not None and case.found is not None and "found so far" not in parts
        state = self.state_of(case) if shown and case is not None else ""
        pane.show(parts[name], title=f"Answer{of}: {name}" if case else "Answer", cursor=last, state=state)

    def action_view(self, by: int) -> None:
        """Another part of the answer."""
        self.part += by
        pane = self.query_one("#answer", Lines)
        pane.page(-(10**6))
        self.draw()

    def action_move(self, key: str) -> None:
        """The cursor among the cases; in the other panes the text."""
        pane = self.app.focused
        if isinstance(pane, Lines) and pane.id in ("steps", "answer"):
            pages = {"home": -(10**6), "end": 10**6}
            pane.page(pages.get(key, -1 if key in ("up", "pageup") else 1))
            return
        self.at = cursor_after(key, self.at, len(self.cases), max(self.query_one("#cases", Lines).rows, 1))
        self.part = 0
        if self.chosen:
            self.host.state.selected[self.NAME] = self.chosen.name
        self.draw()

    # Running

    def action_explain(self) -> None:
        """Explain the case under the cursor."""
        case = self.chosen
        if case is None:
            self.say("there is no case here")
        elif self.run is not None:
            self.say("a run is going on; x stops it")
        elif case.model is None:
            self.say(f"{case.name} cannot be explained: {self.host.inside(case.fault)}", bad=True)
        else:
            self._start(case)

    def _start(self, case: CaseState) -> None:
        host = self.host  # a view that was taken down does not find its app any more
        soon = host.soon
        try:
            out = make_results_directory(host.project.root, case.path)
            how = {name: self.option(name) for name in ("seed", "exclude")}
            self.run = ExplainProcess(
                command_of(case.path, out, **how, program=self.program),
                on_progress=lambda: soon(self._progressed),
                on_line=lambda text: soon(host.note, text, text.startswith("error")),
                on_end=lambda code: soon(self._ended, code),
            )
        except LidarcheckError as error:
            self.say(error)
            return
        self.of, self.part = case, 0
        self._faults.pop(case.path, None)
        self.say(f"explaining {case.name}; x stops it")
        self.draw()

    def _progressed(self) -> None:
        """Something new: of the steps, or what was found. It is shown a few times a second at most."""
        if not self._waits:
            self._waits = True
            self.set_timer(_EVERY_S, self._show_progress)

    def _show_progress(self) -> None:
        self._waits = False
        if self.run is None or self.of is None:
            return
        self.progress(
            f"explain {self.of.name}: {self.run.progress.now or 'starting'} {far_in_words(self.run.progress)}{STOPS}"
        )
        if self.is_on_screen:
            self.draw()

    def _ended(self, code: int) -> None:
        """The process has ended: what it left is read."""
        if self.run is None or self.of is None:
            return
        progress, case, self.run = self.run.progress, self.of, None
        self.progress("")
        if code != 0 and progress.fault:
            self._faults[case.path] = progress.fault
        self.project_changed()
        if code == 0:
            self.say(f"{case.name}: explained")
        elif progress.fault:
            self.say(f"{case.name}: {progress.fault}", bad=True)
        else:
            self.say(f"{case.name}: stopped; what was done is kept, and r goes on from there")
        self.draw()

    def action_stop(self) -> None:
        """Stop the run, or end it at once."""
        if self.run is None:
            self.stop_command()
        elif self.run.stop():
            self.say("ended at once; what was kept stays")
        else:
            self.say("stopping; x once more ends it at once")

    def closing(self) -> None:
        """A run is stopped, and goes on when it is asked for again."""
        if self.run is not None:
            self.run.stop()

    def on_resize(self, _event: events.Resize) -> None:
        """The answer is laid out anew."""
        self.draw()
