"""Work beside the interface: a run that can be stopped and tells how far it is, and reading what is there."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

from lidarcheck.session.node import Cancelled, ProgressCallback
from lidarcheck.tui.host import STOPS, Host
from lidarcheck.tui.screens.shared.view import View

__all__ = ["StoppableRun", "read_beside"]

_EVERY_S = 0.25
"""Progress is shown four times a second at most."""

T = TypeVar("T")
Work = Callable[[ProgressCallback, threading.Event], object]


class StoppableRun:
    """Runs of seeds in a thread, one at a time. `noun`: what one is called, as `review`.

    `on_end` gets what is to be said of its end, empty where it has ended well.
    """

    def __init__(self, view: View, noun: str, on_end: Callable[[str], object]) -> None:
        self.running = False
        self._view, self._noun, self._on_end = view, noun, on_end
        self._stop = threading.Event()
        self._shown_s = 0.0

    def start(self, work: Work) -> None:
        """Begin `work`, which gets a progress callback and the event that stops it; refused while another runs."""
        if self.running:
            self._view.say(f"a {self._noun} is going on; x stops it")
            return
        self.running, self._shown_s = True, float("-inf")
        self._stop.clear()
        soon = self._view.host.soon  # a view that was taken down does not find its app any more
        threading.Thread(target=self._run, args=(soon, work), name=self._noun, daemon=True).start()

    def _run(self, soon: Callable[..., object], work: Work) -> None:
        how = ""
        try:
            work(lambda done, of, now: soon(self._progress, done, of, now), self._stop)
        except Cancelled:
            how = f"the {self._noun} was stopped"
        except Exception as error:  # noqa: BLE001 - a fault in a run must not take an editor with it
            how = f"error: internal error in the {self._noun}, {type(error).__name__}: {error}"
        soon(self._ended, how)

    def _progress(self, done: int, of: int, now: str) -> None:
        moment = time.monotonic()
        if self.running and moment - self._shown_s > _EVERY_S:
            self._shown_s = moment
            self._view.progress(f"{self._noun} {done}/{of}: {now}{STOPS}")

    def _ended(self, how: str) -> None:
        self.running = False
        self._view.progress("")
        self._on_end(how)

    def stop(self) -> None:
        """Stop it, and say so; where none goes on, a command that was started here."""
        if not self.running:
            self._view.stop_command()
            return
        self.close()
        self._view.say("stopping after the seeds that run now")

    def close(self) -> None:
        """Stop it: the interface ends."""
        self._stop.set()


def read_beside(host: Host, what: str, read: Callable[[], T], then: Callable[[T], object]) -> None:
    """Read files in a thread of its own, then hand on what was found. `what`: what cannot be read, if it cannot."""

    def work() -> None:
        try:
            found = read()
        except (OSError, ValueError) as error:
            host.soon(host.say, f"{what} cannot be read: {error}")
            return
        host.soon(then, found)

    threading.Thread(target=work, name=what, daemon=True).start()
