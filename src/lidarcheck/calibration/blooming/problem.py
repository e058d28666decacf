"""The least-squares problem of a blooming table: cells, their light, and how far their echoes are off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.blooming.cells import Cells
from lidarcheck.calibration.blooming.operator import LEAST_Y, Nodes, spread
from lidarcheck.calibration.blooming.pulses import FreeLight, FreePulse
from lidarcheck.calibration.blooming.residuals import (
    detection_residual,
    huber_cost,
    huber_weight,
    smoothness_rows,
    weights,
)
from lidarcheck.calibration.blooming.response import Responses
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import Sensor

__all__ = ["TableProblem"]

_ANCHOR = 0.25
"""Weight of the table that was given, per decade: too little to move what data say, enough to hold what they do not."""

_START_ROUNDS = 60
"""Rounds after which the light of a start no longer changes by a tenth."""
_FENCE = 100.0
"""Weight of leaving the bounds, per decade."""
_STOP = {"gtol": 0.02, "maxiter": 40}


class TableProblem:
    """Parameters are log10 Y of the active nodes, then the log10 of what else is free.

    `matrix`: S of a cell per Y of each active node; `used`: the cells that count; `set_of`: the data set of each.
    """

    def __init__(
        self, cells: Sequence[Cells], nodes: Nodes, sensor: Sensor, *, shape: PulseShape, free: FreeLight
    ) -> None:  # fmt: skip
        self.cells, self.nodes = tuple(cells), nodes
        own = {part.within: FreePulse(sensor, shape, free, part.within) for part in cells}
        self._pulses_of_set = [own[part.within] for part in cells]
        self.pulses = self._pulses_of_set[0]
        matrix = np.concatenate([spread(part, nodes) for part in cells])
        join: Callable[[str], Any] = lambda name: np.concatenate([getattr(part, name) for part in cells])  # noqa: E731
        self.target, self.other, self.value = join("target"), join("other"), join("value")
        self.echoes, self.beams = join("echoes"), join("beams")
        self.set_of = np.repeat(np.arange(len(cells)), [len(part) for part in cells])
        self.used = (matrix.max(axis=1) > 0.0) & ((self.target == 0.0) | free.needs_target)
        self.active = _between(nodes.x, matrix[self.used].max(axis=0, initial=0.0) > 0.0)
        self.matrix = matrix[:, self.active]
        self.fixed = matrix[:, ~self.active] @ nodes.y[~self.active]
        self.bends = smoothness_rows(nodes.x[self.active])
        self.anchor = np.log10(np.maximum(nodes.y[self.active], LEAST_Y))
        self.k = int(self.active.sum())

    def response(self, values: FloatArray, use: BoolArray, cell: FloatArray | None = None) -> Responses:
        """What the sensor makes of the light of the cells in `use`, with the pulse that `values` make."""
        made = {pulses: pulses.response(values, cell) for pulses in dict.fromkeys(self._pulses_of_set)}
        return Responses(tuple(made[pulses] for pulses in self._pulses_of_set), self.set_of[use])

    def light(self, theta: FloatArray) -> FloatArray:
        """S of every cell."""
        bloom = self.fixed + self.matrix @ 10.0 ** theta[: self.k]
        bright = self.pulses.brightness(theta[self.k :])
        return np.asarray(np.maximum(bright * (self.target + bloom) + self.other, 1e-9))

    def start(self) -> FloatArray:
        """Where to begin: a table that gives the cells the light that their AREA shows, and dark ones none to be seen.

        A wide target lights each cell by many nodes at once, so that no cell tells of one node alone: each node is
        moved by what its cells lack, each as far as the node lights it, again and again.
        """
        every = np.ones(len(self.value), dtype=bool)
        response = self.response(self.pulses.start, every)
        beside = self.used & (self.target == 0.0)
        seen = beside & np.isfinite(self.value[:, 1])
        dark = beside & (self.beams > 0) & (self.echoes == 0)
        wanted = np.where(seen, response.light_of_area(np.nan_to_num(self.value[:, 1])), response.of_set[0].dark)
        log_y = self.anchor.copy()
        rows = np.flatnonzero(seen | dark)
        for _ in range(_START_ROUNDS):
            part = self.matrix[rows] * 10.0**log_y
            light = np.maximum(self.fixed[rows] + self.other[rows] + part.sum(axis=1), 1e-9)
            off = wanted[rows] - np.log10(light)
            share = part / light[:, None]
            weight = share.sum(axis=0)
            moved = share.T @ np.where(dark[rows], np.minimum(off, 0.0), off)
            log_y += np.where(weight > 0.0, moved / np.maximum(weight, 1e-12), 0.0)
        low, high = self.bounds()
        return np.asarray(np.clip(np.concatenate([log_y, self.pulses.start]), low, high))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """What the parameters may be: Y from what a file can hold up to 1."""
        extras = self.pulses.extras
        low = np.concatenate([np.full(self.k, np.log10(LEAST_Y)), [extra.low for extra in extras]])
        high = np.concatenate([np.zeros(self.k), [extra.high for extra in extras]])
        return low, high

    def weights(self, theta: FloatArray) -> FloatArray:
        """One over the standard deviations of all cells' features at the light of `theta`."""
        every = np.ones(len(self.value), dtype=bool)
        response = self.response(theta[self.k :], every)
        return weights(response, np.log10(self.light(theta)), self.value, self.echoes)

    def residuals(
        self, theta: FloatArray, weight: FloatArray, use: BoolArray, cell: FloatArray | None = None
    ) -> FloatArray:
        """Of the cells in `use`: three features of each that has echoes, then detection of each whose beams count."""
        z, values = np.log10(self.light(theta)), theta[self.k :]
        seen, fired = use & (self.echoes > 0), use & (self.beams > 0)
        mean, _ = self.response(values, seen, cell).features(z[seen])
        off = np.where(np.isfinite(self.value[seen]), mean - np.nan_to_num(self.value[seen]), 0.0)
        features = weight[seen] * off
        response = self.response(values, fired, cell)
        lost, _ = detection_residual(response, z[fired], self.echoes[fired], self.beams[fired])
        return np.concatenate([features.ravel(), lost])

    def slopes(self, theta: FloatArray, weight: FloatArray, use: BoolArray) -> FloatArray:
        """Slopes of the residuals over the parameters."""
        z, values = np.log10(self.light(theta)), theta[self.k :]
        seen, fired = use & (self.echoes > 0), use & (self.beams > 0)
        _, slope = self.response(values, seen).features(z[seen])
        response = self.response(values, fired)
        _, lost = detection_residual(response, z[fired], self.echoes[fired], self.beams[fired])
        steep = np.concatenate([(weight[seen] * slope).ravel(), lost])
        rows = np.concatenate([np.repeat(np.flatnonzero(seen), 3), np.flatnonzero(fired)])
        slopes = steep[:, None] * self._light_slopes(theta)[rows]
        cell, base = self.pulses.cell(theta[self.k :]), None
        for i in self.pulses.shaping:
            base = self.residuals(theta, weight, use, cell) if base is None else base
            step, moved = 0.1 * self.pulses.extras[i].step, theta.copy()
            moved[self.k + i] += step
            slopes[:, self.k + i] = (self.residuals(moved, weight, use, cell) - base) / step
        return np.asarray(slopes)

    def _light_slopes(self, theta: FloatArray) -> FloatArray:
        """Slopes of log10 S over the parameters, shape (cells, parameters); 0 for those that shape the pulse."""
        light = self.light(theta)
        slopes = np.zeros((len(light), len(theta)))
        bright = self.pulses.brightness(theta[self.k :]) / light
        slopes[:, : self.k] = bright[:, None] * self.matrix * 10.0 ** theta[: self.k]
        for i in set(range(len(self.pulses))) - set(self.pulses.shaping):
            slopes[:, self.k + i] = 1.0 - self.other / light
        return slopes

    def prior(self, smoothness: float) -> FloatArray:
        """Rows of the smoothness and of the anchor over all parameters."""
        rows = np.concatenate([np.sqrt(smoothness) * self.bends, _ANCHOR * np.eye(self.k)])
        return np.asarray(np.pad(rows, ((0, 0), (0, len(self.pulses)))))

    def solve(
        self, theta: FloatArray, smoothness: float, use: BoolArray | None = None, *, only_table: bool = False
    ) -> FloatArray:
        """The parameters of least loss from `theta` on, by the cells in `use`; `only_table` holds all else."""
        from scipy.optimize import minimize

        cells = self.used if use is None else use
        weight, prior = self.weights(theta), self.prior(smoothness)
        shift = np.concatenate([np.zeros(len(self.bends)), -_ANCHOR * self.anchor])
        movable = self.k if only_table else len(theta)
        low, high = self.bounds()

        def whole(part: FloatArray) -> FloatArray:
            return np.concatenate([part, theta[movable:]])

        def loss(part: FloatArray) -> tuple[float, FloatArray]:
            at = whole(part)
            off, outside = prior @ at + shift, _FENCE * (at - np.clip(at, low, high))
            residual = self.residuals(at, weight, cells)
            gradient = self.slopes(at, weight, cells).T @ (huber_weight(residual) * residual)
            gradient = (gradient + prior.T @ off + _FENCE * outside)[:movable]
            return 0.5 * float(huber_cost(residual).sum() + off @ off + outside @ outside), gradient

        def curvature(part: FloatArray) -> FloatArray:
            at = whole(part)
            slopes = self.slopes(at, weight, cells)
            damped = huber_weight(self.residuals(at, weight, cells))
            fence = np.diag(_FENCE**2 * ((at < low) | (at > high)))
            return np.asarray(slopes.T @ (damped[:, None] * slopes) + prior.T @ prior + fence)[:movable, :movable]

        found = minimize(loss, theta[:movable], method="trust-exact", jac=True, hess=curvature, options=_STOP)
        return np.clip(whole(np.asarray(found.x)), low, high)


def _between(x: FloatArray, seen: BoolArray) -> BoolArray:
    """Nodes that cells see, and those between them on the same side of 0; never 0 itself, the target's own light."""
    active = np.zeros(len(x), dtype=bool)
    for side in (np.flatnonzero(x < 0.0), np.flatnonzero(x > 0.0)):
        which = np.flatnonzero(seen[side])
        if len(which):
            active[side[which[0] : which[-1] + 1]] = True
    return active
