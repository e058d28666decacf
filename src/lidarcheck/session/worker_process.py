"""What runs in the worker process: one request after the other, which hears between two steps that it was cancelled."""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from typing import Any

from lidarcheck.permissions import Permissions, grant
from lidarcheck.reading import reading
from lidarcheck.session.node import Cancelled, Entry, ProgressCallback, function_of, words_of
from lidarcheck.workers.parent import end_with_parent

__all__ = ["COMPILES", "WARM", "compile_kernels", "serve"]

COMPILES = "the sensor model is compiled, once on this machine"
"""Said in the place of progress."""
WARM: tuple[tuple[Entry, tuple[Any, ...]], ...] = (("lidarcheck.session.worker_process:compile_kernels", ()),)
_NICE = 5
_EVERY_S = 0.05
"""How often progress is told."""


def compile_kernels(progress: ProgressCallback) -> None:
    """Compile the sensor model's kernels, or load what was compiled before, and the effects that models name."""
    import lidarcheck.calibration.number.entry  # noqa: F401 - what is asked for first
    from lidarcheck.calibration.blooming.response import response_of
    from lidarcheck.effects.finding import catalogue
    from lidarcheck.sensor import Sensor

    progress(0, 2, COMPILES)
    catalogue()
    progress(1, 2, COMPILES)
    response_of(Sensor.of("SLIM"))


def serve(connection: Connection, permissions: Permissions, warm: tuple[tuple[Entry, tuple[Any, ...]], ...]) -> None:
    """The process: prepare, say so, then answer until nobody asks any more."""
    end_with_parent()
    _be_quiet()
    os.nice(_NICE)
    grant(permissions)
    _Process(connection).serve(warm)


def _be_quiet() -> None:
    """The terminal is another's: nothing is written to it, and its interrupt is for who reads keys."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (sys.__stdin__, sys.__stdout__, sys.__stderr__):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            os.dup2(nowhere, descriptor.fileno())  # type: ignore[union-attr]


class _Said(logging.Handler):
    """Warnings go to who asked."""

    def __init__(self, say: Callable[..., None]) -> None:
        super().__init__(logging.WARNING)
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            self._say("log", record.getMessage())


class _Process:
    """The requests that came, in their order, and those that are not waited for any more."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._requests: deque[tuple[Any, ...]] = deque()
        self._cancelled: set[int] = set()
        self._lock = threading.Lock()

    def serve(self, warm: tuple[tuple[Entry, tuple[Any, ...]], ...]) -> None:
        """Answer until nobody asks any more."""
        log = logging.getLogger("lidarcheck")
        log.addHandler(_Said(self._say))
        log.propagate = False
        with contextlib.suppress(EOFError, OSError):  # who asked is gone
            if warm:  # brings numba, which is half a second
                _hear_of_compiling(lambda begins: self._say("compiling", begins))
            self._say("ready")
            for entry, arguments in warm:
                self._warm(entry, arguments)
            while True:
                while not self._requests:
                    self._take()
                number, entry, arguments, edited = self._requests.popleft()
                self._send(_packed_answer(number, entry, arguments, edited, self._progress(number)))
                self._cancelled.discard(number)

    def _say(self, *message: Any) -> None:
        self._send(pickle.dumps(message))

    def _send(self, packed: bytes) -> None:
        """Kernels are compiled, and warnings given, in other threads too."""
        with self._lock:
            self._connection.send_bytes(packed)

    def _take(self) -> None:
        """A message; waits for it."""
        word, *rest = self._connection.recv()
        if word == "cancel":
            self._cancelled.add(rest[0])
        else:
            self._requests.append(tuple(rest))

    def _warm(self, entry: Entry, arguments: tuple[Any, ...]) -> None:
        """Run something so that it is quick when it is asked for; what is asked for comes first."""

        def progress(_done: int, _of: int, _now: str) -> None:
            while self._connection.poll():
                self._take()
            if self._requests:
                raise Cancelled

        with contextlib.suppress(Exception):  # who asks for it gets to know
            function_of(entry)(*arguments, progress=progress)

    def _progress(self, number: int) -> ProgressCallback:
        told_s = 0.0

        def progress(done: int, of: int, now: str) -> None:
            nonlocal told_s
            while self._connection.poll():
                self._take()
            if number in self._cancelled:
                raise Cancelled
            if time.monotonic() - told_s >= _EVERY_S:
                told_s = time.monotonic()
                self._say("progress", number, done, of, now)

        return progress


def _packed_answer(
    number: int, entry: Entry, arguments: tuple[Any, ...], edited: Mapping[str, bytes], progress: ProgressCallback
) -> bytes:
    """Compute, and pack what came of it: any fault is this request's alone."""
    start = time.monotonic()
    try:
        progress(0, 1, "")
        with reading(edited) as read:
            value = function_of(entry)(*arguments, progress=progress)
        seconds = time.monotonic() - start
        return pickle.dumps(("done", number, value, "", seconds, dict(read.files), frozenset(read.taken)))
    except Cancelled:
        failed = "stopped"
    except Exception as error:  # noqa: BLE001 - see above
        failed = words_of(error)
    return pickle.dumps(("done", number, None, failed))


def _hear_of_compiling(tell: Callable[[bool], None]) -> None:
    """Have numba tell when it begins to compile something, and when it has."""
    from numba.core import event

    depth = 0

    class Compiling(event.Listener):
        def on_start(self, event: Any) -> None:
            nonlocal depth
            depth += 1
            if depth == 1:
                tell(True)

        def on_end(self, event: Any) -> None:
            nonlocal depth
            depth -= 1
            if depth == 0:
                tell(False)

    event.register("numba:compile", Compiling())  # type: ignore[no-untyped-call]
