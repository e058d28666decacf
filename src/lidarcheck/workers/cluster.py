"""Work on a cluster: tasks go to a scheduler of dask, what many of them need goes to each worker once.

The scheduler gives the tasks of a worker that is lost to others. Shared things that were lost with it are sent again,
and the tasks that asked for them are begun again, by this side.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
import uuid
import warnings
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from itertools import takewhile
from types import TracebackType
from typing import Any

from lidarcheck.errors import UsageError, WorkerError
from lidarcheck.workers.address import START, check_reachable
from lidarcheck.workers.base import AsyncPool, Shared, pack_tasks, pack_thing, shared_by
from lidarcheck.workers.identity import identity
from lidarcheck.workers.on_worker import refusal, run_tasks
from lidarcheck.workers.waiting import within

__all__ = ["Cluster"]

_CONNECT_S = 10.0
_ANSWER_S = 60.0
"""So long a scheduler, or a worker that loads lidarcheck for the first time, may take to answer."""
_TRANSFER_S = 600.0
"""So long it may take to send what many tasks need, or to fetch results."""
_CLOSE_S = 5.0
_LOOK_S = 1.0
NO_WORKERS_S = 60.0
"""So long a run waits for workers when all are gone."""
_MOST_BEGUN = 5
"""So often a task is begun whose shared things or whose own result were lost."""
_GATHERED, _LARGEST_BATCH = 8, 64
"""Batches whose results are fetched together, and tasks in one of them."""
_LARGE_BYTES = 1 << 20
"""A task that is larger goes to a worker and not into the scheduler's memory."""


@dataclass(eq=False)
class _Batch:
    """Some tasks under way, so many of the same `work`. `shared`: what they need besides; `begun`: how often."""

    work: Callable[..., Any]
    count: int
    packed: bytes | Shared[bytes]
    shared: tuple[Shared[Any], ...]
    future: Any
    begun: int = 1


class Cluster(AsyncPool[_Batch]):
    """The workers of a scheduler; a context manager. `WorkerError` where it cannot be used, or is lost.

    Leaving it takes this side's tasks back and leaves the cluster running. `batch_s`: short tasks are sent together, as
    many as take about so long; 0: one by one.
    """

    def __init__(self, address: str, batch_s: float = 0.2) -> None:
        self.address = address
        self.jobs = 1
        self.batch_s = batch_s
        self._took_s: dict[Callable[..., Any], float] = {}
        self._client: Any = None
        self._placed: weakref.WeakKeyDictionary[Shared[Any], Any] = weakref.WeakKeyDictionary()
        self._news = threading.Event()
        self._looked_s = 0.0
        self._empty_since_s: float | None = None

    def __enter__(self) -> Cluster:
        self._client = _connected(self.address)
        try:
            self._wait_for_workers()
            self._check_workers()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        self._placed.clear()
        with contextlib.suppress(Exception):
            within(_CLOSE_S, self._client.close, timeout=2)

    def _most_pending(self) -> int:
        return 3 * self.jobs + _GATHERED

    def _wait_for_workers(self) -> None:
        until = time.monotonic() + _CONNECT_S
        self._look()
        while self._empty_since_s is not None:
            if time.monotonic() > until:
                what = f"the scheduler at {self.address} has no workers"
                raise WorkerError(
                    what, fix=f"start some with `dask worker {self.address} --nthreads 1 --nworkers auto`"
                )
            time.sleep(0.1)
            self._look(now=True)

    def _check_workers(self) -> None:
        """Refuse the first worker that would find other numbers."""
        with self._scheduler_there():
            found = within(_ANSWER_S, self._client.run, identity, on_error="return")
        for address, other in sorted(found.items()):
            if words := refusal(other, identity(), address):
                raise words

    def _look(self, *, now: bool = False) -> None:
        """Count the workers, once a second; `WorkerError` where the scheduler is lost, or all workers are for long."""
        at = time.monotonic()
        if self._client.status != "running":
            raise self._lost()
        if not now and at - self._looked_s < _LOOK_S:
            return
        self._looked_s = at
        with self._scheduler_there():
            threads = within(_ANSWER_S, self._client.nthreads)
        self.jobs = max(sum(threads.values()), 1)
        if threads:
            self._empty_since_s = None
            return
        self._empty_since_s = at if self._empty_since_s is None else self._empty_since_s
        if at - self._empty_since_s > NO_WORKERS_S:
            what = f"the scheduler at {self.address} has had no workers for {NO_WORKERS_S:.0f} s"
            raise WorkerError(what, fix="start workers, then run this again")

    @contextlib.contextmanager
    def _scheduler_there(self) -> Iterator[None]:
        """What goes wrong when the scheduler is lost, as one error."""
        try:
            yield
        except TimeoutError as error:
            raise self._silent(error) from error
        except (OSError, CancelledError) as error:
            raise self._lost() from error

    def _silent(self, error: TimeoutError) -> WorkerError:
        what = f"the scheduler at {self.address} does not answer: {error or 'it takes too long'}"
        return WorkerError(what, fix="see whether it still runs, and what its log says")

    def _lost(self) -> WorkerError:
        return WorkerError(f"the scheduler at {self.address} was lost", fix=f"see whether it still runs; else {START}")

    def _batch_size(self, work: Callable[..., Any]) -> int:
        """As many tasks as take `batch_s` by what the last ones of their kind took: each batch has its price."""
        return min(max(int(self.batch_s / max(self._took_s.get(work, self.batch_s), 1e-6)), 1), _LARGEST_BATCH)

    def _begin(self, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> _Batch:
        self._look()
        content, shared = pack_tasks(work, tasks), shared_by(tasks)
        packed = Shared(content) if len(content) > _LARGE_BYTES else content
        return _Batch(work, len(tasks), packed, shared, self._submitted(packed, shared))

    def _submitted(self, packed: bytes | Shared[bytes], shared: Sequence[Shared[Any]]) -> Any:
        things = {one.key: self._place(one) for one in shared}
        body = self._place(packed, raw=True) if isinstance(packed, Shared) else packed
        key = f"lidarcheck-{uuid.uuid4().hex}"
        with self._scheduler_there():
            future = self._client.submit(run_tasks, identity(), body, list(things), list(things.values()), key=key)
        future.add_done_callback(lambda _future: self._news.set())
        return future

    def _place(self, shared: Shared[Any], *, raw: bool = False) -> Any:
        """The future of a shared thing's bytes, which one worker has now and others get from each other."""
        there = self._placed.get(shared)
        if there is None or there.status == "cancelled":
            content = shared.thing if raw else pack_thing(shared)
            key = f"lidarcheck-shared-{shared.key}-{uuid.uuid4().hex}"
            with self._scheduler_there():
                there = within(_TRANSFER_S, self._client.scatter, {key: content}, hash=False)[key]
            self._placed[shared] = there
        return there

    def _collect(self, waiting: deque[_Batch]) -> Sequence[Any]:
        while True:
            self._wait_for(waiting[0].future)
            if waiting[0].future.status == "error":
                raise self._error_of(waiting[0].future)
            there = [*takewhile(lambda batch: batch.future.status == "finished", [*waiting][:_GATHERED])]
            if there:
                with contextlib.suppress(CancelledError, OSError):
                    found = self._gathered([batch.future for batch in there])
                    for batch, (seconds, _) in zip(there, found, strict=True):
                        self._took_s[batch.work] = seconds / batch.count
                        waiting.popleft()
                    return [result for _, results in found for result in results]
            self._look(now=True)  # which tells a lost scheduler from what was lost with a worker
            self._begin_again(waiting)

    def _gathered(self, futures: Sequence[Any]) -> Any:
        try:
            return within(_TRANSFER_S, self._client.gather, futures)
        except TimeoutError as error:
            raise self._silent(error) from error

    def _wait_for(self, future: Any) -> None:
        """Until there is a result, an error, or nothing to wait for any more."""
        while True:
            self._news.clear()
            if future.status not in ("pending", "lost"):
                return
            self._news.wait(_LOOK_S)
            self._look()

    def _begin_again(self, waiting: deque[_Batch]) -> None:
        for batch in waiting:
            if batch.future.status == "cancelled":
                batch.begun += 1
                if batch.begun > _MOST_BEGUN:
                    what = f"what a task needs was lost {_MOST_BEGUN} times with the workers of {self.address}"
                    raise WorkerError(what, fix="see the workers' logs")
                batch.future = self._submitted(batch.packed, batch.shared)

    def _error_of(self, future: Any) -> BaseException:
        """What a task has raised, as its caller would have seen it; what befell a worker, as one line."""
        from distributed.scheduler import KilledWorker

        error = future.exception()
        if isinstance(error, KilledWorker):
            last = getattr(error.last_worker, "address", "") or "a worker"
            what = f"the same task has ended {error.allowed_failures + 1} workers, the last of them {last}"
            return WorkerError(what, fix="was memory short? see the worker's log; give workers more, or fewer of them")
        if isinstance(error, ModuleNotFoundError) or "deserializ" in str(error):
            what = f"the scheduler or a worker of {self.address} cannot load lidarcheck's tasks: {error}"
            return WorkerError(what, fix="start all of them where the same lidarcheck is installed")
        return error if isinstance(error, BaseException) else RuntimeError("a task failed")

    def _cancel(self, waiting: deque[_Batch]) -> None:
        if waiting and self._client.status == "running":
            with contextlib.suppress(Exception):
                within(_CLOSE_S, self._client.cancel, [batch.future for batch in waiting], force=True)


def _connected(address: str) -> Any:
    """A client of dask; `UsageError` without dask, `WorkerError` where nobody answers."""
    try:
        import dask
        import distributed
    except ImportError:
        what = "--scheduler needs dask, which is not installed"
        raise UsageError(what, fix='pip install "lidarcheck[cluster]"') from None
    check_reachable(address)
    _be_quiet()
    settings: Mapping[str, Any] = {"distributed.admin.large-graph-warning-threshold": "1TiB"}
    dask.config.set(settings)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # The library's own time limit ends where the connection is there, and nobody speaks.
            client = distributed.Client
            return within(_CONNECT_S + 1, client, address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise WorkerError(f"no scheduler of dask answers at {address}: {reason}", fix=START) from None


def _be_quiet() -> None:
    """What the libraries would log, lidarcheck says itself, in one line."""
    for name in [*logging.root.manager.loggerDict]:
        if name.partition(".")[0] in ("distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
