"""Work on several cores of this machine: threads where the interpreter's lock is free, else processes.

Worker processes are started afresh and not forked, since the caller may have threads (a progress bar, a terminal
interface). One that is killed is replaced, and what it had under way is done again; they end with their caller, even
where that is killed.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import tempfile
import threading
import time
import warnings
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from lidarcheck.errors import WorkerError
from lidarcheck.permissions import Permissions, given, grant
from lidarcheck.workers.base import AsyncPool, Shared, WorkerPool, pack_tasks, pack_thing, perform, shared_by, things_of
from lidarcheck.workers.identity import limit_blas
from lidarcheck.workers.keeping import kept
from lidarcheck.workers.parent import end_with_parent
from lidarcheck.workers.waiting import result_of

__all__ = ["Processes", "Threads"]

_MOST_DEATHS = 3


class Threads(AsyncPool["Future[Any]"]):
    """Threads of this process; kernels release the interpreter's lock.

    On an error or interrupt nothing new is begun, and what runs is waited for; `hurry` is called meanwhile, again and
    again, to end what would take long.
    """

    def __init__(self, jobs: int, hurry: Callable[[], object] = lambda: None) -> None:
        self.jobs = jobs
        self._hurry = hurry
        self._pool: ThreadPoolExecutor | None = None
        self._lock = threading.Lock()
        self._running = 0
        self._over = False

    def __enter__(self) -> Threads:
        self._pool = ThreadPoolExecutor(max_workers=self.jobs, thread_name_prefix="lidarcheck")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._pool is not None
        if kind is not None:
            # Neither futures nor the pool tell what still runs: an interrupt may come after a task was begun and before
            # its future, or the thread that does it, was kept.
            with self._lock:
                self._over = True
            end = {"wait": True, "cancel_futures": True}
            ending = threading.Thread(target=self._pool.shutdown, kwargs=end)
            ending.start()
            while ending.is_alive() or self._running:
                self._hurry()
                time.sleep(0.05)
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _begin(self, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> Future[Any]:
        assert self._pool is not None
        [task] = tasks
        return self._pool.submit(self._perform, work, things_of(task))

    def _perform(self, work: Callable[..., Any], things: tuple[Any, ...]) -> Any:
        """Do a task, in a thread, unless all is over; it counts as running meanwhile."""
        with self._lock:
            if self._over:
                return None
            self._running += 1
        try:
            return work(*things)
        finally:
            with self._lock:
                self._running -= 1

    def _collect(self, waiting: deque[Future[Any]]) -> Sequence[Any]:
        result = result_of(waiting[0])
        waiting.popleft()
        return [result]

    def _cancel(self, waiting: deque[Future[Any]]) -> None:
        for future in waiting:
            future.cancel()


@dataclass
class _Batch:
    """Tasks under way in a pool of processes."""

    packed: bytes
    shared: Mapping[str, str]
    pool: ProcessPoolExecutor
    future: Future[Any]


class Processes(AsyncPool[_Batch]):
    """Processes of this machine; with `jobs` 1, or in a worker process, all is done in the caller itself.

    `wake`: a function of a module that each process begins with, to load what every task needs. `least`: fewer
    processes are none; 1 where the caller works beside it.
    """

    def __init__(self, jobs: int = 1, wake: Callable[[], object] | None = None, *, least: int = 2) -> None:
        self.jobs = jobs
        self._least = least
        self._wake = wake
        self._pool: ProcessPoolExecutor | None = None
        self._files: tempfile.TemporaryDirectory[str] | None = None
        self._places: weakref.WeakKeyDictionary[Shared[Any], _Place] = weakref.WeakKeyDictionary()
        self._deaths = 0

    def __enter__(self) -> WorkerPool:
        if self.jobs < self._least or multiprocessing.current_process().daemon:
            return WorkerPool()
        self._files = tempfile.TemporaryDirectory(prefix="lidarcheck-workers-", ignore_cleanup_errors=True)
        self._start()
        if self._wake is not None:
            self._running.submit(_nothing)  # processes begin with the first task
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is not None:
            processes = list((getattr(self._pool, "_processes", None) or {}).values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            self._pool = None
        if self._files is not None:
            self._files.cleanup()

    @property
    def _running(self) -> ProcessPoolExecutor:
        assert self._pool is not None, "the pool was not entered"
        return self._pool

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        assert self._files is not None
        self._pool = ProcessPoolExecutor(
            self.jobs, context, initializer=_as_worker, initargs=(self._wake, given(), self._files.name)
        )

    def _begin(self, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> _Batch:
        shared = {one.key: self._put(one) for one in shared_by(tasks)}
        packed, pool = pack_tasks(work, tasks), self._running
        return _Batch(packed, shared, pool, self._submit(packed, shared))

    def _submit(self, packed: bytes, shared: Mapping[str, str]) -> Future[Any]:
        try:
            return self._running.submit(_call, packed, shared)
        except BrokenProcessPool:
            self._replace(self._running)
            return self._running.submit(_call, packed, shared)

    def _collect(self, waiting: deque[_Batch]) -> Sequence[Any]:
        while True:
            first = waiting[0]
            try:
                results: list[Any] = result_of(first.future)
            except BrokenProcessPool:
                if first.pool is self._pool:
                    self._replace(first.pool)
                for batch in waiting:
                    if batch.pool is not self._pool and not _has_result(batch.future):
                        batch.future, batch.pool = self._submit(batch.packed, batch.shared), self._running
            else:
                self._deaths = 0
                waiting.popleft()
                return results

    def _replace(self, broken: ProcessPoolExecutor) -> None:
        """New processes for those of which one has died."""
        self._deaths += 1
        if self._deaths >= _MOST_DEATHS:
            raise WorkerError(
                f"worker processes were killed {_MOST_DEATHS} times in the same work",
                fix="was memory short? use fewer --jobs",
            )
        broken.shutdown(wait=False, cancel_futures=True)
        self._start()

    def _cancel(self, waiting: deque[_Batch]) -> None:
        for batch in waiting:
            batch.future.cancel()

    def _put(self, shared: Shared[Any]) -> str:
        """Where workers find it, as long as it lives."""
        if shared not in self._places:
            assert self._files is not None
            path = Path(self._files.name) / f"{shared.key}.pickle"
            path.write_bytes(pack_thing(shared))
            self._places[shared] = _Place(path)
        return str(self._places[shared].path)


class _Place:
    """A file that goes with the last who knows it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __del__(self) -> None:
        with contextlib.suppress(OSError):
            self.path.unlink()


def _has_result(future: Future[Any]) -> bool:
    return future.done() and not future.cancelled() and future.exception() is None


def _as_worker(wake: Callable[[], object] | None, permissions: Permissions, files: str) -> None:
    """The process that started the workers ends them and says what there is to say; what it permits, they permit."""
    end_with_parent(files)
    grant(permissions)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    if wake is not None:
        wake()
    limit_blas()


def _nothing() -> None:
    return None


def _call(packed: bytes, shared: Mapping[str, str]) -> list[Any]:
    return perform(packed, lambda key: kept(key, Path(shared[key]).read_bytes))
