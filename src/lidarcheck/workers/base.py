"""What every crew does, and how tasks and what they need are packed for the way to another process."""

from __future__ import annotations

import pickle
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from types import TracebackType
from typing import Any, Generic, NamedTuple, TypeVar

__all__ = ["Remote", "Shared", "WorkerPool", "pack_tasks", "pack_thing", "perform", "shared_by", "things_of"]

_Result = TypeVar("_Result")
_Thing = TypeVar("_Thing")
_Flight = TypeVar("_Flight")


class Shared(Generic[_Thing]):
    """A thing that many tasks need: every worker gets it once, and keeps it while this object lives.

    Among the arguments of a task it stands for the thing itself, which must not change from now on.
    """

    def __init__(self, thing: _Thing) -> None:
        self.thing = thing
        self.key = uuid.uuid4().hex

    def __reduce__(self) -> Any:
        raise TypeError("held things stand among the arguments of a task, not inside of them")


class _Slot(NamedTuple):
    """Where a held thing stood among the arguments."""

    key: str


class WorkerPool:
    """Works in the caller itself. A context manager, as all crews are. `jobs`: tasks that run at the same time."""

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


class Remote(WorkerPool, Generic[_Flight]):
    """A crew whose tasks are begun now and waited for later; a flight is one or some under way."""

    def map(self, work: Callable[..., _Result], tasks: Iterable[tuple[Any, ...]]) -> Iterator[_Result]:
        """See `WorkerPool.map`."""
        waiting: deque[_Flight] = deque()
        source = iter(tasks)
        try:
            while True:
                for tasks in self._dealt(source, max(self._window() - len(waiting), 0), self._together(work)):
                    waiting.append(self._begin(work, tasks))
                if not waiting:
                    return
                yield from self._landed(waiting)
        finally:
            self._give_up(waiting)

    def submit(self, work: Callable[..., _Result], *task: Any) -> Callable[[], _Result]:
        """See `WorkerPool.submit`."""
        waiting = deque([self._begin(work, [task])])
        return lambda: next(iter(self._landed(waiting)))

    def _dealt(
        self, source: Iterator[tuple[Any, ...]], flights: int, together: int
    ) -> Iterator[Sequence[tuple[Any, ...]]]:
        """The next tasks for so many flights, some together; the last ones so that each worker has some."""
        if together == 1:
            yield from ([task] for task in islice(source, flights))
            return
        tasks = [*islice(source, flights * together)]
        if len(tasks) < flights * together:
            together = min(together, -(-len(tasks) // self.jobs) or 1)
        yield from (tasks[start : start + together] for start in range(0, len(tasks), together))

    def _window(self) -> int:
        """So many flights are begun and not yet taken: some for every worker, so that none waits for the next."""
        return 2 * self.jobs + 2

    def _together(self, work: Callable[..., Any]) -> int:
        """So many tasks make a flight."""
        return 1

    def _begin(self, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> _Flight:
        raise NotImplementedError

    def _landed(self, waiting: deque[_Flight]) -> Sequence[Any]:
        """Wait for the first flight; its results and those that are there behind it, which leave the queue."""
        raise NotImplementedError

    def _give_up(self, waiting: deque[_Flight]) -> None:
        """Nobody waits for these any more."""
        raise NotImplementedError


def things_of(task: tuple[Any, ...]) -> tuple[Any, ...]:
    """The arguments with held things in their places."""
    return tuple(one.thing if isinstance(one, Shared) else one for one in task)


def pack_tasks(work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> bytes:
    """The tasks without what is held."""
    slots = [tuple(_Slot(one.key) if isinstance(one, Shared) else one for one in task) for task in tasks]
    return pickle.dumps((work, slots), protocol=pickle.HIGHEST_PROTOCOL)


def shared_by(tasks: Sequence[tuple[Any, ...]]) -> tuple[Shared[Any], ...]:
    """What the tasks hold, each once."""
    return tuple({one.key: one for task in tasks for one in task if isinstance(one, Shared)}.values())


def pack_thing(held: Shared[Any]) -> bytes:
    """A held thing as it is sent."""
    return pickle.dumps(held.thing, protocol=pickle.HIGHEST_PROTOCOL)


def perform(packed: bytes, thing: Callable[[str], Any]) -> list[Any]:
    """Do packed tasks, in the worker; `thing`: what is held, by its key."""
    work, tasks = pickle.loads(packed)  # written by the process that started this work
    return [work(*(thing(one.key) if isinstance(one, _Slot) else one for one in task)) for task in tasks]
