"""Reads blooming datasets and computes what a table is expected to show there, in a thread beside the interface."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.jobs.profiles import Choice, Key, ProfileData, Profiles, compile_aside, first_time

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.formats.lut import LutTable

__all__ = ["ProfileWorker"]

_ONCE = "computing: the sensor model is compiled first, once on this machine; it takes a while"

Soon = Callable[..., object]
"""Calls a function with its arguments in the interface's own thread."""


class ProfileWorker:
    """What it was asked for last counts: what was asked for before and is not begun is left.

    `on_result`: hears of each dataset that was read or computed, or could not be; `on_message`: lines for the user.
    `computed`: how many expectations were computed.
    """

    def __init__(self, on_result: Callable[[Choice], object], on_message: Callable[[str], object]) -> None:
        self.computed = 0
        self._on_result, self._on_message = on_result, on_message
        self._profiles = Profiles()
        self._faults: dict[Key, str] = {}
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
        known = self._profiles.known(choice)
        if isinstance(known, LidarcheckError):
            return known.lines()[0].removeprefix("error: ")
        return self._faults.get(choice.key) or known

    def expected(self, choice: Choice, table: LutTable | None) -> Profile | None:
        """What a table is expected to show of a dataset; None until it is computed."""
        return None if table is None else self._profiles.known_expected(choice, table)

    def ask(self, choices: Sequence[Choice], table: LutTable | None, soon: Soon) -> None:
        """Have the thread read and compute what of these is not there yet, in the place of all it was asked before."""
        missing = [choice for choice in choices if self._is_missing(choice, table)]
        with self._wanted:
            self._job = (missing, table) if missing else None
            if missing and not self._busy:
                self._busy = True
                threading.Thread(target=self._work, args=(soon,), name="profiles", daemon=True).start()

    def _is_missing(self, choice: Choice, table: LutTable | None) -> bool:
        if choice.key in self._faults:
            return False
        found = self._profiles.known(choice)
        return found is None or (
            isinstance(found, ProfileData) and table is not None and self.expected(choice, table) is None
        )

    def _fell(self, choice: Choice, what: str) -> None:
        self._faults[choice.key] = what
        self._on_result(choice)

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
        try:
            step(soon, choice, table)
        except Exception as error:  # noqa: BLE001 - a fault in a profile must not take the editor with it
            soon(self._fell, choice, f"internal error, {type(error).__name__}: {error}")

    def _load(self, soon: Soon, choice: Choice, _table: LutTable | None) -> None:
        if self._profiles.known(choice) is None:
            self._profiles.load(choice)
            soon(self._on_result, choice)

    def _expect(self, soon: Soon, choice: Choice, table: LutTable | None) -> None:
        shown = self._profiles.load(choice)
        if table is not None and isinstance(shown, ProfileData):
            first = first_time()
            if first:
                soon(self._on_message, _ONCE)
                compile_aside()
            self._profiles.expected(choice, shown, table)
            if first:
                soon(self._on_message, "the sensor model is compiled")
            self.computed += 1
            soon(self._on_result, choice)
