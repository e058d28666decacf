"""The number, as a process that stays up computes it; what it may use again is held here, by content."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from lidarcheck.calibration.blooming.workflow import bare_of
from lidarcheck.calibration.number.frames import Frames, key_of_files, read_frames
from lidarcheck.calibration.number.memo import Memo
from lidarcheck.calibration.number.models import edited_model, said_of
from lidarcheck.calibration.number.number import Number
from lidarcheck.calibration.number.prepared import OnFrames
from lidarcheck.calibration.number.request import SAMPLE_SEEDS, WHOLE_SEEDS, Request
from lidarcheck.model.spec import Model

__all__ = ["expected", "sample", "whole"]

ProgressCallback = Callable[[int, int, str], object]

_FRAMES: Memo[Frames] = Memo(12)
_PREPARED: Memo[OnFrames] = Memo(12)
_NUMBERS: Memo[Number] = Memo(200)
_FIRST = 9500
"""Where the seeds begin: no fit uses any of them."""


def _ignore(_done: int, _of: int, _now: str) -> None:
    """Nobody listens."""


def expected(request: Request, progress: ProgressCallback = _ignore) -> Number | None:
    """The number without noise, without a simulation; None where nothing can be expected without one."""
    return None


def sample(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number of the sample: of a table every line with a bright beam, of all else columns spread over the frame.

    `progress` hears (seeds done, of, what) and may raise to stop it, between seeds.
    """
    start = time.monotonic()
    model = edited_model(request)
    found = _misfit(request, model, progress)
    return replace(found, seconds=time.monotonic() - start)


def whole(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number of whole frames, for a report: `WHOLE_SEEDS` where the request leaves the sample's."""
    seeds = WHOLE_SEEDS if request.seeds == SAMPLE_SEEDS else request.seeds
    return sample(replace(request, seeds=seeds), progress)


def _misfit(request: Request, model: Model, progress: ProgressCallback) -> Number:
    prepared = _prepared(request, model)
    seeds = [(request.seed << 16) + _FIRST + k for k in range(request.seeds)]

    def make() -> Number:
        shown, seen = prepared.shown(model, seeds), []
        for k in range(len(seeds)):
            progress(k, len(seeds), "seeds")
            seen.append(shown.seen(k))
        words = f"{len(prepared.beside):,} beams x {len(seeds)}".replace(",", " ")
        return prepared.misfit.number(seen, simulated=shown.alike, sample=words)

    return _NUMBERS.get((prepared.misfit.scale, said_of(model), *seeds), make)


def _prepared(request: Request, model: Model) -> OnFrames:
    key = key_of_files((*request.measured, *request.ideal), request.placement, repr(model.sensor.beams), model.sensor)
    about = (request.axis, request.distance_m, request.material)

    def read() -> Frames:
        return read_frames(request, model.sensor, key)

    bare, bright = bare_of(model, request.axis)
    return _PREPARED.get(
        (key, about, said_of(bare), bright), lambda: OnFrames.of(_FRAMES.get(key, read), model, request)
    )
