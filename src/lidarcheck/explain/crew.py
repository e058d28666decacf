"""Work on several cores, and work that is kept: independent tasks over processes, results in a notebook."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from lidarcheck.explain.notebook import Notebook

__all__ = ["Crew"]

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_task: tuple[Callable[[Any], Any], Sequence[Any]] | None = None
"""What forked workers do: they inherit it, so that nothing but numbers and results travels."""


@dataclass(frozen=True)
class Crew:
    """`jobs` processes side by side. Results come in the order of the items, the same for any number of jobs."""

    jobs: int = 1
    notebook: Notebook | None = None

    def map(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> Iterator[_Result]:
        """`work` on every item; workers see what this process holds now."""
        forks = "fork" in multiprocessing.get_all_start_methods()
        if self.jobs <= 1 or len(items) < 2 or not forks or multiprocessing.current_process().daemon:
            yield from map(work, items)
            return
        global _task
        _task = (work, items)
        pool = multiprocessing.get_context("fork").Pool(min(self.jobs, len(items)), _ignore_interrupts)
        try:
            yield from pool.imap(_call, range(len(items)))
        finally:
            pool.terminate()
            pool.join()
            _task = None

    def kept(self, name: str, work: Callable[[], Any]) -> Any:
        """What the notebook has under a name, else what `work` gives, kept there; plain values and arrays only."""
        if self.notebook is None:
            return work()
        found = self.notebook.get(name)
        return self.notebook.put(name, work()) if found is None else found


def _ignore_interrupts() -> None:
    # The process that forked the workers ends them; their tracebacks would say nothing.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _call(i: int) -> Any:
    assert _task is not None
    work, items = _task
    return work(items[i])
