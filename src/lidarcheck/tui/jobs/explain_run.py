"""`lidarcheck explain` in a process of its own: starting it, hearing how far it is and what it finds, stopping it.

The process is in a session of its own: a lost connection does not end it, and what it finds is there at the next start.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError

__all__ = ["PROGRAM", "ExplainRun", "Heard", "command_of"]

PROGRAM = (sys.executable, "-m", "lidarcheck")
_KEPT_LINES = 200


def command_of(
    case: Path, out: Path, *, seed: str = "", exclude: str = "", program: Sequence[str] = PROGRAM
) -> list[str]:
    """The command that explains a case."""
    more = [*(["--seed", seed] if seed else []), *(["--exclude", exclude] if exclude else [])]
    return [*program, "explain", str(case), "--out", str(out), "--progress", "json", *more]


@dataclass
class Heard:
    """What the process has said. `steps`: how far each is, (done, of); `found`: steps' words; `said`: other lines."""

    steps: dict[str, tuple[int, int]] = field(default_factory=dict)
    now: str = ""
    part: float = 0.0
    elapsed_s: float = 0.0
    left_s: float | None = None
    found: list[tuple[str, str]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def take(self, line: str) -> bool:
        """A line of the process; whether it was about its progress."""
        try:
            told = json.loads(line)
            if "steps" in told:
                self.steps = {str(name): (0, 0) for name in told["steps"]}
            elif "found" in told:
                self.found.append((str(told["step"]), str(told["found"])))
            else:
                self._far(told)
        except (ValueError, TypeError, KeyError):
            self.said = [*self.said, line][-_KEPT_LINES:]
            return False
        return True

    def _far(self, told: dict[str, Any]) -> None:
        name, done, of = str(told["step"]), int(told["done"]), int(told["of"])
        left = told["left_s"]
        self.part, self.elapsed_s = float(told["part"]), float(told["elapsed_s"])
        self.left_s = None if left is None else float(left)
        if name != self.now:
            names = list(self.steps)
            for before in names[: names.index(name)] if name in names else []:
                self.steps[before] = (1, 1)  # steps come in order, and some have nothing to do
        self.now = name
        self.steps[name] = (done, of)

    @property
    def fault(self) -> str:
        """The error that it ended with; empty if it said none."""
        return next((one.removeprefix("error: ") for one in self.said if one.startswith("error: ")), "")


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


class ExplainRun:
    """A process that explains a case; its calls come from another thread.

    `told`: there is something new; `note`: a line that is not about progress; `ended`:
    the exit code.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        told: Callable[[], object],
        note: Callable[[str], object],
        ended: Callable[[int], object],
    ) -> None:
        self.heard = Heard()
        self._told, self._note, self._ended = told, note, ended
        self._stopping = False
        try:
            with _interruptible():
                self._process = subprocess.Popen(
                    list(command),
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    text=True,
                    encoding="utf-8",
                    errors="backslashreplace",
                    start_new_session=True,
                )
        except OSError as error:
            fix = "check that it is installed"
            raise InputError(f"cannot be started: {error.strerror}", file=command[0], fix=fix) from error
        threading.Thread(target=self._listen, name="explain", daemon=True).start()

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
                if not self.heard.take(line.rstrip("\n")):
                    self._note(line.rstrip("\n"))
                self._told()
        self._ended(self._process.wait())
