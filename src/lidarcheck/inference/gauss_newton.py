"""Fitting an effect's parameters: damped Gauss-Newton on summaries, with common random numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Effect
from lidarcheck.errors import UsageError
from lidarcheck.explain.search.starts import Probe
from lidarcheck.inference.nuisances import LIMIT, Nuisance, at, axes_of
from lidarcheck.inference.simulator import Metric, Simulator
from lidarcheck.model.spec import Model
from lidarcheck.workers.threads import mapped

__all__ = ["Fit", "fit", "fit_nuisance", "jacobian_of", "with_effects"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
Shows = Callable[..., FloatArray | None]

_CLEAR = 3.0
_LEAPS = (6.0, 3.0)
"""How many steps at once numbers are tried larger and smaller where slopes say nothing."""
_FAR, _DOUBLED = 0.1, 3
"""A step that led so much nearer may be too short, and is doubled up to so often."""
_SLOW = 0.15
"""Where a round leads no more nearer than that, corrected slopes are taken anew."""
_FLIPS = 0.7
"""So much a summary changes when single beams' echoes come out otherwise."""


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

    `model`: what the effects are added to, the lab's own where None. `leaps`: also search by trying, where a model that
    strikes at random has no slopes. `slopes`: a Jacobian from near by, to begin with.
    """
    nuisance, basis = nuisance or Nuisance(), model or simulator.model
    ends = np.cumsum([0, *(len(probe.free) for probe in probes)])

    def parts(flat: FloatArray) -> tuple[FloatArray, ...]:
        return tuple(flat[a:b] for a, b in itertools.pairwise(ends))

    def shows(flat: FloatArray, seeds: int | None = None) -> FloatArray | None:
        try:
            return simulator.shows(with_effects(basis, probes, parts(flat)), seeds, nuisance=nuisance)
        except UsageError:
            return None  # no sensor or no effect has such numbers

    start = np.concatenate([*x]) if len(x) else np.zeros(0)
    end, shown, jacobian = _descend(simulator, shows, start, rounds, slopes)
    if shown is not None and simulator.varies(shown):
        shown = shows(end)
        if leaps and shown is not None:
            end, shown = _climb(simulator, shows, end, shown)
    distance = np.inf if shown is None else simulator.distance(shown)
    nothing = np.zeros((1, len(simulator.measured)))
    return Fit(tuple(probes), parts(end), distance, nothing if shown is None else shown, jacobian, nuisance)


def with_effects(model: Model, probes: Sequence[Probe], x: Sequence[FloatArray]) -> Model:
    """The model with effects at points of their fits' scales."""
    for probe, at_x in zip(probes, x, strict=True):
        model = model.with_(probe.effect(at_x))
    return model


def fit_nuisance(simulator: Simulator, now: Fit, *, rounds: int = 2) -> Fit:
    """Fit gain, reflectances and pose within their limits, the effects as they are; a usual error costs 1."""
    now = _taken_over(now)
    effects = now.effects()
    axes = axes_of([int(i) for i in np.unique(simulator.beams.material_id) if i >= 0], effects)
    gain = all(effect.name != "signal_gain" for effect in effects)
    model = now.model(simulator.model)

    def shows(x: FloatArray, seeds: int | None = None) -> FloatArray:
        return simulator.shows(model, seeds, nuisance=at(axes, x, gain=gain))

    x = np.zeros(len(axes))
    shown = shows(x)
    best = simulator.distance(shown, metric=simulator.bare)
    # What is not looked at is left out of the covariance too: given all the rest, these alone would say little.
    rows = _where_seen(simulator, axes)
    metric = Metric(simulator.bare.diagonal[rows], simulator.bare.factors[rows])
    # No longer steps: the limits would cut them. Once, since such small errors act in proportion.
    jacobian = _jacobian(shows, x, shown, (1.0, -1.0))[rows]

    def tried(trial: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        there = shows(trial)
        return trial, there, simulator.distance(there, metric=simulator.bare) + at(axes, trial, gain=gain).penalty

    for _ in range(rounds):
        curvature, slope = _slopes(metric, jacobian, (simulator.measured - shown.mean(axis=0))[rows])
        for damping in (1.0, 3.0, 10.0):
            step = _step(curvature + damping * np.eye(len(x)), slope - x, 0.05)
            found = tried(np.clip(x + step, -LIMIT, LIMIT))
            if found[2] < best:
                found = _farther_off(tried, x, found)
                x, shown, best = found
                break
        else:
            break
    return replace(now, distance=simulator.distance(shown), shown=shown, nuisance=at(axes, x, gain=gain))


def _taken_over(now: Fit) -> Fit:
    """The fit with what its nuisances said of a gain, a reflectance or the pose in the effects of the same: those have
    no such nuisance beside them any more."""
    moved = []
    for probe, x, effect in zip(now.probes, now.x, now.effects(), strict=True):
        moved.append(x + np.array([now.nuisance.said_by(effect, one.name) / one.step for one in probe.free]))
    return replace(now, x=tuple(moved))


def _farther_off(
    tried: Callable[[FloatArray], tuple[FloatArray, FloatArray, float]],
    x: FloatArray,
    found: tuple[FloatArray, FloatArray, float],
) -> tuple[FloatArray, FloatArray, float]:
    """The step of the nuisances that led nearer, doubled while that leads nearer still: slopes by single flips, and
    those far off, promise too much of it."""
    for _ in range(_DOUBLED):
        longer = tried(np.clip(2.0 * found[0] - x, -LIMIT, LIMIT))
        if longer[2] >= found[2]:
            break
        found = longer
    return found


def _where_seen(simulator: Simulator, axes: Sequence[str | int]) -> IndexArray:
    """The numbers of the summaries by which a nuisance is judged: ranges along slopes, and all of each material.

    All others change by little but chance, of which a thousand together would drown what a small error does. Of these
    each axis counts in all: a pose moves the ranges of a material, which its reflectance must not make up for.
    """
    materials = {simulator.model.materials[axis].name or f"material {axis}" for axis in axes if isinstance(axis, int)}
    slopes = {f"range along {way}" for axis, way in (("yaw", "azimuth"), ("pitch", "elevation")) if axis in axes}
    ranges = ("range", "field of view")

    def counts(feature: str, covariate: str, bin_: str) -> bool:
        if covariate == "material":
            return bin_ in materials
        return feature in slopes or (bool(slopes) and (feature, covariate) == ranges)

    return np.flatnonzero([counts(one.feature, one.covariate, one.bin) for one in simulator.summaries.names])


def _descend(
    simulator: Simulator, shows: Shows, at: FloatArray, rounds: int, jacobian: FloatArray | None = None
) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
    """Where it ends, what is shown there, and the last Jacobian; nothing is shown where the start is impossible.

    A Jacobian takes a simulation or more for each number: between rounds it is only corrected by what a step has
    changed (Broyden 1965), and taken anew where that leads no further.
    """
    shown = shows(at, simulator.seeds)
    if shown is None:
        return at, None, None
    best, damping, taken = simulator.distance(shown), 0.1, False
    for _ in range(rounds if len(at) else 0):
        if jacobian is None:
            jacobian, taken = _jacobian(shows, at, shown), True
        before = best
        step, there, best, damping = _stepped(simulator, shows, (at, shown, best), jacobian, damping)
        if there is not None:
            change = _clear(there.mean(axis=0) - shown.mean(axis=0) - jacobian @ step)
            jacobian = jacobian + np.outer(change, step) / max(float(step @ step), 1e-12)
            at, shown = at + step, there
        if before - best < max(2.0, 0.004 * before) and taken:
            break
        if before - best < _SLOW * before and not taken:
            jacobian, damping = None, 0.1
        taken = False
    return at, shown, jacobian


def _stepped(
    simulator: Simulator, shows: Shows, now: tuple[FloatArray, FloatArray, float], jacobian: FloatArray, damping: float
) -> tuple[FloatArray, FloatArray | None, float, float]:
    """The first step that leads nearer, what is shown there, None without such a step; the distance and the damping."""
    at, shown, best = now
    curvature, slope = _slopes(simulator.metric, jacobian, simulator.measured - shown.mean(axis=0))
    for _ in range(3):
        step = _step(curvature, slope, damping)
        trial = shows(at + step, simulator.seeds)
        distance = np.inf if trial is None else simulator.distance(trial)
        if trial is not None and distance < best:
            if best - distance > _FAR * best:
                step, trial, distance = _farther(simulator, shows, at, (step, trial, distance))
            return step, trial, distance, damping * 0.3
        damping = damping * 10.0 + 0.3
    return np.zeros(len(at)), None, best, damping


def _farther(
    simulator: Simulator, shows: Shows, at: FloatArray, found: tuple[FloatArray, FloatArray, float]
) -> tuple[FloatArray, FloatArray, float]:
    """The step that led nearer, doubled while that leads nearer still: summaries are compressed far from the lab's
    model, and slopes taken near it promise too much of a step."""
    step, shown, best = found
    for _ in range(_DOUBLED):
        there = shows(at + 2.0 * step, simulator.seeds)
        distance = np.inf if there is None else simulator.distance(there)
        if there is None or distance >= best:
            break
        step, shown, best = 2.0 * step, there, distance
    return step, shown, best


def _clear(change: FloatArray) -> FloatArray:
    """A change without what single beams make that flip."""
    return np.where(np.abs(change) > _FLIPS, change, 0.0)


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


def _slopes(metric: Metric, jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J' C^-1 J and J' C^-1 r, for `jacobian` (n_summaries, p) and `residual` (n_summaries,)."""
    weighted = metric.times(jacobian)
    return jacobian.T @ weighted, weighted.T @ residual


def _step(curvature: FloatArray, slope: FloatArray, damping: float) -> FloatArray:
    """A damped step; directions in which the curvature drowns in noise are left as they are."""
    diagonal = np.maximum(np.diag(curvature), 0.0)
    damped = 0.5 * (curvature + curvature.T) + np.diag(damping * diagonal + 0.5)
    values, vectors = np.linalg.eigh(damped)
    values = np.maximum(values, 0.5)
    return np.asarray(np.clip(vectors @ ((vectors.T @ slope) / values), -7.0, 7.0))


def _jacobian(
    shows: Shows, at: FloatArray, shown: FloatArray, lengths: Sequence[float] = (1.0, -1.0, 4.0, 16.0)
) -> FloatArray:
    """Change of the summaries per step with the first seed, shape (n_summaries, p).

    One beam that flips makes small steps useless: where a step changes little, a longer one is taken, and what is no
    larger than such flips is taken for chance.
    """
    columns = mapped(lambda j: _column(shows, at, shown, j, lengths), range(len(at)))
    return np.array(columns).T.reshape(shown.shape[1], len(at)).copy()


def _column(shows: Shows, at: FloatArray, shown: FloatArray, j: int, lengths: Sequence[float]) -> FloatArray:
    """Change of the summaries per step of the j-th number, shape (n_summaries,)."""
    found = np.zeros(shown.shape[1])
    for length in lengths:
        there = at.copy()
        there[j] += length
        other = shows(there, 1)
        if other is None:
            continue
        change = other[0] - shown[0]
        found = _clear(change) / length
        if np.abs(change).max(initial=0.0) > _CLEAR:
            break
    return found


def jacobian_of(simulator: Simulator, now: Fit) -> FloatArray:
    """Change of the summaries per step of every free parameter where a fit stands, (n_summaries, n_free)."""
    ends = np.cumsum([0, *(len(x) for x in now.x)])

    def shows(flat: FloatArray, seeds: int | None = None) -> FloatArray | None:
        x = tuple(flat[a:b] for a, b in itertools.pairwise(ends))
        try:
            return simulator.shows(with_effects(simulator.model, now.probes, x), seeds, nuisance=now.nuisance)
        except UsageError:
            return None

    return _jacobian(shows, np.concatenate([*now.x]), now.shown)
