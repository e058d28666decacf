"""Reads blooming datasets and computes what a table is expected to show there, in a thread beside the interface."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from lidarcheck.session.node import Node
from lidarcheck.session.session import CURRENT, FAILED, NONE, Session
from lidarcheck.tui.jobs.profiles import Choice, ProfileData, Profiles, compile_aside, first_time

if TYPE_CHECKING:
    from lidarcheck.formats.lut import LutTable
    from lidarcheck.tui.jobs.profiles import Shown

__all__ = ["ProfileWorker"]

_ONCE = "computing: the sensor model is compiled first, once on this machine; it takes a while"

Soon = Callable[..., object]
"""Calls a function with its arguments in the interface's own thread."""


class ProfileWorker:
    """What it was asked for last counts: what was asked for before and is not begun is left.

    `on_result`: hears of each dataset that was read or computed, or could not be; `on_message`: lines for the user.
    `computed`: how many expectations were computed.
    """

    def __init__(
        self, session: Session, on_result: Callable[[Choice], object], on_message: Callable[[str], object]
    ) -> None:
        self.computed = 0
        self._on_result, self._on_message = on_result, on_message
        self._session, self._profiles = session, Profiles(session)
        self._wanted = threading.Condition()
        self._job: tuple[Sequence[Choice], LutTable | None] | None = None
        self._busy = False

    @property
    def busy(self) -> bool:
        """Whether something is being read or computed."""
        return self._busy

    # What is there, for the interface's thread

    def found(self, choice: Choice) -> ProfileData | str | None:
        """A dataset as it was read, or in words why it cannot be; None while it is read."""
        word, derived = self._session.status(self._profiles.measured(choice))
        if word.startswith((FAILED, NONE)):
            return word.removeprefix(FAILED)
        found: ProfileData | None = derived.value if derived is not None and word == CURRENT else None
        return found

    def expected(self, choice: Choice, table: LutTable | None) -> tuple[str, Shown | None]:
        """(its state, what a table is expected to show of a dataset); while that is computed what another table, or
        another file, was.
        """
        if table is None:
            return "", None
        word, derived = self._session.status(self.node(choice, table))
        return word, None if derived is None else derived.value

    def node(self, choice: Choice, table: LutTable) -> Node:
        """What that is computed by."""
        return self._profiles.expected(choice, table)

    def ask(self, choices: Sequence[Choice], table: LutTable | None, soon: Soon) -> None:
        """Have the thread read and compute what of these is not there yet, in the place of all it was asked before."""
        missing = [choice for choice in choices if self._is_missing(choice, table)]
        with self._wanted:
            self._job = (missing, table) if missing else None
            if missing and not self._busy:
                self._busy = True
                threading.Thread(target=self._work, args=(soon,), name="profiles", daemon=True).start()

    def _is_missing(self, choice: Choice, table: LutTable | None) -> bool:
        found = self.found(choice)
        if found is None or isinstance(found, str) or table is None:
            return found is None
        word = self.expected(choice, table)[0]
        return word != CURRENT and not word.startswith((FAILED, NONE))

    # In the thread

    def _work(self, soon: Soon) -> None:
        """Compute what was asked for last, until nothing new is."""
        while True:
            with self._wanted:
                job, self._job = self._job, None
                if job is None:
                    self._busy = False
                    return
            for step in (self._load, self._expect):
                for choice in job[0]:
                    if self._job is None:
                        self._guarded(soon, step, choice, job[1])

    def _guarded(self, soon: Soon, step: Any, choice: Choice, table: LutTable | None) -> None:
        # Why it failed is the session's to say; a fault in a profile must not take the editor with it.
        with contextlib.suppress(Exception):
            step(soon, choice, table)
        soon(self._on_result, choice)

    def _load(self, _soon: Soon, choice: Choice, _table: LutTable | None) -> None:
        self._session.compute(self._profiles.measured(choice))

    def _expect(self, soon: Soon, choice: Choice, table: LutTable | None) -> None:
        if table is None or self.expected(choice, table)[0] == CURRENT or isinstance(self.found(choice), str):
            return
        first = first_time()
        if first:
            soon(self._on_message, _ONCE)
            compile_aside()
        self._session.compute(self._profiles.expected(choice, table))
        if first:
            soon(self._on_message, "the sensor model is compiled")
        self.computed += 1
