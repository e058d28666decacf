"""Screening: what every candidate would change, and how much of the disagreement that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import Probe
from lidarcheck.errors import UsageError
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers import WorkerPool

if TYPE_CHECKING:
    from lidarcheck.workers.checkpoint import Checkpoint

__all__ = ["Screened", "chance_level", "screen", "weaker_starts"]


_LARGEST_SCALE = 1.5
_WEAK, _HARDLY, _PROMISING = 0.6, 0.02, 0.15
"""Starts that explain most when scaled by less than this, but by more than that, are screened once more so much weaker,
where they explain this part of what the best one does."""


@dataclass(frozen=True)
class Screened:
    """A probe, how the summaries change with it, (n_summaries,), and what that explains of a residual by chance."""

    probe: Probe
    change: FloatArray
    chance: float

    def gain(self, simulator: Simulator, residual: FloatArray) -> tuple[float, float]:
        """By how much the distance of a residual shrinks when the change is scaled by a factor from 0 to 1.5, and
        that factor."""
        weighted = simulator.metric.times(self.change)
        length = float(self.change @ weighted)
        if length <= 0.0:
            return 0.0, 0.0
        scale = min(max(float(weighted @ residual) / length, 0.0), _LARGEST_SCALE)
        return float(2.0 * scale * (weighted @ residual) - scale**2 * length), scale


def screen(
    simulator: Simulator,
    probes: Sequence[Probe],
    on_progress: Callable[[int, int], object] | None = None,
    pool: WorkerPool | None = None,
    checkpoint: Checkpoint | None = None,
    pages: str = "change",
) -> list[Screened]:
    """What every candidate would change, each with the same random numbers as the model itself.

    `checkpoint` has what an interrupted run found, and gets what this one finds, on `pages` of that name.
    """
    pool = pool or WorkerPool()
    start = [checkpoint.get(f"{pages} {i}") if checkpoint else None for i in range(len(probes))]
    open_ = [i for i, change in enumerate(start) if change is None]
    changes: list[FloatArray | None] = [None if c is None else np.array(c) for c in start]
    for i, change in zip(open_, pool.map(_change, ((simulator.shared, probes[i]) for i in open_)), strict=True):
        changes[i] = change
        if checkpoint is not None:
            checkpoint.put(f"{pages} {i}", [] if change is None else change)
        if on_progress is not None:
            on_progress(i + 1, len(probes))
    return [
        Screened(probe, change, _chance(simulator, change))
        for probe, change in zip(probes, changes, strict=True)
        if change is not None and len(change)
    ]


def weaker_starts(simulator: Simulator, screened: Sequence[Screened]) -> list[Probe]:
    """The best start of each kind of the promising effects, as much weaker as fits the measurement, where that is much.

    Summaries are compressed: what a start changes, scaled down, is not what a weaker one changes, and explains less.
    """
    best: dict[tuple[str, str], tuple[float, float, Probe]] = {}
    for one in screened:
        gain, scale = one.gain(simulator, simulator.measured)
        kind = one.probe.name, one.probe.variant
        if gain > best.get(kind, (0.0,))[0]:
            best[kind] = gain, scale, one.probe
    least = _PROMISING * max((gain for gain, _, _ in best.values()), default=0.0)
    weaker = [p.scaled(scale) for gain, scale, p in best.values() if gain > least and _HARDLY < scale < _WEAK]
    known = [one.probe for one in screened]
    return [probe for probe in weaker if probe not in known]


def _change(simulator: Simulator, probe: Probe) -> FloatArray | None:
    try:
        return np.asarray(simulator.shows(simulator.model.with_(probe.effect()), 1)[0])
    except UsageError:
        return None  # such an effect cannot be on top of this model


def _chance(simulator: Simulator, change: FloatArray) -> float:
    """Mean of what this change explains, in either direction, of draws in which nothing is missing; at least 1."""
    weighted = simulator.metric.times(change)
    length = float(change @ weighted)
    return max(1.0, float(np.mean((simulator.check @ weighted) ** 2) / length)) if length > 0.0 else 1.0


def chance_level(simulator: Simulator, screened: Sequence[Screened], share: float = 0.99) -> float:
    """The quantile, over draws in which nothing is missing, of the largest gain that any candidate has by chance.

    In units of each candidate's own mean gain by chance.
    """
    if not screened:
        return 0.0
    changes = np.array([one.change for one in screened]).T
    weighted = simulator.metric.times(changes)
    length = np.maximum((changes * weighted).sum(axis=0), 1e-9)
    slope = np.maximum(simulator.check @ weighted, 0.0)
    largest = (slope**2 / length / np.array([one.chance for one in screened])).max(axis=1)
    # Sixty draws do not hold their own 99 % quantile: their mean and spread give it (Gumbel's distribution).
    scale = float(np.std(largest)) * np.sqrt(6.0) / np.pi
    return float(np.mean(largest) + scale * (-np.log(-np.log(share)) - 0.5772))
