"""Waits that an interrupt ends.

A signal that comes in the moment before the main thread waits for a lock is handled only when that wait is over. So no
wait here lasts longer than `_LOOK_S`, and what takes longer is waited for again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TypeVar

__all__ = ["as_they_end", "result_of"]

_Result = TypeVar("_Result")
_LOOK_S = 0.25


def result_of(future: Future[_Result]) -> _Result:
    """The result when it is there. What the work raised is raised here."""
    while not future.done():
        wait([future], timeout=_LOOK_S)
    return future.result()


def as_they_end(futures: Collection[Future[_Result]]) -> Iterator[_Result]:
    """Results in the order in which they come."""
    running = set(futures)
    while running:
        ended, running = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
        for future in ended:
            yield future.result()
