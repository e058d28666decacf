"""Fitting effects' parameters to the summaries of some frames."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search import Probe
from lidarcheck.errors import UsageError
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.optimiser import Point, Shows, broyden, damped_step, descend, jacobian_at, normal_equations
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model.spec import Model

__all__ = ["Fit", "fit", "jacobian_of", "with_effects"]


_LEAPS = (6.0, 3.0)
"""How many steps at once numbers are tried larger and smaller where slopes say nothing."""
_DAMPING, _EASED, _STIFFENED = 0.1, 0.3, (10.0, 0.3)
"""The damping at first; its factor after a step that led nearer; its factor and addition after one that did not."""
_TRIES = 3
"""Steps, each damped more, after which slopes lead no nearer."""
_FAR = 0.1
"""A step that led nearer by this part may be too short: summaries are compressed far from the case's own model."""
_SLOW = 0.15
"""Where a round leads no more nearer than that, corrected slopes are taken anew."""
_ENDS, _ENDS_PART = 2.0, 0.004
"""A round that gains less, and less than this part of the distance, with slopes of its own is the last."""


@dataclass(frozen=True)
class Fit:
    """Effects fitted together: their probes, where each stands on its own scale, and how far the model then is.

    `shown` (seeds, n_summaries): what it shows. `jacobian` (n_summaries, n_free): change per step of every free
    parameter, None before a fit has taken it. `nuisance`: how far gain, reflectances and pose are off besides.
    The distance is infinite where no sensor can have what the effects start with.
    """

    probes: tuple[Probe, ...]
    x: tuple[FloatArray, ...]
    distance: float
    shown: FloatArray
    jacobian: FloatArray | None = None
    nuisance: Nuisance = field(default_factory=Nuisance)

    def effects(self) -> list[Effect]:
        """The configured effects."""
        return [probe.effect(x) for probe, x in zip(self.probes, self.x, strict=True)]

    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(probe.name for probe in self.probes)

    @property
    def possible(self) -> bool:
        """Whether there is a sensor with these effects."""
        return bool(np.isfinite(self.distance))

    def model(self, model: Model) -> Model:
        """The model with the effects in their places."""
        return with_effects(model, self.probes, self.x)


def fit(
    simulator: Simulator,
    probes: Sequence[Probe],
    x: Sequence[FloatArray],
    *,
    rounds: int = 3,
    nuisance: Nuisance | None = None,
    model: Model | None = None,
    leaps: bool = False,
    slopes: FloatArray | None = None,
) -> Fit:
    """Fit all free parameters of some effects at once, from where they stand; the nuisance stays as it is.

    `model`: what the effects are added to, the simulator's own where None. `leaps`: also search by trying, where a
    model that strikes at random has no slopes. `slopes`: a Jacobian from near by, to begin with.
    """
    nuisance = nuisance or Nuisance()
    shows = _shown_by(simulator, model or simulator.model, probes, x, nuisance)
    start = np.concatenate([*x]) if len(x) else np.zeros(0)
    shown = shows(start, simulator.seeds)
    if shown is None:
        nothing = np.zeros((1, len(simulator.measured)))
        return Fit(tuple(probes), _split(start, x), np.inf, nothing, None, nuisance)
    descent = _EffectDescent(simulator, shows, slopes)
    begin = Point(start, shown, simulator.distance(shown), np.zeros(len(start)))
    end = descend(descent, begin, rounds if len(start) else 0)
    at, shown = end.x, end.shown
    if simulator.varies(shown):
        again = shows(at)
        assert again is not None, "a sensor that was simulated is one"
        at, shown = _climb(simulator, shows, at, again) if leaps else (at, again)
    return Fit(tuple(probes), _split(at, x), simulator.distance(shown), shown, descent.jacobian, nuisance)


def _split(flat: FloatArray, like: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """The numbers of all effects, effect by effect."""
    ends = np.cumsum([0, *(len(x) for x in like)])
    return tuple(flat[a:b] for a, b in itertools.pairwise(ends))


def _shown_by(
    simulator: Simulator, model: Model, probes: Sequence[Probe], like: Sequence[FloatArray], nuisance: Nuisance
) -> Shows:
    """What a model with effects shows where their numbers are so; None where no sensor or effect has such numbers."""

    def shows(flat: FloatArray, seeds: int | None = None) -> FloatArray | None:
        try:
            return simulator.shows(with_effects(model, probes, _split(flat, like)), seeds, nuisance=nuisance)
        except UsageError:
            return None

    return shows


class _EffectDescent:
    """Towards the measurement in the numbers of effects.

    A Jacobian takes a simulation or more for each number: between rounds it is only corrected by what a step has
    changed, and taken anew where that leads no further. `jacobian`: the last one, None where there is none.
    """

    worth_doubling = _FAR

    def __init__(self, simulator: Simulator, shows: Shows, jacobian: FloatArray | None) -> None:
        self.simulator, self.shows, self.jacobian = simulator, shows, jacobian
        self._damping, self._own_slopes = _DAMPING, False

    def look(self, now: Point, step: FloatArray) -> Point | None:
        """See `Objective.look`."""
        x = now.x + step
        shown = self.shows(x, self.simulator.seeds)
        return None if shown is None else Point(x, shown, self.simulator.distance(shown), step)

    def steps(self, now: Point) -> Iterator[FloatArray]:
        """Steps that are damped the more the less they lead."""
        if self.jacobian is None:
            self.jacobian, self._own_slopes = jacobian_at(self.shows, now.x, now.shown), True
        residual = self.simulator.measured - now.shown.mean(axis=0)
        curvature, slope = normal_equations(self.simulator.metric, self.jacobian, residual)
        for _ in range(_TRIES):
            yield damped_step(curvature, slope, self._damping)
            self._damping = self._damping * _STIFFENED[0] + _STIFFENED[1]

    def settled(self, before: Point, now: Point) -> bool:
        """Correct the Jacobian; the end is where one that was taken here leads hardly nearer."""
        if now is not before:
            assert self.jacobian is not None
            self._damping *= _EASED
            change = now.shown.mean(axis=0) - before.shown.mean(axis=0)
            self.jacobian = broyden(self.jacobian, now.step, change)
        gained, own = before.distance - now.distance, self._own_slopes
        if own and gained < max(_ENDS, _ENDS_PART * before.distance):
            return True
        if not own and gained < _SLOW * before.distance:
            self.jacobian, self._damping = None, _DAMPING
        self._own_slopes = False
        return False


def _climb(simulator: Simulator, shows: Shows, at: FloatArray, shown: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What strikes at random moves no mean, and so has no slope to go down: try each number larger and smaller."""
    best = simulator.distance(shown)
    for length in _LEAPS:
        for j in range(len(at)):
            for way in (length, -length):
                there = at.copy()
                there[j] += way
                other = shows(there)
                if other is not None and (distance := simulator.distance(other)) < best:
                    at, shown, best = there, other, distance
                    break
    return at, shown


def with_effects(model: Model, probes: Sequence[Probe], x: Sequence[FloatArray]) -> Model:
    """The model with effects at points of their fits' scales."""
    for probe, at_x in zip(probes, x, strict=True):
        model = model.with_(probe.effect(at_x))
    return model


def jacobian_of(simulator: Simulator, now: Fit) -> FloatArray:
    """Change of the summaries per step of every free parameter where a fit stands, (n_summaries, n_free)."""
    shows = _shown_by(simulator, simulator.model, now.probes, now.x, now.nuisance)
    return jacobian_at(shows, np.concatenate([*now.x]), now.shown)
