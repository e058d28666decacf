"""A process that stays up and answers one run after another, whatever is said to it."""

from __future__ import annotations

import abc
import contextlib
from collections.abc import Sequence

from lidarcheck.model.external.exchange import Request
from lidarcheck.model.external.pipe import Pipe
from lidarcheck.model.external.process import Child, Groups, scratch_directory
from lidarcheck.model.spec import External
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["Resident"]


class Resident(abc.ABC):
    """Started and greeted, in a scratch directory of its own. `ExternalModelError` when it cannot be, and then nothing
    of it is left.
    """

    batch = 1
    """How many requests `run` takes."""

    def __init__(self, command: Sequence[str], external: External, groups: Groups) -> None:
        self._external = external
        self._answered = False
        with contextlib.ExitStack() as stack:
            self._directory = stack.enter_context(scratch_directory())
            self._child = Child(command, external, self._directory, pipes=True, groups=groups)
            stack.callback(self._child.end)
            self._pipe = Pipe(self._child, external)
            self._greet()
            self._stack = stack.pop_all()

    @abc.abstractmethod
    def _greet(self) -> None:
        """Hear what it says first."""

    @abc.abstractmethod
    def run(self, requests: Sequence[Request], sensor: Sensor | None) -> list[Scan]:
        """The echoes of at most `batch` requests. After an error it may be of no more use."""

    @property
    def group(self) -> int:
        """Its process group."""
        return self._child.group

    @property
    def ready(self) -> bool:
        """Whether it has not ended and owes no answer."""
        return self._answered and self._child.wait(0.0) is None

    def end(self, *, gently: bool = False) -> None:
        """Let it be gone, with all that it started; `gently`: it may end by itself when its input ends."""
        if gently:
            self._child.close()
        self._stack.close()
