"""Work of the process that explains, on several threads: most of it is done by kernels, without the interpreter's lock.

Tasks of a worker pool have a process each; what stands between them, such as the fit of what was accepted, has only
this one.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import ContextVar
from typing import Any, TypeVar

from lidarcheck.workers import WorkerPool

__all__ = ["done_by", "in_threads", "mapped"]

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_number: ContextVar[int] = ContextVar("_number", default=1)
"""Threads that share work; 1 in these threads themselves, which do not inherit it."""
_AHEAD = 2
"""Items that are taken before they are needed, for each thread."""


@contextlib.contextmanager
def in_threads(number: int) -> Iterator[None]:
    """Let `mapped` use so many threads while the block runs; not in the processes of a pool and other threads."""
    before = _number.set(number)
    try:
        yield
    finally:
        _number.reset(before)


def done_by(pool: WorkerPool, work: Callable[..., _Result], tasks: Iterable[tuple[Any, ...]]) -> Iterator[_Result]:
    """What `pool.map` gives; a task that stands alone is done here, where threads share it."""
    first = [*tasks]
    return (pool if len(first) > 1 else WorkerPool()).map(work, first)


def mapped(work: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
    """`work` of every item, in their order, which must not depend on each other; items are taken a few at a time.

    What `work` raises is raised here, when what is under way is done.
    """
    number = _number.get()
    if number <= 1:
        return [work(item) for item in items]
    found, waiting = list[_Result](), deque[Future[_Result]]()
    with ThreadPoolExecutor(number) as pool:
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) > _AHEAD * number:
                    found.append(waiting.popleft().result())
            while waiting:
                found.append(waiting.popleft().result())
        finally:
            for one in waiting:
                one.cancel()
    return found
