"""What every worker pool does, and how tasks and what they need are packed for the way to another process."""

from __future__ import annotations

import pickle
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from types import TracebackType
from typing import Any, Generic, NamedTuple, TypeVar

__all__ = ["AsyncPool", "Shared", "WorkerPool", "pack_tasks", "pack_thing", "perform", "shared_by", "things_of"]

_Result = TypeVar("_Result")
_Thing = TypeVar("_Thing")
_Batch = TypeVar("_Batch")


class Shared(Generic[_Thing]):
    """A thing that many tasks need: every worker gets it once, and keeps it while this object lives.

    Among the arguments of a task it stands for the thing itself, which must not change from now on.
    """

    def __init__(self, thing: _Thing) -> None:
        self.thing = thing
        self.key = uuid.uuid4().hex

    def __reduce__(self) -> Any:
        raise TypeError("shared things stand among the arguments of a task, not inside of them")


class _Slot(NamedTuple):
    """Where a shared thing stood among the arguments."""

    key: str


class WorkerPool:
    """Works in the caller itself; a context manager, as all worker pools are. `jobs`: how many tasks run at a time."""

    jobs = 1

    def __enter__(self) -> WorkerPool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def map(self, work: Callable[..., _Result], tasks: Iterable[tuple[Any, ...]]) -> Iterator[_Result]:
        """`work(*task)` for every task, in their order; tasks are taken, and results kept, a few at a time.

        `work` is a function of a module, and all can be pickled. What it raises is raised here.
        """
        for task in tasks:
            yield work(*things_of(task))

    def submit(self, work: Callable[..., _Result], *task: Any) -> Callable[[], _Result]:
        """Begin work elsewhere, or leave it for later; the result when it is called."""
        return lambda: work(*things_of(task))


class AsyncPool(WorkerPool, Generic[_Batch]):
    """A pool whose tasks are begun now and waited for later; a batch is one or some under way."""

    def map(self, work: Callable[..., _Result], tasks: Iterable[tuple[Any, ...]]) -> Iterator[_Result]:
        """See `WorkerPool.map`."""
        waiting: deque[_Batch] = deque()
        source = iter(tasks)
        try:
            while True:
                for tasks in self._batches(source, max(self._most_pending() - len(waiting), 0), self._batch_size(work)):
                    waiting.append(self._begin(work, tasks))
                if not waiting:
                    return
                yield from self._collect(waiting)
        finally:
            self._cancel(waiting)

    def submit(self, work: Callable[..., _Result], *task: Any) -> Callable[[], _Result]:
        """See `WorkerPool.submit`."""
        waiting = deque([self._begin(work, [task])])
        return lambda: next(iter(self._collect(waiting)))

    def _batches(
        self, source: Iterator[tuple[Any, ...]], batches: int, size: int
    ) -> Iterator[Sequence[tuple[Any, ...]]]:
        """The next tasks for so many batches, some together; the last ones so that each worker has some."""
        if size == 1:
            yield from ([task] for task in islice(source, batches))
            return
        tasks = [*islice(source, batches * size)]
        if len(tasks) < batches * size:
            size = min(size, -(-len(tasks) // self.jobs) or 1)
        yield from (tasks[start : start + size] for start in range(0, len(tasks), size))

    def _most_pending(self) -> int:
        """So many batches are begun and not yet taken: some for every worker, so that none waits for the next."""
        return 2 * self.jobs + 2

    def _batch_size(self, work: Callable[..., Any]) -> int:
        """So many tasks make a batch."""
        return 1

    def _begin(self, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> _Batch:
        raise NotImplementedError

    def _collect(self, waiting: deque[_Batch]) -> Sequence[Any]:
        """Wait for the first batch; its results and those that are there behind it, which leave the queue."""
        raise NotImplementedError

    def _cancel(self, waiting: deque[_Batch]) -> None:
        """Nobody waits for these any more."""
        raise NotImplementedError


def things_of(task: tuple[Any, ...]) -> tuple[Any, ...]:
    """The arguments with shared things in their places."""
    return tuple(one.thing if isinstance(one, Shared) else one for one in task)


def pack_tasks(work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> bytes:
    """The tasks without what is shared."""
    slots = [tuple(_Slot(one.key) if isinstance(one, Shared) else one for one in task) for task in tasks]
    return pickle.dumps((work, slots), protocol=pickle.HIGHEST_PROTOCOL)


def shared_by(tasks: Sequence[tuple[Any, ...]]) -> tuple[Shared[Any], ...]:
    """What the tasks hold, each once."""
    return tuple({one.key: one for task in tasks for one in task if isinstance(one, Shared)}.values())


def pack_thing(shared: Shared[Any]) -> bytes:
    """A shared thing as it is sent."""
    return pickle.dumps(shared.thing, protocol=pickle.HIGHEST_PROTOCOL)


def perform(packed: bytes, thing: Callable[[str], Any]) -> list[Any]:
    """Do packed tasks, in the worker; `thing`: what is shared, by its key."""
    work, tasks = pickle.loads(packed)  # written by the process that started this work
    return [work(*(thing(one.key) if isinstance(one, _Slot) else one for one in task)) for task in tasks]
