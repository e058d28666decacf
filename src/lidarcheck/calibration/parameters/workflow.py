"""The closed loop: fit, simulate, compare on what was held out, until that improves no longer."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.descent import descend
from lidarcheck.calibration.parameters.fit_data import FitData
from lidarcheck.calibration.parameters.fitted import FitParameter, Fitted
from lidarcheck.calibration.parameters.holdout import is_separable, split_beams, thinned
from lidarcheck.calibration.parameters.intervals import Estimate, estimate
from lidarcheck.calibration.parameters.parameters import (
    added_effects,
    calibrating,
    free_names,
    free_parameters,
    with_fixed,
    with_values,
)
from lidarcheck.calibration.parameters.problem import Problem
from lidarcheck.calibration.parameters.validation import Distance, Validation
from lidarcheck.cases.chance import check_chance
from lidarcheck.errors import UsageError
from lidarcheck.formats.table import counted
from lidarcheck.model.spec import Model
from lidarcheck.workers import Threads, WorkerPool, one_blas_thread

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.workers.checkpoint import Checkpoint

__all__ = ["Calibration", "Request", "Round", "calibrate", "prepared"]


MOST_ROUNDS = 8
"""Rounds unless another number is asked for."""
ROUND_BEAMS, LAST_BEAMS, VALIDATION_BEAMS = 9_000, 40_000, 15_000
"""Beams that take part in a round, in the last fit with its intervals, and in the comparison of a round."""
_STEPS = 3
"""Steps of a round; what is held out is looked at between rounds."""
_SMALL = 0.05
"""A round that moves no parameter by more than this part of its difference has settled."""
_LAST, _NEAR = 4, 3.0
"""The last fit is done again, at most so often, where it moved a parameter by more standard errors."""


@dataclass(frozen=True)
class Request:
    """What is asked for: free parameters by name, and what is said of them. `fixed`: names that are not to be moved,
    each with the value to hold it at or None for the model's own."""

    free: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Round:
    """The state after a round, 0 for the start: the parameters' values by name and the distances of model and
    measurement on the frames that are fitted and on what is held out. `beams`: that took part in the fit. `floor`: what
    two runs of the model at the start are apart."""

    number: int
    values: Mapping[str, float]
    fit: Distance
    held_out: Distance
    beams: int
    floor: float
    seconds: float


@dataclass(frozen=True)
class Calibration:
    """What a calibration found. `model`: the case's with the fitted numbers. `kept`: the round whose numbers these are.

    `floor`: the distance of two runs of that model on what is held out. `samples`: what was held out, feature to name
    ("real", "before", "after") to values. `improved`: whether the model is nearer than before, beyond chance.
    """

    parameters: tuple[Fitted, ...]
    rounds: tuple[Round, ...]
    kept: int
    floor: float
    model: Model
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    misfit: float
    correlation: FloatArray
    samples: Mapping[str, Mapping[str, FloatArray]]
    seed: int
    hashes: Mapping[str, str]

    @property
    def improved(self) -> bool:
        """Whether what is held out is nearer than at the start, beyond chance."""
        return bool(self.rounds[self.kept].held_out.nearer_than(self.rounds[0].held_out))


Progress = Callable[[str], object]
OnRound = Callable[[Round, float | None], object]


def prepared(case: Case, request: Request) -> tuple[Model, tuple[FitParameter, ...], dict[str, str]]:
    """The model where the fit begins, with every effect that is named, the free parameters, and what to say of them."""
    names = [*request.free, *request.fixed]
    model, added = added_effects(case.model, names)
    model = with_fixed(model, {name: value for name, value in request.fixed.items() if value is not None})
    free = free_names(model, request.free, request.fixed)
    parameters = free_parameters(model, free, bounds=request.bounds, starts=request.starts)
    names = [one.name for one in parameters]
    added |= {name: words for name, words in calibrating(model).items() if name in names}
    return with_values(model, {one.name: one.start for one in parameters}), parameters, added


def calibrate(
    case: Case,
    request: Request,
    *,
    seed: int = 0,
    jobs: int = 1,
    pool: WorkerPool | None = None,
    rounds: int = MOST_ROUNDS,
    progress: Progress = lambda _words: None,
    on_round: OnRound = lambda _round, _left_s: None,
    checkpoint: Checkpoint | None = None,
) -> Calibration:
    """Fit the free parameters of a case's model to its frames; the same seed, the same result, whoever works:
    `jobs` threads, or a `pool`.

    `progress` hears what is being done, `on_round` each round and for how long the work goes on at most [s].
    `checkpoint`: rounds that are in it are not done again. `UsageError` and `InputError` for what cannot be fitted.
    """
    model, free, added = prepared(case, request)
    check_chance(case.model, case.frames, case.model_file)
    own = Threads(jobs)
    with one_blas_thread(), own if pool is None else contextlib.nullcontext(pool) as workers:
        data = FitData.of(case.frames, model, seed, workers)
        split = split_beams(data, str(case.directory))
        problem = Problem(split.fit, model, free)
        separable = is_separable(split.fit, problem.model(problem.nearby()))
        stages = [_fewer(split.fit, most, separable) for most in (ROUND_BEAMS, LAST_BEAMS)]
        shown, left_out = (_fewer(one, VALIDATION_BEAMS, separable) for one in (split.fit, split.held_out))
        validation = Validation.of(shown, left_out, model)
        course = _Rounds(problem, validation, stages, rounds, progress, on_round, checkpoint)
        history, x = course.run()
        found, history, kept = course.finish(history, x)
        fitted = with_values(model, {p.name: p.value for p in found.parameters if p.status != "no effect"})
        fitted = fitted if _is_moved(found) else case.model
        progress("what was held out, before and after")
        samples, floor = validation.samples(case.model, fitted), validation.floor(fitted)
    geometry = () if case.geometry.verdict == "ok" else (case.geometry_words,)
    notes = (*geometry, *added.values(), split.words, *_notes(stages, separable), *course.notes)
    return Calibration(
        found.parameters, tuple(history), kept, floor, fitted, found.warnings, notes, found.misfit,
        found.correlation, samples, seed, dict(case.hashes),
    )  # fmt: skip


class _Rounds:
    """The rounds."""

    def __init__(
        self,
        problem: Problem,
        validation: Validation,
        stages: Sequence[FitData],
        rounds: int,
        progress: Progress,
        on_round: OnRound,
        checkpoint: Checkpoint | None,
    ) -> None:
        self.problem, self.validation, self.stages = problem, validation, stages
        self.rounds, self.progress, self.on_round, self.checkpoint = rounds, progress, on_round, checkpoint
        self.notes: list[str] = []
        self.began = time.monotonic()
        self.floor = 0.0

    def run(self) -> tuple[list[Round], FloatArray]:
        """Rounds until what is held out improves no longer; all of them, and where the last one ends."""
        x = self.problem.start()
        history = [self._round(0, x)]
        self.problem.data = self.stages[0]
        for number in range(1, self.rounds + 1):
            before = x
            x = self._fitted(number, x)
            if not self.problem.active().any():
                names = ", ".join(one.name for one in self.problem.free)
                raise UsageError(
                    f"nothing to fit: on these frames no change of {names} changes what the model shows",
                    fix="free other parameters, or measure what shows them",
                )
            history.append(self._round(number, x))
            settled = bool((np.abs(x - before) <= _SMALL * self._widths()).all())
            if not history[-1].held_out.nearer_than(history[-2].held_out) and (settled or number > 1):
                self.notes.append(f"after round {number} what is held out improves no longer")
                break
        else:
            done = f"{counted(self.rounds, 'round')} {'was' if self.rounds == 1 else 'were'} done"
            self.notes.append(f"{done} and what is held out still improves; run more --rounds")
        return history, x

    def finish(self, history: list[Round], x: FloatArray) -> tuple[Estimate, list[Round], int]:
        """The last fit, with all beams that take part. Its numbers are kept; where a round was nearer on what is held
        out, that is said."""
        self.problem.data = self.stages[1]
        for number in range(_LAST):
            self.progress(f"the last fit, with intervals{'' if number == 0 else ', again from where it ended'}")
            self.problem.revive()
            reference = self.problem.data.reference(self.problem.model(x), f"last {number}")
            found = estimate(self.problem, reference, x)
            x = found.x
            if found.moved < _NEAR:
                break
        history = [*history, self._round(len(history), found.x)]
        best = min(history, key=lambda one: one.held_out.value)
        if best.held_out.nearer_than(history[-1].held_out):
            self.notes.append(f"round {best.number} was nearer on what is held out than the last fit, beyond chance")
        return found, history, len(history) - 1

    def _widths(self) -> FloatArray:
        return np.array([self.problem.steps.get(one.name, 1.0) for one in self.problem.free])

    def _fitted(self, number: int, x: FloatArray) -> FloatArray:
        """Where a round ends; from the checkpoint where it was done before."""
        kept = None if self.checkpoint is None else self.checkpoint.get(f"fit {number}")
        if kept is None:
            self.progress(f"round {number}: what the model shows")
            self.problem.revive()
            reference = self.problem.data.reference(self.problem.model(x), f"round {number}")
            there = descend(
                self.problem,
                reference,
                x,
                steps=_STEPS,
                progress=lambda words: self.progress(f"round {number}: {words}"),
            )
            kept = {"x": there.tolist(), "steps": dict(self.problem.steps), "dead": sorted(self.problem.dead)}
            if self.checkpoint is not None:
                self.checkpoint.put(f"fit {number}", kept)
        self.problem.steps, self.problem.dead = dict(kept["steps"]), set(kept["dead"])
        return np.array(kept["x"])

    def _round(self, number: int, x: FloatArray) -> Round:
        """A round as it is shown: compared with fresh seeds."""
        self.progress(f"round {number}: comparing with what is held out" if number else "comparing at the start")
        model = self.problem.model(x)
        fit, out = self.validation.on_fitted(model), self.validation.on_held_out(model)
        seconds = time.monotonic() - self.began
        if number == 0:
            self.floor = self.validation.floor(model)
        beams = int(np.count_nonzero(self.problem.data.used))
        done = Round(number, dict(self.problem.values(x)), fit, out, beams, self.floor, seconds)
        left = None if number == 0 else seconds / number * (self.rounds + 2 - number)
        self.on_round(done, left)
        return done


def _fewer(data: FitData, most: int, separable: bool) -> FitData:
    return thinned(data, most, "thinned") if separable else data


def _is_moved(found: Estimate) -> bool:
    return any(p.status != "no effect" for p in found.parameters)


def _notes(stages: Sequence[FitData], separable: bool) -> list[str]:
    counts = [np.count_nonzero(data.used) for data in stages]
    if not separable:
        return [f"effects look from beam to beam: all {len(stages[1].beams)} beams of the fitted frames are simulated"]
    return [f"{counts[0]} beams take part in a round and {counts[1]} in the last fit, drawn evenly from all materials"]
