"""`lidarcheck explain --benchmark N`: how often what was hidden is found."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from pathlib import Path

from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import emit, note
from lidarcheck.cli.explain.watch import Pace, watched
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
    quiet: bool,
) -> int:
    """Run `n` cases and print how good the answers are."""
    if json is not None:
        check_writable(json, option="--json")
    if out is not None and not out.is_dir() and (out.exists() or not out.absolute().parent.is_dir()):
        raise InputError("is not a directory that can be made", file=out, fix="name another for --out")
    from lidarcheck.explain.benchmark.run import run_benchmark
    from lidarcheck.explain.benchmark.text import table_text

    try:
        with watched({"benchmark": 1.0}, quiet=quiet) if _moves() else contextlib.nullcontext() as bar:
            on_progress = _lines() if bar is None else _on(bar)
            result = run_benchmark(
                n, seed=seed, only=only, jobs=jobs, generator=generator, out=out, on_progress=on_progress
            )
    except KeyboardInterrupt:
        if out is not None:
            note(f"interrupted: the answers so far are kept in {out}; the same command goes on from there")
        raise
    if json is not None:
        write_result(json, json_text(result.to_dict()))
    if json != "-":
        emit(table_text(result))
    return 0


def _moves() -> bool:
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def _on(bar: Callable[[str, int, int], object]) -> Callable[[int, int, str], None]:
    bar("benchmark", 0, 0)

    def on_progress(done: int, of: int, _words: str) -> None:
        bar("benchmark", done, of)

    return on_progress


def _lines() -> Callable[[int, int, str], None]:
    """A line for each case, with the time left."""
    pace = Pace({"benchmark": 1.0})

    def on_progress(done: int, of: int, words: str) -> None:
        pace.on_progress("benchmark", done, of)
        note(", ".join(part for part in (f"{done} of {of} cases", words, pace.left()) if part))

    return on_progress
