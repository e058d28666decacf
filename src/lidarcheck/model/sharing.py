"""Work on rows of a frame, chunk by chunk, shared among threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from lidarcheck.workers.cores import usable_cores

__all__ = ["Progress", "Share", "serially", "share"]

Progress = Callable[[int, int], object]
"""Is called with (beams done, beams)."""

Share = Callable[[Callable[[int], None], range], None]
"""Calls a function with each of the starts of chunks, which do not depend on each other."""


def serially(run: Callable[[int], None], starts: range) -> None:
    """A `Share` without further threads."""
    for start in starts:
        run(start)


def share(
    run: Callable[[int], None], starts: range, threads: int | None, on_done: Callable[[int], object] | None = None
) -> None:
    """Run the chunks, on several threads where that helps; `on_done` hears how many are done."""
    on_progress = on_done or (lambda done: None)
    workers = min(threads or usable_cores(), len(starts))
    if workers <= 1:
        for done, start in enumerate(starts, start=1):
            run(start)
            on_progress(done)
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            for done, _ in enumerate(pool.map(run, starts), start=1):
                on_progress(done)
        except BaseException:
            # An interrupt waits for the chunks that are under way, not for those that have not begun.
            pool.shutdown(wait=False, cancel_futures=True)
            raise
