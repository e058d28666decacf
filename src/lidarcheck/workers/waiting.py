"""Waits that an interrupt ends.

A signal that comes in the moment before the main thread waits for a lock is handled only when that wait is over. So no
wait here lasts longer than `_LOOK_S`, and what takes longer is waited for again.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any, TypeVar

__all__ = ["as_they_end", "result_of", "within"]

_Result = TypeVar("_Result")
_LOOK_S = 0.25


def result_of(future: Future[_Result]) -> _Result:
    """The result when it is there. What the work raised is raised here."""
    while not future.done():
        wait([future], timeout=_LOOK_S)
    return future.result()


def within(seconds: float, call: Callable[..., _Result], *args: Any, **kwargs: Any) -> _Result:
    """What the call gives; `TimeoutError` where it has not ended by then: nobody waits for its thread any more.

    For what has no time limit of its own, as a library that waits for somebody's answer over the network.
    """
    future: Future[_Result] = Future()

    def work() -> None:
        try:
            future.set_result(call(*args, **kwargs))
        except BaseException as error:  # noqa: BLE001 - raised where it is waited for
            future.set_exception(error)

    threading.Thread(target=work, name="within", daemon=True).start()
    until = time.monotonic() + seconds
    while not future.done():
        left = until - time.monotonic()
        if left <= 0:
            raise TimeoutError(f"no answer within {seconds:g} s")
        wait([future], timeout=min(_LOOK_S, left))
    return future.result()


def as_they_end(futures: Collection[Future[_Result]]) -> Iterator[_Result]:
    """Results in the order in which they come."""
    running = set(futures)
    while running:
        ended, running = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
        for future in ended:
            yield future.result()
