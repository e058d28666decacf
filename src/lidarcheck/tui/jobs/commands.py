"""A command in a process of its own: starting it, reading how far it is, stopping it.

The process is in a session of its own: a lost connection does not end it, and what it writes is there at the next
start.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Generic, Protocol, TypeVar

from lidarcheck.errors import InputError
from lidarcheck.permissions import given

__all__ = ["KEPT_LINES", "PROGRAM", "CommandProcess", "CommandProgress", "Heard", "first_fault", "permitted_options"]

PROGRAM = (sys.executable, "-m", "lidarcheck")
KEPT_LINES = 200
"""Lines that a process has said are kept for who asks why it ended."""


def permitted_options() -> list[str]:
    """The options that permit a command what this process is permitted."""
    permitted = given()
    return [*(["--trust"] if permitted.trust else []), *(f"--root={root}" for root in permitted.roots)]


class Heard(Protocol):
    """What is made of the lines of a process."""

    def take(self, line: str) -> bool:
        """A line of the process; whether it was about its progress."""


@dataclass
class CommandProgress:
    """What a process has said. `now`: what it does; `done` and `of`: how much of it, 0 where nobody knows; `said`: its
    other lines.
    """

    now: str = ""
    done: int = 0
    of: int = 0
    said: list[str] = field(default_factory=list)

    def take(self, line: str) -> bool:
        """A line of the process; whether it was about its progress."""
        try:
            message = json.loads(line)
            now, done, of = str(message["now"]), int(message["done"]), int(message["of"])
        except (ValueError, TypeError, KeyError):
            self.said = [*self.said, line][-KEPT_LINES:]
            return False
        self.now, self.done, self.of = now, done, of
        return True

    def in_words(self) -> str:
        """How far it is."""
        return f"{self.now} {self.done}/{self.of}" if self.of else self.now

    @property
    def fault(self) -> str:
        """The error that it ended with; empty if it said none."""
        return first_fault(self.said)


def first_fault(said: Sequence[str]) -> str:
    """The first error among what a process has said; empty without one."""
    return next((one.removeprefix("error: ") for one in said if one.startswith("error: ")), "")


H = TypeVar("H", bound=Heard)


class CommandProcess(Generic[H]):
    """A process that runs a command; its calls come from another thread.

    `progress`: hears its lines on standard error; `on_progress`: there is something new in it; `on_line`: a line that
    is not about progress; `on_end`: the exit code. `output`: where its standard output goes; nowhere without.
    """

    def __init__(
        self,
        command: Sequence[str],
        progress: H,
        *,
        on_progress: Callable[[], object],
        on_line: Callable[[str], object],
        on_end: Callable[[int], object],
        output: Path | None = None,
        directory: Path | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.progress = progress
        self._on_progress, self._on_line, self._on_end = on_progress, on_line, on_end
        self._stopping = False
        self._process: subprocess.Popen[str]
        try:
            with _interruptible(), _writable(output) as out:
                self._process = subprocess.Popen(
                    list(command),
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.PIPE,
                    cwd=directory,
                    env={**os.environ, **(environment or {})},
                    text=True,
                    encoding="utf-8",
                    errors="backslashreplace",
                    start_new_session=True,
                )
        except OSError as error:
            fix = "check that it is installed"
            raise InputError(f"cannot be started: {error.strerror}", file=command[0], fix=fix) from error
        threading.Thread(target=self._listen, name="command", daemon=True).start()

    @property
    def number(self) -> int:
        """The process's own number."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process.poll() is None

    def stop(self) -> bool:
        """Interrupt it, which keeps what was done; asked again, end it at once. Whether it was asked before."""
        again, self._stopping = self._stopping, True
        with contextlib.suppress(OSError):
            if again:
                os.killpg(self._process.pid, signal.SIGKILL)
            elif self.running:
                os.kill(self._process.pid, signal.SIGINT)
        return again

    def _listen(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as stream:
            for line in stream:
                if not self.progress.take(line.rstrip("\n")):
                    self._on_line(line.rstrip("\n"))
                self._on_progress()
        self._on_end(self._process.wait())


@contextlib.contextmanager
def _writable(path: Path | None) -> Iterator[int | IO[bytes]]:
    """A file to write to; without one what nobody reads."""
    if path is None:
        yield subprocess.DEVNULL
        return
    with path.open("wb") as stream:
        yield stream


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """A process that is started here can be interrupted, also where this one was started in the background.

    A shell lets what it starts with `&` ignore interrupts, and so would all that is started from there.
    """
    main = threading.current_thread() is threading.main_thread()
    ignored = main and signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    if ignored:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        if ignored:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
