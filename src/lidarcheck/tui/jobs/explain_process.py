"""`lidarcheck explain` in a process of its own: starting it, reading how far it is and what it finds, stopping it.

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
from lidarcheck.permissions import given

__all__ = ["PROGRAM", "ExplainProcess", "ExplainProgress", "command_of"]

PROGRAM = (sys.executable, "-m", "lidarcheck")
_KEPT_LINES = 200


def command_of(
    case: Path, out: Path, *, seed: str = "", exclude: str = "", program: Sequence[str] = PROGRAM
) -> list[str]:
    """The command that explains a case."""
    more = [*(["--seed", seed] if seed else []), *(["--exclude", exclude] if exclude else [])]
    permitted = given()
    more += [*(["--trust"] if permitted.trust else []), *(f"--root={root}" for root in permitted.roots)]
    return [*program, "explain", str(case), "--out", str(out), "--progress", "json", *more]


@dataclass
class ExplainProgress:
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
            message = json.loads(line)
            if "steps" in message:
                self.steps = {str(name): (0, 0) for name in message["steps"]}
            elif "found" in message:
                self.found.append((str(message["step"]), str(message["found"])))
            else:
                self._far(message)
        except (ValueError, TypeError, KeyError):
            self.said = [*self.said, line][-_KEPT_LINES:]
            return False
        return True

    def _far(self, message: dict[str, Any]) -> None:
        name, done, of = str(message["step"]), int(message["done"]), int(message["of"])
        left = message["left_s"]
        self.part, self.elapsed_s = float(message["part"]), float(message["elapsed_s"])
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


class ExplainProcess:
    """A process that explains a case; its calls come from another thread.

    `on_progress`: there is something new in `progress`; `on_line`: a line that is not about progress; `on_end`: the
    exit code.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        on_progress: Callable[[], object],
        on_line: Callable[[str], object],
        on_end: Callable[[int], object],
    ) -> None:
        self.progress = ExplainProgress()
        self._on_progress, self._on_line, self._on_end = on_progress, on_line, on_end
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
                if not self.progress.take(line.rstrip("\n")):
                    self._on_line(line.rstrip("\n"))
                self._on_progress()
        self._on_end(self._process.wait())
