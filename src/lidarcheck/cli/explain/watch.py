"""Progress of work with named steps: which one, how far, how long so far, how long still."""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.terminal import complain, note
from lidarcheck.formats.table import clock_text

if TYPE_CHECKING:
    from lidarcheck.explain.report.explanation import SearchStep

__all__ = ["JsonLines", "Pace", "clock_text", "watched"]

_SAYABLE = 0.02
"""Share of the work from which on its pace says something about the rest."""
_EVERY_S = 0.2
_AT_ONCE_S = 0.5
"""What is there so soon was done by an earlier run, and says nothing about the pace of this one."""


class Pace:
    """How far the work is and how long it still takes, from the share of the whole that each step usually takes."""

    def __init__(self, shares: Mapping[str, float], clock: Callable[[], float] = time.monotonic) -> None:
        total = sum(shares.values())
        self._shares = {name: share / total for name, share in shares.items()} if total > 0.0 else {}
        self._clock = clock
        self._start = clock()
        self._restored = 0.0
        self.part = 0.0

    def on_progress(self, step: str, done: int, of: int) -> None:
        """The step has done so much; steps come in the order of the shares, and none goes back."""
        if step not in self._shares:
            return
        names = list(self._shares)
        before = sum(self._shares[name] for name in names[: names.index(step)])
        now = before + self._shares[step] * (min(done / of, 1.0) if of > 0 else 0.0)
        self.part = max(self.part, min(now, 1.0))
        if self.elapsed_s < _AT_ONCE_S:
            self._restored = self.part

    @property
    def elapsed_s(self) -> float:
        """Seconds since the work began."""
        return self._clock() - self._start

    @property
    def left_s(self) -> float | None:
        """Seconds that the rest takes at the pace so far; None while too little is done to say."""
        ran = self.part - self._restored
        return self.elapsed_s * (1.0 - self.part) / ran if ran >= _SAYABLE else None

    def left(self) -> str:
        """`about 0:40 left`; empty while too little is done to say."""
        seconds = self.left_s
        return "" if seconds is None else f"about {clock_text(seconds)} left"


class JsonLines:
    """What a program that runs this one is told: lines of JSON on standard error, each with the key `step`.

    A step that is done: `found`, in words. Else how far it is: `done`, `of`, `part` of the whole work, `elapsed_s`,
    `left_s` (null while too little is done to say).
    """

    def __init__(self, shares: Mapping[str, float], *, quiet: bool = False) -> None:
        self._pace = Pace(shares)
        self._quiet = quiet
        self._guard = threading.Lock()
        self._last: tuple[str, float] = ("", -math.inf)
        self._say({"steps": list(shares)})

    def on_progress(self, step: str, done: int, of: int) -> None:
        """How far a step is: its beginning and its end, and in between five times a second at most."""
        with self._guard:
            self._pace.on_progress(step, done, of)
            elapsed = self._pace.elapsed_s
            if done < of and self._last[0] == step and elapsed - self._last[1] < _EVERY_S:
                return
            self._last = (step, elapsed)
            left = self._pace.left_s
            at = {"part": round(self._pace.part, 4), "elapsed_s": round(elapsed, 1)}
            self._say({"step": step, "done": done, "of": of, **at, "left_s": None if left is None else round(left, 1)})

    def on_step(self, step: SearchStep) -> None:
        """What a step has found."""
        with self._guard:
            self._say({"step": step.name, "found": step.words})

    def _say(self, document: Mapping[str, Any]) -> None:
        if not self._quiet:
            complain(json.dumps(document))


@contextlib.contextmanager
def watched(shares: Mapping[str, float], *, quiet: bool = False) -> Iterator[Callable[[str, int, int], None]]:
    """Yield what is told (step, done, of): a bar on a terminal, elsewhere a line for each step that begins."""
    pace = Pace(shares)
    if quiet:
        yield lambda _step, _done, _of: None
    elif not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield _lines(pace)
    else:
        with _bars() as bars:
            yield _moving(pace, bars)


def _lines(pace: Pace) -> Callable[[str, int, int], None]:
    said: set[str] = set()
    guard = threading.Lock()

    def on_progress(step: str, done: int, of: int) -> None:
        with guard:
            pace.on_progress(step, done, of)
            if step not in said:
                said.add(step)
                left = pace.left()
                note(f"{step} ({clock_text(pace.elapsed_s)}{', ' if left else ''}{left})")

    return on_progress


def _moving(pace: Pace, bars: Any) -> Callable[[str, int, int], None]:
    task = bars.add_task("starting", total=None, left="", count="")
    guard = threading.Lock()

    def on_progress(step: str, done: int, of: int) -> None:
        with guard:
            pace.on_progress(step, done, of)
            total = of if of > 0 else None
            count = f"{done}/{of}" if of > 0 else ""
            bars.update(task, description=step, completed=done, total=total, count=count, left=pace.left())

    return on_progress


def _bars() -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    # Twice a second: over a slow line every redraw is paid for.
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(20),
        TextColumn("{task.fields[count]}", markup=False),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}", markup=False),
        console=Console(stderr=True),
        transient=True,
        refresh_per_second=2,
    )
