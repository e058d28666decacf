"""Computing what a screen of pages is asked for: one job at a time, in a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.host import STOPS, Host
from lidarcheck.tui.jobs.job import Cancelled, Computed, Job, Pages, computed
from lidarcheck.tui.screens.shared.view import View

if TYPE_CHECKING:
    from lidarcheck.figures.data import Page

__all__ = ["PageWork"]

_EVERY_S = 0.25


class PageWork(View):
    """`pages`, `faults`: what was computed, and why something could not be, by `Job.key()`. `running`: what is computed
    now, by `worker`.
    """

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.pages = Pages()
        self.faults: dict[Hashable, str] = {}
        self.running: Job | None = None
        self.worker: threading.Thread | None = None
        self._stop = threading.Event()

    @property
    def job(self) -> Job | None:
        """What is under the cursor."""
        raise NotImplementedError

    def draw(self) -> None:
        """Show what has become of it."""
        raise NotImplementedError

    def is_computing(self, job: Job) -> bool:
        """Whether this is computed now; it may have been listed anew since it was begun."""
        return self.running is not None and (self.running.name, self.running.choices) == (job.name, job.choices)

    def fault_of(self, job: Job) -> str:
        """Why there is no page of it; empty where nothing speaks against one."""
        return self.host.inside(job.fault or self.faults.get(job.key(), ""))

    def action_compute(self) -> None:
        """Compute what is under the cursor, beside the interface."""
        job = self.job
        if job is None:
            self.say("there is nothing to compute here")
        elif job.fault:
            self.say(self.host.inside(job.fault), bad=True)
        elif self.running is not None:
            how = "is being stopped; wait a moment" if self._stop.is_set() else "is being computed; x stops it"
            self.say(f"{self.running.name} {how}")
        elif self.pages.made(job) is not None:
            self.say(f"{job.name} is computed, and its files are as they were")
        else:
            self.running, self._stop = job, threading.Event()
            self.draw()
            work = (self.host, job, job.key(), self._stop)
            self.worker = threading.Thread(target=self._compute, args=work, name=job.name, daemon=True)
            self.worker.start()

    def _compute(self, host: Host, job: Job, key: Hashable, stop: threading.Event) -> None:
        """In a thread. A fault in a computation must not take the interface with it."""
        shown_s = 0.0

        def on_progress(done: int, of: int, now: str) -> None:
            nonlocal shown_s
            if stop.is_set():
                raise Cancelled
            if time.monotonic() - shown_s > _EVERY_S:
                shown_s = time.monotonic()
                count = f" {done}/{of}" if of > 1 else ""
                host.soon(self._progress, job, f"{job.name}: {now}{count}{STOPS}")

        try:
            on_progress(0, 1, "reading")
            made = job.compute(on_progress)
            on_progress(1, 1, "done")
            host.soon(self._computed, job, key, made)
        except Cancelled:
            host.soon(self._failed, job, key, "", f"{job.name}: stopped")
        except LidarcheckError as error:
            host.soon(self._failed, job, key, "; ".join(error.lines()).removeprefix("error: "), error)
        except Exception as error:  # noqa: BLE001 - see above
            words = f"internal error, {type(error).__name__}: {error}"
            host.soon(self._failed, job, key, words, f"error: {job.name}: {words}")

    def _progress(self, job: Job, text: str) -> None:
        if self.running is job:
            self.progress(text)

    def _computed(self, job: Job, key: Hashable, made: Page | Computed) -> None:
        self.pages.keep(key, made)
        self.faults.pop(key, None)
        self._ended(job)
        self.say(f"{job.name}: {computed(made).page.summary}")

    def _failed(self, job: Job, key: Hashable, fault: str, say: Any) -> None:
        if fault:
            self.faults[key] = fault
        self._ended(job)
        self.say(say, bad=bool(fault))

    def _ended(self, job: Job) -> None:
        if self.running is job:
            self.running = None
            self.progress("")
        if self.is_mounted:
            self.draw()

    def action_stop(self) -> None:
        """Stop what is computed."""
        self._stop.set()
        if self.running is None:
            self.say("nothing is computed")
        else:
            self.progress("")  # what begins anew is seen at once
            self.progress(f"{self.running.name}: stopping after the step that runs now")

    def closing(self) -> None:
        """Let a computation end."""
        self._stop.set()
