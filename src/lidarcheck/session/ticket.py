"""A request to the worker process, what became of it, and how that process ended."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing.process
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lidarcheck.session.node import ProgressCallback

__all__ = ["Outcome", "Ticket", "guarded", "how_it_ended"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Outcome:
    """What became of a request: its value, or in `failed` why there is none.

    `seconds`: how long it took; `files`: what it opened, by real path, with size and time then; `taken`: which of the
    edited files it read as they are shown.
    """

    value: Any = None
    failed: str = ""
    seconds: float = 0.0
    files: Mapping[str, tuple[int, int] | None] = field(default_factory=dict)
    taken: frozenset[str] = frozenset()


class Ticket:
    """A request. `live`: its answer is still waited for; once it is not, nothing more is heard of it."""

    def __init__(self, number: int, lane: str, order: tuple[int, int], work: tuple[Any, ...]) -> None:
        self.number, self.lane, self.order, self.work = number, lane, order, work
        self.live = True
        self.deaths = 0
        self.on_progress: ProgressCallback | None = None
        self.on_done: Callable[[Outcome], object] | None = None
        self.on_gone: Callable[[], object] | None = None
        self.told = threading.RLock()  # whoever gives a request up knows that no callback of it runs any more


@contextlib.contextmanager
def guarded() -> Any:
    """A fault in what is told must not take the worker with it."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - see above
        _log.error("internal error in taking an answer, %s: %s", type(error).__name__, error)


def how_it_ended(process: multiprocessing.process.BaseProcess | None) -> str:
    """In words that follow "the worker process"."""
    if process is None:
        return "ended"
    process.join(5.0)
    code = process.exitcode
    if code is None or code >= 0:
        return f"ended with code {code}"
    with contextlib.suppress(ValueError):
        name = signal.Signals(-code).name
        return f"was killed ({name}; was memory short?)" if name == "SIGKILL" else f"was ended by {name}"
    return f"was ended by signal {-code}"
