"""One process beside the interface that computes what it is asked for, one request at a time.

It is started afresh and not forked, since the interface has threads; it is nicer than what the user types to, keeps
what its functions hold from one request to the next, and ends with the process that started it, however that ends.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from lidarcheck.permissions import given
from lidarcheck.session.node import Entry, ProgressCallback
from lidarcheck.session.ticket import Outcome, Ticket, guarded, how_it_ended
from lidarcheck.session.worker_process import COMPILES, WARM, serve

__all__ = ["Worker"]

_log = logging.getLogger(__name__)
_STARTS_S = 60.0
"""A process that has not begun to listen by then will not."""
_PATIENCE_S = 120.0
"""Without a word for so long it hangs; compiling kernels does not count."""
_GIVES_UP_S = 10.0
"""What was cancelled ends between two seeds; one that does not, while others wait, hangs."""


class Worker:
    """Requests are computed in the order of their `priority`, the lowest first; a newer one takes the place of another
    in its `lane`, and ends it between two seeds where it runs.

    `warm`: entries with arguments that are run at the start while nothing else is asked for; without any, compiling is
    not told from hanging. All calls are for any thread. Callbacks come in a thread of the worker's; they must not wait
    for a thread that calls the worker.
    """

    def __init__(self, *, warm: Sequence[tuple[str, tuple[Any, ...]]] = WARM, patience_s: float = _PATIENCE_S) -> None:
        self._warm, self._patience_s = tuple(warm), patience_s
        self._lock = threading.RLock()
        self._waiting: list[Ticket] = []
        self._running: Ticket | None = None
        self._count = 0
        self._closed = False
        self._thread: threading.Thread | None = None
        self._woken = self._wake = -1
        # Of the worker's thread alone.
        self._process: multiprocessing.process.BaseProcess | None = None
        self._connection: Connection | None = None
        self._ready = self._compiling = self._sent = self._told_to_end = False
        self._heard_s = 0.0

    @property
    def busy(self) -> bool:
        """Whether something is computed or waits."""
        with self._lock:
            return bool(self._waiting) or (self._running is not None and self._running.live)

    @property
    def pid(self) -> int | None:
        """The process's number; None where there is none now."""
        process = self._process
        return None if process is None else process.pid

    def start(self) -> None:
        """Start the process now, so that it is warm when it is asked."""
        with self._lock:
            if self._thread is None and not self._closed:
                self._woken, self._wake = os.pipe()
                os.set_blocking(self._wake, False)
                self._thread = threading.Thread(target=self._serve, name="worker", daemon=True)
                self._thread.start()

    def submit(
        self,
        entry: Entry,
        arguments: tuple[Any, ...] = (),
        edited: Mapping[str, bytes] | None = None,
        on_progress: ProgressCallback | None = None,
        on_done: Callable[[Outcome], object] | None = None,
        *,
        on_gone: Callable[[], object] | None = None,
        lane: str = "",
        priority: int = 0,
    ) -> Ticket:
        """Have `function(*arguments, progress=...)` computed, `entry` being "package.module:function".

        `edited`: contents by real path, read in the place of these files. `on_progress` gets (done, of, what is
        counted); `on_done` comes once, unless the ticket is cancelled or replaced: then `on_gone` does, and nothing
        more.
        """
        with self._lock:
            self._count += 1
            work = (entry, arguments, dict(edited or {}))
            ticket = Ticket(self._count, lane, (priority, self._count), work)
            ticket.on_progress, ticket.on_done, ticket.on_gone = on_progress, on_done, on_gone
            if self._closed:
                ticket.live = False
                return ticket
            replaced = [one for one in [*self._waiting, self._running] if one is not None and lane and one.lane == lane]
            self._waiting = sorted(
                [*(one for one in self._waiting if one not in replaced), ticket], key=lambda one: one.order
            )
        for one in replaced:
            self.cancel(one)
        self.start()
        self._rouse()
        return ticket

    def cancel(self, ticket: Ticket) -> None:
        """Nothing more is heard of a request; where it runs, it ends between two seeds."""
        with ticket.told, guarded():
            was, ticket.live = ticket.live, False
            if was and ticket.on_gone is not None:
                ticket.on_gone()
        with self._lock:
            if ticket in self._waiting:
                self._waiting.remove(ticket)
        self._rouse()

    def cancel_lane(self, lane: str) -> None:
        """The same for all of a lane."""
        with self._lock:
            found = [one for one in [*self._waiting, self._running] if one is not None and one.lane == lane]
        for ticket in found:
            self.cancel(ticket)

    def close(self) -> None:
        """End the process; what was asked for is not answered."""
        with self._lock:
            self._closed = True
            found = [one for one in [*self._waiting, self._running] if one is not None]
        for ticket in found:
            self.cancel(ticket)
        self._rouse()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(2.0)

    # In the worker's thread

    def _rouse(self) -> None:
        with self._lock, contextlib.suppress(BlockingIOError):  # it is roused enough
            if self._wake >= 0:
                os.write(self._wake, b"\0")

    def _serve(self) -> None:
        """Hand requests on and answers back, until `close`."""
        try:
            self._begin_process()
            while not self._closed:
                self._next()
                sources: list[Any] = [self._woken]
                if self._process is not None and self._connection is not None:
                    sources += [self._connection, self._process.sentinel]
                ready = wait(sources, self._time_left())
                if self._woken in ready:
                    os.read(self._woken, 4096)
                if self._connection in ready:
                    self._listen()
                elif self._process is not None and self._process.sentinel in ready:
                    self._lost(how_it_ended(self._process))
                elif not ready:
                    self._look_at_clock()
        finally:
            self._end_process()
            with self._lock:
                self._closed = True
                os.close(self._woken)
                os.close(self._wake)
                self._woken = self._wake = -1

    def _next(self) -> None:
        """Send what is to be computed next, and that what runs is no longer waited for."""
        with self._lock:
            if self._running is not None and not self._running.live and not self._sent:
                self._running = None
            if self._running is None and self._waiting:
                self._running, self._sent, self._told_to_end = self._waiting.pop(0), False, False
            running = self._running
        if running is None:
            return
        if self._process is None:
            self._begin_process()
        if not self._ready or self._connection is None:
            return
        try:
            if not self._sent:
                self._connection.send(("compute", running.number, *running.work))
                self._sent, self._heard_s = True, time.monotonic()
            elif not running.live and not self._told_to_end:
                self._connection.send(("cancel", running.number))
                self._told_to_end, self._heard_s = True, time.monotonic()
        except OSError:
            self._lost("ended")
        except Exception as error:  # noqa: BLE001 - what cannot be sent is this request's fault alone
            self._running = None
            self._answer(running, Outcome(failed=f"cannot be handed to the worker process: {error}"))
            self._rouse()

    def _listen(self) -> None:
        """One message of the process."""
        assert self._connection is not None
        try:
            word, *said = self._connection.recv()
        except (EOFError, OSError):
            self._lost(how_it_ended(self._process))
            return
        self._heard_s = time.monotonic()
        running = self._running
        if word == "ready":
            self._ready = True
        elif word == "log":
            _log.warning("%s", said[0])
        elif word == "compiling":
            self._compiling = bool(said[0])
            if running is not None:
                self._tell(running, 0, 1, COMPILES if self._compiling else "")
        elif running is not None and said[0] == running.number:
            if word == "progress":
                self._tell(running, *said[1:])
            elif word == "done":
                self._running = None
                self._answer(running, Outcome(*said[1:]))

    def _tell(self, ticket: Ticket, done: int, of: int, now: str) -> None:
        with ticket.told, guarded():
            if ticket.live and ticket.on_progress is not None:
                ticket.on_progress(done, of, now)

    def _answer(self, ticket: Ticket, outcome: Outcome) -> None:
        with ticket.told, guarded():
            if ticket.live:
                ticket.live = False
                if ticket.on_done is not None:
                    ticket.on_done(outcome)

    # The process

    def _begin_process(self) -> None:
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(
            target=serve, args=(there, given(), self._warm), name="lidarcheck worker", daemon=True
        )
        self._ready = self._compiling = self._sent = False
        self._heard_s = time.monotonic()
        try:
            process.start()
        except OSError as error:
            here.close()
            self._lost(f"cannot be started, {error.strerror or error},")
            return
        finally:
            there.close()
        self._process, self._connection = process, here

    def _end_process(self) -> None:
        if self._process is not None:
            with contextlib.suppress(OSError):
                self._process.kill()
            self._process.join(5.0)
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = None

    def _lost(self, how: str) -> None:
        """The process is no more, or hangs: what it had under way is begun again, once."""
        self._end_process()
        self._rouse()
        with self._lock:
            ticket, self._running = self._running, None
            if ticket is None or not ticket.live:
                return
            ticket.deaths += 1
            if ticket.deaths == 1:
                self._waiting.insert(0, ticket)
                return
        self._answer(ticket, Outcome(failed=f"the worker process {how} twice; r tries again"))

    def _limit_s(self) -> float | None:
        """How long the process may be silent now; None for as long as it likes."""
        if self._process is None or self._compiling:
            return None
        if not self._ready:
            return _STARTS_S
        if self._running is None:
            return None
        if not self._running.live:
            return _GIVES_UP_S if self._waiting else None
        return self._patience_s

    def _time_left(self) -> float | None:
        limit = self._limit_s()
        return None if limit is None else max(self._heard_s + limit - time.monotonic(), 0.0)

    def _look_at_clock(self) -> None:
        limit = self._limit_s()
        if limit is not None and time.monotonic() - self._heard_s >= limit:
            self._lost(f"gave no answer for {limit:g} s")
