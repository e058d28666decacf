"""The number, as a process that stays up computes it; what it may use again is held here, by content."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from lidarcheck.calibration.blooming.csv import is_profile
from lidarcheck.calibration.blooming.workflow import bare_of
from lidarcheck.calibration.number.expectation import expected_means, moved
from lidarcheck.calibration.number.frames import Frames, hash_of, key_of_files, read_frames
from lidarcheck.calibration.number.light import Lights
from lidarcheck.calibration.number.memo import Memo
from lidarcheck.calibration.number.misfit import Means
from lidarcheck.calibration.number.models import check_blooms, edited_model, said_of
from lidarcheck.calibration.number.number import Number
from lidarcheck.calibration.number.prepared import OnFrames
from lidarcheck.calibration.number.profiles import OnProfile
from lidarcheck.calibration.number.request import SAMPLE_SEEDS, WHOLE_SEEDS, Request
from lidarcheck.calibration.number.spread import Spread
from lidarcheck.cases.chance import check_seeds
from lidarcheck.inference.wasserstein import FIRST_GAP, FIRST_GAP_FLOOR, GAP_FLOORS, GAP_SEEDS
from lidarcheck.model.spec import Model
from lidarcheck.reading import read_so_far, reading
from lidarcheck.scan import Scan

__all__ = ["expected", "sample", "whole"]

ProgressCallback = Callable[[int, int, str], object]

_Seen = TypeVar("_Seen")

_FRAMES: Memo[Frames] = Memo(12)
_PREPARED: Memo[OnFrames | OnProfile] = Memo(12)
_SPREAD: Memo[Spread] = Memo(6)
_NUMBERS: Memo[Number] = Memo(400)
_LAST: Memo[tuple[Number, Means, Lights]] = Memo(12)
"""What was simulated last, by the scale of its number: the number, what was seen, and the light."""
_FIRST_MISFIT = 9600
"""Where the seeds of misfits begin: no fit uses any of them."""
_VERIFY = 3
"""What `explain` adds to twice its seed for the frames that verify."""


def _ignore(_done: int, _of: int, _now: str) -> None:
    """Nobody listens."""


def expected(request: Request, progress: ProgressCallback = _ignore) -> Number | None:
    """The number without noise, without a simulation; None where nothing can be expected without one."""
    if request.kind != "misfit":
        return None
    start = time.monotonic()
    model = _blooming_model(request)
    prepared = _prepared(request, model)
    lights = prepared.lights(model, _seeds(request))
    after = expected_means(prepared.misfit, lights)
    if after is None:
        return None
    last, shown, of = _LAST.held(prepared.misfit.scale) or (None, after, lights)
    before = expected_means(prepared.misfit, of)
    means = after if last is None or before is None else moved(shown, before, after)
    floor = float("nan") if last is None else last.floor
    found = prepared.misfit.expected(means, floor=floor, simulated=lights.alike)
    return replace(found, seconds=time.monotonic() - start)


def sample(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number of the sample: of a table every line with a bright beam, of all else columns spread over the frame.

    `progress` hears (seeds done, of, what) and may raise to stop it, between seeds. `InputError` names the file that
    gives no number, and why.
    """
    return _timed(lambda: _misfit(request, progress) if request.kind == "misfit" else _gap(request, progress))


def whole(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number for a report: of a table with `WHOLE_SEEDS`, of all else on all columns, as `explain` measures it."""
    if request.kind == "gap":
        return _timed(lambda: _gap(request, progress, all_columns=True))
    seeds = WHOLE_SEEDS if request.seeds == SAMPLE_SEEDS else request.seeds
    return sample(replace(request, seeds=seeds), progress)


def _timed(compute: Callable[[], Number]) -> Number:
    start = time.monotonic()
    return replace(compute(), seconds=time.monotonic() - start)


def _misfit(request: Request, progress: ProgressCallback) -> Number:
    model = _blooming_model(request)
    prepared = _prepared(request, model)
    seeds = _seeds(request)

    def make() -> Number:
        lights = prepared.lights(model, seeds)
        seen = _all(lights, model, len(seeds), prepared.seen, progress)
        words = _sample_words(len(prepared.beside), len(seeds))
        found = prepared.misfit.number(seen, simulated=lights.alike, sample=words)
        if not request.ideal and isinstance(prepared, OnFrames):
            found = replace(found, about="without an ideal scan its target is where the scan saturates")
        _LAST.put(prepared.misfit.scale, (found, prepared.misfit.means(seen), lights))
        return found

    return _NUMBERS.get((prepared.misfit.scale, said_of(model), *seeds), make)


def _blooming_model(request: Request) -> Model:
    model = edited_model(request)
    check_blooms(model, request.axis)
    return model


def _seeds(request: Request) -> list[int]:
    return [(request.seed << 16) + _FIRST_MISFIT + k for k in range(request.seeds)]


def _gap(request: Request, progress: ProgressCallback, *, all_columns: bool = False) -> Number:
    model = edited_model(request)
    spread = _spread(request, model, all_columns=all_columns)
    first = spread.scale.seed << 16
    seeds = [first + FIRST_GAP + k for k in range(GAP_SEEDS if all_columns else request.seeds)]
    others = [first + FIRST_GAP_FLOOR + k for k in range(GAP_FLOORS if all_columns else 0)]

    def make() -> Number:
        lights = spread.lights(model, [*seeds, *others])
        seen = _all(lights, model, len(seeds) + len(others), spread.seen, progress)
        words = _sample_words(len(spread.scale.beams), len(seeds))
        return spread.number(seen[: len(seeds)], seen[len(seeds) :], simulated=lights.alike, sample=words)

    return _NUMBERS.get((spread.key, said_of(model), *seeds), make)


def _sample_words(beams: int, seeds: int) -> str:
    return f"{beams:,} beams x {seeds}".replace(",", " ")


def _all(
    lights: Lights, model: Model, seeds: int, see: Callable[[Sequence[Scan]], _Seen], progress: ProgressCallback
) -> Sequence[_Seen]:
    """What all seeds show; between them whoever listens may stop it."""
    found: list[_Seen] = []
    first: Sequence[Scan] = ()
    for k in range(seeds):
        progress(k, seeds, "seeds")
        scans = lights.scans(k)
        first = first or scans
        if k == 1:
            check_seeds(model, zip(first, scans, strict=True), model.file)
        found.append(see(scans))
    progress(seeds, seeds, "seeds")
    return found


def _prepared(request: Request, model: Model) -> OnFrames | OnProfile:
    key = _key(request, model)
    bare, bright = bare_of(model, request.axis)
    about = (request.axis, request.distance_m, request.material, bright, said_of(bare))

    def prepare() -> OnFrames | OnProfile:
        if request.measured and is_profile(request.measured[0]):
            return OnProfile.of(model, request, key)
        return OnFrames.of(_frames(request, model, key), model, request)

    return _PREPARED.get((key, about), prepare)


def _spread(request: Request, model: Model, *, all_columns: bool) -> Spread:
    key, start = _key(request, model), _start_of(request, model)
    seed = request.seed if request.case is None else 2 * request.seed + _VERIFY

    def prepare() -> Spread:
        return Spread.of(_frames(request, model, key), start, seed, all_columns=all_columns)

    return _SPREAD.get((key, said_of(start), seed, all_columns), prepare)


def _start_of(request: Request, model: Model) -> Model:
    """The model whose spreads count: that of the session's start, or as it is now where nothing was edited."""
    if request.scale is None and not request.start:
        return model
    now = read_so_far()
    before = {os.path.realpath(path): content for path, content in request.start.items()}
    with reading({**(now.edited if now else {}), **before}):
        return edited_model(replace(request, model=request.scale or request.model))


def _key(request: Request, model: Model) -> str:
    """A hash of the measured files and of how they are read, which no number of the sensor changes."""
    case = () if request.case is None else tuple(sorted(request.case.rglob("*")))
    sensor = model.sensor
    how = (sensor.variant, [feature.name for feature in sensor.features], hash_of(sensor.beams))
    target = (request.kind, request.settings, request.distance_m, request.material, request.axis)
    files = (*request.measured, *request.ideal, *case)
    return key_of_files(files, request.placement, how, () if request.ideal or case else target)


def _frames(request: Request, model: Model, key: str) -> Frames:
    return _FRAMES.get(key, lambda: read_frames(request, model, key))
