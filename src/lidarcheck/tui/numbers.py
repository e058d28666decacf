"""The numbers of a project's measurements for all screens: what is asked for, which one is seen, and what is said."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lidarcheck.session.choice import PARTS, Choice
from lidarcheck.session.measurements import Measurement
from lidarcheck.session.node import Node
from lidarcheck.session.project import Project
from lidarcheck.session.session import Session
from lidarcheck.tui.context import Context, step_words
from lidarcheck.tui.engine import Asked, Engine, Known
from lidarcheck.tui.jobs.measured import Measured

__all__ = ["Numbers"]

_LASTS_S = 0.5
"""What keeps numbers waiting for less is not said."""


class Numbers:
    """Follows project, choice and edits. `measured`: what there is; `began`: when, in seconds since the epoch; `say`
    gets what an edit did, in words; `wait`, what keeps numbers waiting, for as long as it does, else nothing.
    """

    def __init__(
        self,
        project: Project,
        session: Session,
        choice: Choice,
        later: Callable[..., Any],
        soon: Callable[..., object],
        say: Callable[[str], object],
        wait: Callable[[str], object],
        *,
        on: bool,
    ) -> None:
        self.engine = Engine(session, later, soon, on=on)
        self.engine.on_number = self._arrived
        self.engine.on_news = self._waits
        self._later, self._wait = later, wait
        self._waiting: Any = None
        self.measured = Measured(project)
        self.began = time.time()
        self._asked: dict[str, Asked] = {}
        self._asked_with: object = None
        self._session, self._choice, self._say = session, choice, say
        self._said = ""

    @property
    def project(self) -> Project:
        """The project as it was read last."""
        return self.measured.project

    # What happens

    def project_read(self, project: Project) -> None:
        """The project was read."""
        self.measured = Measured(project)
        self.ask()

    def inputs_changed(self) -> None:
        """Files were edited, saved, read again or changed on the disk."""
        self.ask()
        self.engine.look()

    def ask(self) -> None:
        """Have the numbers asked for that belong to what is chosen."""
        tables = self.of_tables
        parts = (self.measured, tables, *(self._choice.of(part) for part in PARTS if part != "feature"))
        if parts == self._asked_with:
            return
        self._asked_with = parts
        self._asked = {one.name: self._asked_of(one, tables=tables) for one in self.measured.all}
        seen = self.seen
        first = [] if seen is None else [self._asked[one.name] for one in [seen, *self.measured.set_of(seen)]]
        self.engine.ask(list(dict.fromkeys([*first, *self._asked.values()])))

    def _asked_of(self, one: Measurement, *, tables: bool) -> Asked:
        request = self.measured.request(one, self._choice, tables=tables)
        return Asked(one.name, None, request) if isinstance(request, str) else Asked(one.name, request)

    @property
    def of_tables(self) -> bool:
        """Whether the last edit was one of tables; before the first one, whether there are tables."""
        last = self._session.step(self._session.edit)
        return bool(self._choice.of("lut")) if last.path is None else last.path.suffix != ".toml"

    def _waits(self, news: str) -> None:
        """Something keeps numbers waiting, or no longer; what lasts a moment alone is not worth a word."""
        if self._waiting is not None:
            self._waiting.stop()
            self._waiting = None
        if news:
            self._waiting = self._later(_LASTS_S, partial(self._wait, f"numbers wait: {news}"))
        else:
            self._wait("")

    def _arrived(self, _asked: Asked) -> None:
        """A number has come: say what the last edit did, if it was not said so before."""
        words = self.words()
        if words and words != self._said:
            self._said = words
            self._say(words)

    # What is known

    @property
    def seen(self) -> Measurement | None:
        """The measurement that is looked at: the one that is chosen, else the first that has a number."""
        name, path, every = self._choice.of("measurement"), self._choice.measured(self.project), self.measured.all
        found = next((one for one in every if one.name == name or path in one.files), None)
        return found or next((one for one in every if not one.why), next(iter(every), None))

    def asked(self, one: Measurement) -> Asked:
        """What is asked of a measurement."""
        return self._asked.get(one.name) or self._asked_of(one, tables=self.of_tables)

    def node(self) -> Node | None:
        """What the number of the measurement that is looked at is computed by; None where it has none."""
        seen = self.seen
        asked = None if seen is None else self.asked(seen)
        return None if asked is None or asked.request is None else self.engine.node(asked, self._session.inputs())

    def known(self, one: Measurement) -> Known:
        """What is known of its number."""
        return self.engine.known(self.asked(one))

    def of_file(self, path: Path) -> Known | None:
        """What is known of the number of the measurement that a file belongs to; None where it belongs to none."""
        one = next((one for one in self.measured.all if path in one.files), None)
        return None if one is None else self.known(one)

    def choose(self, one: Measurement) -> None:
        """Look at a measurement, on every screen."""
        if not self._choice.choose_measured(one.files[0], self.project) and one is not self.seen:
            self._choice.choose("measurement", one.name)

    def go(self, by: int) -> None:
        """Look at the next distance of the set, or the one before."""
        seen = self.seen
        if seen is not None:
            others = self.measured.set_of(seen)
            self.choose(others[(others.index(seen) + by) % len(others)])

    def words(self) -> str:
        """What the last edit did to what is seen and to the others of its set; empty before that is known."""
        seen, edit, where = self.seen, self._session.edit, self.measured.where
        if seen is None or not edit:
            return ""
        others = [one for one in self.measured.set_of(seen) if one is not seen and self.asked(one).request is not None]
        known = [(where(one), self.known(one)) for one in others]
        pending = next((k.state.removeprefix("computing ") for _, k in known if k.state.startswith("computing ")), "")
        return step_words(f"edit {edit}", self.known(seen), where(seen), known, pending)

    def context(self) -> Context:
        """What the second line says."""
        return replace(self._context(), is_baseline=self._session.shows_baseline)

    def _context(self) -> Context:
        seen, last = self.seen, self._session.step(self._session.edit)
        file = self._choice.of("lut").rpartition("/")[2] if last.path is None else last.path.name
        unsaved = self._session.unsaved()
        if seen is None:
            model = self._choice.of("model").rpartition("/")[2]
            return Context(file, unsaved, model.removesuffix("-"), "no measurement" if self.project.entries else "")
        asked, others, words = self.asked(seen), self.measured.set_of(seen), self.measured.words(seen)
        place, known = f"{others.index(seen) + 1}/{len(others)}", self.engine.known(asked)
        if asked.request is None:
            return Context(file, unsaved, "", words, place, "", known)
        after = [one.value for edit in self.engine.edits if (one := self.engine.after(asked, edit)) is not None]
        course = (*([] if known.start is None else [known.start.value]), *reversed(after))
        return Context(file, unsaved, asked.request.model.name, words, place, asked.request.kind, known, course)
