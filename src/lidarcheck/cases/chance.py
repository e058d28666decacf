"""Whether a model has chance of its own: without, nothing says how far from a measurement one that is right may be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarcheck.cases.frame import Frame
from lidarcheck.errors import InputError
from lidarcheck.model.chain import simulate
from lidarcheck.model.external.probe import echoes_as_rows
from lidarcheck.model.external.reads import seedless
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan

__all__ = ["check_chance", "check_seeds"]


def check_chance(model: Model, frames: Sequence[Frame], file: Path | None) -> None:
    """Refuse somebody else's program that ignores its seed: by what is known of it, else by what it shows of the
    frames with two seeds, whatever its file says. `InputError` names `file`."""
    if model.external is None:
        return
    if seedless(model):
        raise _no_chance(model, file)
    bare = replace(model, effects=())
    check_seeds(model, ([simulate(frame.ideal, bare, seed=k) for k in (1, 2)] for frame in frames), file)


def check_seeds(model: Model, shown: Iterable[Sequence[Scan]], file: Path | None) -> None:
    """Refuse a program of which some frames, each shown with several seeds, are all the same. `InputError` as above."""
    if model.external is None:
        return
    for scans in shown:
        first, *others = (echoes_as_rows(scan) for scan in scans)
        if not all(np.array_equal(first, other) for other in others):
            return
    raise _no_chance(model, file)


def _no_chance(model: Model, file: Path | None) -> InputError:
    assert model.external is not None
    what = "the program ignores its seed: nothing says what chance makes of its echoes, and how much of a gap it is"
    source = (
        "its argument seed" if model.external.module else "the request's seed" if model.external.server else "{seed}"
    )
    fix = f"let it draw its noise from {source}, and name Seed in `reads` of [external] where it has that"
    return InputError(what, file=file, fix=fix)
