"""`lidarcheck explain --benchmark N`: how often what was hidden is found."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from lidarcheck.cli.explain_watch import clock_text
from lidarcheck.cli.outputs import check_writable, json_text, write_result
from lidarcheck.cli.terminal import emit, note, progress
from lidarcheck.errors import InputError

__all__ = ["benchmark"]


def benchmark(
    n: int,
    *,
    seed: int,
    jobs: int,
    json: str | None,
    generator: Path | None,
    only: str | None,
    out: Path | None,
) -> int:
    """Run `n` cases and print how good the answers are."""
    if json is not None:
        check_writable(json, option="--json")
    if out is not None and not out.is_dir() and (out.exists() or not out.absolute().parent.is_dir()):
        raise InputError("is not a directory that can be made", file=out, fix="name another for --out")
    from lidarcheck.explain.benchmark import run_benchmark
    from lidarcheck.explain.benchmark_text import table_text

    try:
        with progress("benchmark") as show:
            tell = show if _watched() else _lines()
            result = run_benchmark(n, seed=seed, only=only, jobs=jobs, generator=generator, out=out, tell=tell)
    except KeyboardInterrupt:
        if out is not None:
            note(f"interrupted: the answers so far are kept in {out}; the same command goes on from there")
        raise
    if json is not None:
        write_result(json, json_text(result.to_dict()))
    if json != "-":
        emit(table_text(result))
    return 0


def _watched() -> bool:
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def _lines() -> Callable[[int, int, str], None]:
    """A line for each case, with the time left."""
    start, first = time.monotonic(), [-1]

    def tell(done: int, of: int, words: str) -> None:
        first[0] = done - 1 if first[0] < 0 else first[0]
        left = (time.monotonic() - start) * (of - done) / (done - first[0])
        note(f"{done} of {of} ({words}), about {clock_text(left)} left")

    return tell
