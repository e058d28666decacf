"""Work on several cores: independent tasks over processes that all hold the same things.

Workers are started afresh and not forked, since the caller may have threads (a progress bar, a terminal interface).
"""

from __future__ import annotations

import contextlib
import multiprocessing
import pickle
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

__all__ = ["Crew"]

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_Shared = TypeVar("_Shared")
_held: tuple[str, Any] = ("", None)
"""What this worker holds, and the file that it comes from."""


class Crew:
    """`jobs` processes side by side; a context manager. Results come in the order of the items, for any `jobs`.

    `wake`: a function of a module that each process begins with, to load what every task needs.
    """

    def __init__(self, jobs: int = 1, wake: Callable[[], object] | None = None) -> None:
        self.jobs = jobs
        self._wake = wake
        self._pool: ProcessPoolExecutor | None = None
        self._files: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    def __enter__(self) -> Crew:
        if self.jobs > 1 and not multiprocessing.current_process().daemon:
            context = multiprocessing.get_context("spawn")
            self._files = tempfile.TemporaryDirectory(prefix="lidarcheck-crew-", ignore_cleanup_errors=True)
            self._pool = ProcessPoolExecutor(self.jobs, mp_context=context, initializer=_as_worker)
            if self._wake is not None:
                for _ in range(self.jobs):
                    self._pool.submit(self._wake)
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

    def map(
        self, work: Callable[[_Shared, _Item], _Result], shared: _Shared, items: Sequence[_Item]
    ) -> Iterator[_Result]:
        """`work(shared, item)` for every item; `work` is a function of a module, and all can be pickled."""
        if self._pool is None or len(items) < 2:
            for item in items:
                yield work(shared, item)
            return
        place = self._put(shared)
        futures = [self._pool.submit(_call, work, place, item) for item in items]
        try:
            for future in futures:
                yield future.result()
        finally:
            for future in futures:
                future.cancel()
            with contextlib.suppress(OSError):
                Path(place).unlink()

    def beside(self, work: Callable[..., _Result], *arguments: Any) -> Callable[[], _Result]:
        """Begin work in another process, or leave it for later; the result when it is called."""
        if self._pool is None:
            return lambda: work(*arguments)
        future: Future[_Result] = self._pool.submit(work, *arguments)
        return future.result

    def _put(self, shared: Any) -> str:
        assert self._files is not None
        self._count += 1
        place = Path(self._files.name) / f"{self._count}.pickle"
        place.write_bytes(pickle.dumps(shared, protocol=pickle.HIGHEST_PROTOCOL))
        return str(place)


def _as_worker() -> None:
    """The process that started the workers ends them and says what there is to say."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")


def _call(work: Callable[[Any, Any], Any], place: str, item: Any) -> Any:
    global _held
    if _held[0] != place:
        _held = (place, pickle.loads(Path(place).read_bytes()))  # written by the parent just now
    return work(_held[1], item)
