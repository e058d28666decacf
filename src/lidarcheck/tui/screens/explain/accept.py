"""What Explain does with an answer: shows what accepting changes, writes it, takes it back."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.jobs.explain_cases import Adoption, CaseState, adoption, take_back, take_over
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import diff_lines, line

__all__ = ["Adopting"]


class Adopting(View):
    """A screen with explained cases."""

    @property
    def chosen(self) -> CaseState | None:
        """The case under the cursor."""
        raise NotImplementedError

    def action_accept(self) -> None:
        """Into the case's own model, or into a new file."""
        state = self.chosen
        if state is None or state.model is None:
            self.say("there is no case to accept a model of")
            return
        target = state.model
        self._plan(state, target, lambda change: self._ask(state, change))

    def _plan(self, state: CaseState, target: Path, then: Callable[[Adoption], object]) -> None:
        """Make out what would be written, beside the interface."""
        host = self.host

        def make() -> None:
            try:
                host.soon(then, adoption(state, target))
            except LidarcheckError as error:
                host.soon(host.say, error)
            except (OSError, ValueError) as error:
                host.soon(self._refused, f"cannot be accepted: {error}")

        threading.Thread(target=make, name="adopt", daemon=True).start()

    def _refused(self, words: str) -> None:
        self.say(words, bad=True)

    def _ask(self, state: CaseState, change: Adoption) -> None:
        """The difference, and what to do with it."""
        name = self.host.inside(str(change.target))
        words = []
        if state.found is not None and any(one.name == "unknown" for one in state.found.findings):
            words.append(line("These terms describe what is missing and do not explain it.", "bad"))
        if change.rewritten:
            words.append(line(f"Comments and layout are not kept: {change.rewritten}", "bad"))
        answers = {"Enter": f"write {name}"}
        if change.before is not None:
            answers |= {"n": "a new file instead"}
        title = f"Accept: how {name} changes" if change.before is not None else f"Accept: {name}, beside the case's"
        ask = Ask(title, [*words, *diff_lines(change.diff)], answers, unasked=True)
        self.host.ask(ask, lambda key: self._answered(state, change, key))

    def _answered(self, state: CaseState, change: Adoption, key: str | None) -> None:
        if key == "Enter":
            self._write(state, change)
        elif key == "n":
            where = state.name.replace("/", "_").removesuffix(".toml")
            ask = AskText("The new model file, in the project", f"{where}_explained.toml")
            self.host.ask(ask, lambda name: self._named(state, name))
        else:
            self.say("not accepted: nothing was written")

    def _named(self, state: CaseState, name: str | None) -> None:
        if name is None:
            self.say("not accepted: nothing was written")
            return
        self._plan(state, self.host.project.root / name, lambda change: self._ask(state, change))

    def _write(self, state: CaseState, change: Adoption) -> None:
        try:
            take_over(state, change)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot write: {error}")
            return
        self.say(f"{self.host.inside(str(change.target))}: written; u takes it back")
        self.host.files_changed()

    def action_take_back(self) -> None:
        """What was accepted last, once asked."""
        state = self.chosen
        if state is None:
            self.say("there is no case")
            return
        ask = Ask(f"Take back what was accepted of {state.name}?", [], {"Enter": "take it back"})
        self.host.ask(ask, lambda key: self._back(state) if key == "Enter" else None)

    def _back(self, state: CaseState) -> None:
        try:
            target = take_back(state, self.host.project.root)
        except (LidarcheckError, OSError) as error:
            self._refused(error.lines()[0] if isinstance(error, LidarcheckError) else f"cannot be taken back: {error}")
            return
        self.say(f"{self.host.inside(str(target))}: as it was before")
        self.host.files_changed()
