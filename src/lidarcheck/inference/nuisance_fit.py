"""Fitting what may be off by a usual error, reflectances and the pose, to the summaries of some frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisances import LIMIT, Nuisance, at, axes_of
from lidarcheck.inference.optimiser import Point, damped_step, descend, jacobian_at, normal_equations
from lidarcheck.inference.simulator import Simulator

__all__ = ["fit_nuisance", "nuisance_spread"]


_DAMPINGS, _DAMPING = (1.0, 3.0, 10.0), 0.05
"""What is added to the curvature, 1 as a usual error costs 1, and by what part it is enlarged."""
_LENGTHS = (1.0, -1.0)
"""Differences for slopes, in usual errors: longer ones the limits would cut."""
_ANEW, _MUCH_NEARER = 3, 0.8
"""How often slopes are taken anew where a descent has ended, as long as each descent comes nearer to this part: of a
summary that stands out by far only the logarithm counts, whose slope is another once it is nearly explained."""


def fit_nuisance(simulator: Simulator, now: Fit, *, rounds: int = 2) -> Fit:
    """Fit gain, reflectances and pose within their limits, the effects as they are; a usual error costs 1."""
    now = _taken_over(now)
    descent = _NuisanceDescent(simulator, now)
    start = descent.start()
    end = descend(descent, start, rounds)
    for _ in range(_ANEW):
        if end.distance > _MUCH_NEARER * start.distance:
            break
        start = descent.start(end.x)
        end = descend(descent, start, rounds)
    return replace(now, distance=simulator.distance(end.shown), shown=end.shown, nuisance=descent.nuisance(end.x))


def nuisance_spread(simulator: Simulator, now: Fit) -> dict[str | int, float]:
    """How sure each nuisance beside a fit's effects is: its standard deviation in its usual errors, at most 1, since a
    usual error is known before; by axis as `axes_of` has them."""
    descent = _NuisanceDescent(simulator, now)
    return dict(zip(descent.axes, descent.spread().tolist(), strict=True))


class _NuisanceDescent:
    """Towards the measurement in the nuisances, each in its usual errors and within its limits.

    Steps are doubled wherever they lead nearer: slopes by single flips, and those far off, promise too much of them.
    Slopes are taken once, since such small errors act in proportion; where much was explained, anew from there.
    """

    worth_doubling = 0.0

    def __init__(self, simulator: Simulator, now: Fit) -> None:
        self.simulator, effects = simulator, now.effects()
        self.axes = axes_of([int(i) for i in np.unique(simulator.beams.material_id) if i >= 0], effects)
        self._gain = all(effect.role != "gain" for effect in effects)
        self._model = now.model(simulator.model)

    def nuisance(self, x: FloatArray) -> Nuisance:
        """The nuisance at a point."""
        return at(self.axes, x, gain=self._gain)

    def start(self, x: FloatArray | None = None) -> Point:
        """A point, where nothing is off without one, and the slopes there.

        What is not looked at is left out of the covariance too: given all the rest, the others alone would say little.
        """
        x = np.zeros(len(self.axes)) if x is None else x
        shown = self._shows(x)
        self._rows = _where_seen(self.simulator, self.axes)
        self._metric: Metric = self.simulator.bare.of_rows(self._rows)
        self._jacobian = jacobian_at(self._shows, x, shown, _LENGTHS)[self._rows]
        return self._point(x, shown, x)

    def _shows(self, x: FloatArray, seeds: int | None = None) -> FloatArray:
        return self.simulator.shows(self._model, seeds, nuisance=self.nuisance(x))

    def spread(self) -> FloatArray:
        """The standard deviation along each axis by the slopes where nothing is off, shape (n_axes,)."""
        self.start()
        curvature, _ = normal_equations(self._metric, self._jacobian, np.zeros(len(self._jacobian)))
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(curvature + np.eye(len(curvature))))))

    def look(self, now: Point, step: FloatArray) -> Point:
        """See `Objective.look`; the distance is with what the nuisances cost."""
        x = np.clip(now.x + step, -LIMIT, LIMIT)
        return self._point(x, self._shows(x), x - now.x)

    def _point(self, x: FloatArray, shown: FloatArray, step: FloatArray) -> Point:
        distance = self.simulator.distance(shown, metric=self.simulator.bare) + self.nuisance(x).penalty
        return Point(x, shown, distance, step)

    def steps(self, now: Point) -> Iterator[FloatArray]:
        """Steps that are damped the more the less they lead."""
        residual = (self.simulator.measured - now.shown.mean(axis=0))[self._rows]
        curvature, slope = normal_equations(self._metric, self._jacobian, residual)
        for damping in _DAMPINGS:
            yield damped_step(curvature + damping * np.eye(len(now.x)), slope - now.x, _DAMPING)

    def settled(self, before: Point, now: Point) -> bool:
        """Where no step leads nearer."""
        return now is before


def _taken_over(now: Fit) -> Fit:
    """The fit with what its nuisances said of a gain, a reflectance or the pose in the effects of the same: those have
    no such nuisance beside them any more."""
    moved = []
    for probe, x, effect in zip(now.probes, now.x, now.effects(), strict=True):
        moved.append(x + np.array([now.nuisance.said_by(effect, one.name) / one.step for one in probe.free]))
    return replace(now, x=tuple(moved))


def _where_seen(simulator: Simulator, axes: Sequence[str | int]) -> IndexArray:
    """The numbers of the summaries by which a nuisance is judged: ranges along slopes, and all of each material.

    All others change by little but chance, of which a thousand together would drown what a small error does. Of these
    each axis counts in all: a pose moves the ranges of a material, which its reflectance must not make up for.
    """
    materials = {simulator.model.materials[axis].name or f"material {axis}" for axis in axes if isinstance(axis, int)}
    slopes = {f"range along {way}" for axis, way in (("yaw", "azimuth"), ("pitch", "elevation")) if axis in axes}
    ranges, moves = ("range", "field of view"), bool(slopes) or "height" in axes

    def counts(feature: str, covariate: str, bin_: str) -> bool:
        if covariate == "material":
            return bin_ in materials
        return feature in slopes or (moves and (feature, covariate) == ranges)

    return np.flatnonzero([counts(one.feature, one.covariate, one.bin) for one in simulator.summaries.names])
