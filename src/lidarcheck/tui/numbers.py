"""The numbers of a project's measurements for all screens: what is asked for, which one is seen, and what is said."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from lidarcheck.session.choice import Choice
from lidarcheck.session.project import Project
from lidarcheck.session.session import Session
from lidarcheck.tui.context import Context, step_words
from lidarcheck.tui.engine import Asked, Engine, Known, Process
from lidarcheck.tui.jobs.measured import Measurement, measurements, request_of, set_of

__all__ = ["Numbers"]


class Numbers:
    """Follows project, choice and edits. `measured`: what there is; `began`: when, in seconds since the epoch; `say`
    gets what an edit did, in words.
    """

    def __init__(
        self,
        project: Project,
        session: Session,
        choice: Choice,
        worker: Process | None,
        later: Callable[..., Any],
        soon: Callable[..., object],
        say: Callable[[str], object],
    ) -> None:
        self.engine = Engine(session, worker, later, soon)
        self.engine.on_number = self._arrived
        self.project = project
        self.measured: list[Measurement] = []
        self._asked: dict[str, Asked] = {}
        self._session, self._choice, self._say = session, choice, say
        self._said = ""
        self.began = time.time()

    # What happens

    def project_read(self, project: Project) -> None:
        """The project was read."""
        self.project = project
        self.measured = measurements(project)
        self.ask()

    def inputs_changed(self) -> None:
        """Files were edited, saved, read again or changed on the disk."""
        self.engine.look()
        self.ask()

    def ask(self) -> None:
        """Have the numbers asked for that belong to what is chosen."""
        self._asked = {one.name: self._asked_of(one) for one in self.measured}
        seen = self.seen
        first = [self._asked[seen.name]] if seen is not None else []
        near = [] if seen is None else [self._asked[one.name] for one in set_of(self.measured, seen)]
        self.engine.ask(list(dict.fromkeys([*first, *near, *self._asked.values()])))

    def _asked_of(self, one: Measurement) -> Asked:
        request = request_of(self.project, one, self._choice, tables=self.of_tables)
        return Asked(one.name, None, request) if isinstance(request, str) else Asked(one.name, request)

    @property
    def of_tables(self) -> bool:
        """Whether the last edit was one of tables; before the first one, whether there are tables."""
        made = self.engine.steps.made
        return not made[-1].file.endswith(".toml") if made else bool(self._choice.of("lut"))

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
        path = self._choice.measured(self.project)
        found = next((one for one in self.measured if path in one.files), None)
        return found or next((one for one in self.measured if not one.none), next(iter(self.measured), None))

    def asked(self, one: Measurement) -> Asked:
        """What is asked of a measurement."""
        return self._asked.get(one.name) or self._asked_of(one)

    def known(self, one: Measurement) -> Known:
        """What is known of its number."""
        return self.engine.known(self.asked(one))

    def go(self, by: int) -> None:
        """Look at the next distance of the set, or the one before."""
        seen = self.seen
        if seen is None:
            return
        others = set_of(self.measured, seen)
        self._choice.choose_measured(others[(others.index(seen) + by) % len(others)].files[0], self.project)

    def words(self) -> str:
        """What the last edit did to what is seen and to the others of its set; empty before that is known."""
        seen, made = self.seen, self.engine.steps.made
        if seen is None or not made:
            return ""
        others = [one for one in set_of(self.measured, seen) if one is not seen and self.asked(one).request is not None]
        known = [(_distance(one), self.known(one)) for one in others]
        pending = next((k.state.removeprefix("computing ") for _, k in known if k.state.startswith("computing ")), "")
        return step_words(f"edit {made[-1].number}", self.known(seen), _distance(seen), known, pending)

    def context(self) -> Context:
        """What the second line says."""
        seen, tables = self.seen, self._choice.of("lut").rpartition("/")[2]
        file = tables if self.of_tables or not self.engine.steps.made else self.engine.steps.made[-1].file
        unsaved = self._session.unsaved()
        if seen is None:
            model = self._choice.of("model").rpartition("/")[2]
            return Context(file, unsaved, model.removesuffix("-"), "no measurement" if self.project.entries else "")
        asked, others = self.asked(seen), set_of(self.measured, seen)
        place = f"{others.index(seen) + 1}/{len(others)}"
        if asked.request is None:
            return Context(file, unsaved, "", seen.words, place, "", self.engine.known(asked))
        after = (self.engine.after(asked, made) for made in self.engine.steps.made)
        start = self.engine.known(asked).start
        course = (*([] if start is None else [start.value]), *(one.value for one in after if one is not None))
        model = asked.request.model.name
        return Context(file, unsaved, model, seen.words, place, asked.request.kind, self.engine.known(asked), course)


def _distance(one: Measurement) -> str:
    return one.words if one.distance_m is None else f"{one.distance_m:g} m"
