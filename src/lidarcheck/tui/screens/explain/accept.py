"""What Explain does with an answer: shows what accepting changes, takes it over as an edit, takes it back."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.takeover import ModelTakeover
from lidarcheck.tui.jobs.explain_cases import (
    Adoption,
    CaseState,
    Taken,
    adopted,
    adoption,
    check_unchanged,
    edit_words,
    forget_taken,
    last_taken,
    note_taken,
    remove_taken,
    write_adopted,
)
from lidarcheck.tui.runs.models import change_lines
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import Line, diff_lines, line

__all__ = ["Adopting"]

T = TypeVar("T")
_NOTHING = "not accepted: nothing was written"


class Adopting(View):
    """A screen with explained `cases`."""

    cases: list[CaseState]
    _after_new_file = -1
    """How many edits there had been when a new file was written last."""

    @property
    def chosen(self) -> CaseState | None:
        """The case under the cursor."""
        raise NotImplementedError

    def action_accept(self) -> None:
        """Into the case's own model, or the one that it is a copy of; or into a new file."""
        state = self.chosen
        if state is None or state.model is None:
            self.say("there is no case to accept a model of")
            return
        try:
            file = self.host.commands.models.open(self.host.commands.model_of(state.path) or state.model)
        except LidarcheckError as error:
            self.say(error)
            return
        self._plan(lambda: adopted(state, file), lambda change: self._ask(state, change))

    def _plan(self, make: Callable[[], T], then: Callable[[T], object]) -> None:
        """Make out what would change, beside the interface."""
        host = self.host

        def plan() -> None:
            try:
                host.soon(then, make())
            except LidarcheckError as error:
                host.soon(host.say, error)
            except (OSError, ValueError) as error:
                host.soon(self._refused, f"cannot be accepted: {error}")

        threading.Thread(target=plan, name="adopt", daemon=True).start()

    def _refused(self, words: str) -> None:
        self.say(words, bad=True)

    def _ask(self, state: CaseState, change: ModelTakeover) -> None:
        """The difference, and what to do with it."""
        name = self.host.inside(str(change.file.path))
        answers = {"y": f"take it over, u takes it back, S saves {name}", "n": "a new file instead"}
        words = [*self._warned(state, change.rewritten), *change_lines(change.diff)]
        ask = Ask(f"Accept: how {name} changes, {counted(len(change.diff), 'line')}", words, answers, unasked=True)
        self.host.ask(ask, lambda key: self._answered(state, change, key))

    def _warned(self, state: CaseState, rewritten: str) -> list[Line]:
        words = []
        if state.found is not None and any(one.name == "unknown" for one in state.found.findings):
            words.append(line("These terms describe what is missing and do not explain it.", "bad"))
        if rewritten:
            words.append(line(f"Comments and layout are not kept: {rewritten}", "bad"))
        return words

    def _answered(self, state: CaseState, change: ModelTakeover, key: str | None) -> None:
        if key == "y":
            self._take(state, change)
        elif key == "n":
            where = state.name.replace("/", "_").removesuffix(".toml")
            ask = AskText("The new model file, in the project", f"{where}_explained.toml")
            self.host.ask(ask, lambda name: self._named(state, name))
        else:
            self.say(_NOTHING)

    def _take(self, state: CaseState, change: ModelTakeover) -> None:
        """Take it over, as one edit of the model's file."""
        file, name = change.file, self.host.inside(str(change.file.path))
        try:
            change.make()
            note_taken(state, file.path, change.before, change.content)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot be kept: {error}")
            return
        self.host.choice.choose("model", name)
        self.say(f"{name}: taken over, not saved yet; u takes it back, S saves it")

    # A new file

    def _named(self, state: CaseState, name: str | None) -> None:
        if name is None:
            self.say(_NOTHING)
            return
        target = self.host.project.root / name
        self._plan(lambda: adoption(state, target), lambda change: self._ask_new(state, change))

    def _ask_new(self, state: CaseState, change: Adoption) -> None:
        name = self.host.inside(str(change.target))
        words = [*self._warned(state, change.rewritten), *diff_lines(change.diff)]
        ask = Ask(f"Accept: {name}, beside the case's", words, {"Enter": f"write {name}"}, unasked=True)
        self.host.ask(ask, lambda key: self._write(state, change) if key == "Enter" else self.say(_NOTHING))

    def _write(self, state: CaseState, change: Adoption) -> None:
        try:
            write_adopted(state, change)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot write: {error}")
            return
        self._after_new_file = self.host.session.edits
        self.say(f"{self.host.inside(str(change.target))}: written; u takes it back")
        self.host.files_changed()

    # Back

    def action_undo(self) -> None:
        """The last edit of all; before any, or where that was it, what was accepted last."""
        session = self.host.session
        last = session.step(session.edit).what
        if not session.edit or session.edits == self._after_new_file:
            self._take_back(self.chosen)
            return
        case = next((case for case in self.cases if last == edit_words(case) and self._is_recorded(case)), None)
        if case is None:
            self.host.edits.undo()
        else:
            self._take_back(case)

    def _is_recorded(self, case: CaseState) -> bool:
        with contextlib.suppress(LidarcheckError):
            last_taken(case, self.host.project.root)
            return True
        return False

    def _take_back(self, state: CaseState | None) -> None:
        """What was accepted last: an edit is undone, also one of an earlier session; a new file goes once asked."""
        if state is None:
            self.say("there is no case")
            return
        try:
            taken = last_taken(state, self.host.project.root)
            if taken.before is None:
                ask = Ask(f"Remove {self.host.inside(str(taken.target))}?", [], {"Enter": "take it back"})
                self.host.ask(ask, lambda key: self._remove(state, taken) if key == "Enter" else None)
            else:
                self._undo(state, taken)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot be taken back: {error}")

    def _undo(self, state: CaseState, taken: Taken) -> None:
        """Undo the edit; of an earlier session it is another edit, back to what was there before."""
        assert taken.before is not None
        file = self.host.commands.models.open(taken.target)
        check_unchanged(state, taken, None if file.changed_on_disk() else file.content)
        last = file.history.last("undo")
        if last is not None and last.what == edit_words(state):
            file.undo()
        else:
            file.take(taken.before, f"take back {state.name}")
        forget_taken(state)
        more = ", not saved yet; S saves it" if file.dirty else ""
        self.say(f"{self.host.inside(str(file.path))}: as it was before{more}")

    def _remove(self, state: CaseState, taken: Taken) -> None:
        try:
            remove_taken(state, taken)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot be taken back: {error}")
            return
        self.say(f"{self.host.inside(str(taken.target))}: as it was before")
        self.host.files_changed()
