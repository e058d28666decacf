"""Computing what a screen of pages is asked for: one job at a time, in a thread."""

from __future__ import annotations

import threading
import time
from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.node import Cancelled, Node
from lidarcheck.session.origin import origin_of
from lidarcheck.session.session import CURRENT, FAILED, OLD, Session
from lidarcheck.tui.host import STOPS, Host
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.screens.shared.view import View

__all__ = ["PageWork"]

_EVERY_S = 0.25


class PageWork(View):
    """`running`: what is computed now, by `worker`. What is known of a job is the session's."""

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
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

    def known(self, job: Job) -> tuple[str, Computed | None]:
        """(its state in words, what was computed of it); the state of what belongs to the inputs is `CURRENT`."""
        word, derived = self.host.session.status(job.node)
        if self.is_computing(job) and word != CURRENT and not word.startswith("computing"):
            word = "computing"
        return word, None if derived is None else derived.value

    def node(self) -> Node | None:
        """What the page under the cursor is computed by."""
        return None if self.job is None else self.job.node

    def origin_of(self, job: Job) -> dict[str, Any]:
        """What the page that is shown of it was computed from, as it is written beside it."""
        return origin_of(self.host.session.status(job.node)[1])

    def fault_of(self, job: Job) -> str:
        """Why there is no page of it; empty where nothing speaks against one."""
        word = self.known(job)[0]
        failed = word.removeprefix(FAILED) if word.startswith(FAILED) else ""
        return self.host.inside(job.fault or failed)

    def action_compute(self) -> None:
        """Compute what is under the cursor, beside the interface."""
        self.compute(self.job)

    def compute(self, job: Job | None) -> None:
        """Compute something beside the interface, unless it cannot be, or is known."""
        if job is None:
            self.say("there is nothing to compute here")
        elif job.fault:
            self.say(self.host.inside(job.fault), bad=True)
        elif self.running is not None:
            how = "is being stopped; wait a moment" if self._stop.is_set() else "is being computed; x stops it"
            self.say(f"{self.running.name} {how}")
        elif self.known(job)[0] == CURRENT:
            self.say(f"{job.name} is current: computed from what is set now")
        else:
            self._start(job)

    def renew(self) -> None:
        """Compute what is seen again where its inputs have changed and that takes no longer than a moment."""
        job = self.job
        if job is None or job.fault or self.running is not None or not self.is_chosen:
            return
        session = self.host.session
        word, derived = session.status(job.node)
        if word.startswith(OLD) and derived is not None and session.is_cheap(derived):
            self._start(job)

    def _start(self, job: Job) -> None:
        self.running, self._stop = job, threading.Event()
        self.draw()
        work = (self.host, self.host.session, job, self._stop)
        self.worker = threading.Thread(target=self._compute, args=work, name=job.name, daemon=True)
        self.worker.start()

    def _compute(self, host: Host, session: Session, job: Job, stop: threading.Event) -> None:
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

        said: Any
        try:
            on_progress(0, 1, "reading")
            made: Computed = session.compute(job.node, on_progress).value
            said, bad = f"{job.name}: {made.page.summary}", False
        except Cancelled:
            said, bad = f"{job.name}: stopped", False
        except LidarcheckError as error:
            said, bad = error, True
        except Exception as error:  # noqa: BLE001 - see above
            said, bad = f"error: {job.name}: internal error, {type(error).__name__}: {error}", True
        host.soon(self._ended, job, said, bad)

    def _progress(self, job: Job, text: str) -> None:
        if self.running is job:
            self.progress(text)

    def _ended(self, job: Job, said: Any, bad: bool) -> None:
        if self.running is job:
            self.running = None
            self.progress("")
        if self.is_mounted:
            self.draw()
        self.say(said, bad=bad)

    def action_stop(self) -> None:
        """Stop what is computed."""
        self._stop.set()
        if self.running is None and self.host.commands.runs.running:
            self.stop_command()
        elif self.running is None:
            self.say("nothing is computed")
        else:
            self.progress("")  # what begins anew is seen at once
            self.progress(f"{self.running.name}: stopping after the step that runs now")

    def closing(self) -> None:
        """Let a computation end."""
        self._stop.set()
