"""Frames to fit: what was measured on some of their beams, and what any model shows there."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.parameters.statistics import Statistics
from lidarcheck.cases.frame import Frame
from lidarcheck.errors import UsageError
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of, key_of
from lidarcheck.inference.observed.observations import Observations, observations_of
from lidarcheck.inference.simulations import Simulations, observed
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.sensor import Program
from lidarcheck.workers import Shared, WorkerPool

__all__ = ["FitData", "FitReference", "seed_of"]


_BASE_SEEDS, _NOISE_SEEDS = 6, 5
"""Simulations of which each beam's expectation is the mean, and those by which columns of beams scatter."""
_SHRUNK = 0.1
"""Part of each correlation that is not believed: there are more sums than independent columns of beams."""
_LEAST_COUNT = 4.0
"""The least variance of a count of rare echoes, as if four were expected."""


def seed_of(seed: int, purpose: str, k: int = 0) -> int:
    """A seed for the k-th simulation of a purpose; nobody's own small seeds are among them."""
    digest = hashlib.sha256(f"calibrate {seed} {purpose} {k}".encode()).digest()
    return int.from_bytes(digest[:8])


@dataclass(frozen=True)
class FitReference:
    """The statistics as a model shows them, the metric of their noise, and the measurement in them.

    `measured` (n_statistics,) and `measured_parts` (n_clusters, n_statistics).
    """

    statistics: Statistics
    metric: Metric
    measured: FloatArray
    measured_parts: FloatArray

    @functools.cached_property
    def shared(self) -> Shared[Statistics]:
        """The statistics for the tasks of a worker pool."""
        return Shared(self.statistics)


class FitData:
    """Some frames of which the beams that are `used` take part, and simulations of them.

    `beams`: those of the frames' ideal scans. `used` (n_beams,): in their order. `pool`: simulates side by side.
    """

    def __init__(
        self, frames: Sequence[Frame], beams: BeamTable, used: BoolArray, seed: int, pool: WorkerPool | None = None
    ) -> None:
        self.frames = tuple(frames)
        self._simulations = Simulations(self.frames)
        self.beams = beams
        self.used = used
        self.seed = seed
        self.pool = pool or WorkerPool()
        self.measured: Observations = observations_of(beams, [f.measured for f in frames])

    @classmethod
    def of(cls, frames: Sequence[Frame], model: Model, seed: int, pool: WorkerPool | None = None) -> FitData:
        """The frames with all of their beams."""
        beams = beams_of([f.ideal for f in frames], model)
        return cls(frames, beams, np.ones(len(beams), dtype=bool), seed, pool)

    @functools.cached_property
    def shared(self) -> Shared[FitData]:
        """The frames for the tasks of a worker pool."""
        return Shared(self)

    def __getstate__(self) -> dict[str, object]:
        """Without who works: a worker has no workers of its own."""
        return {**{name: value for name, value in self.__dict__.items() if name != "shared"}, "pool": WorkerPool()}

    def observations(self, model: Model, purpose: str, k: int) -> Observations:
        """What the model shows of each beam with the k-th seed of a purpose."""
        seed = seed_of(self.seed, purpose, k)
        if isinstance(model.sensor, Program):  # handed the ideal scans as they are, where nothing stands around it
            return observed(self.frames, [Surfaces(f.ideal) for f in self.frames], self.beams, model, seed)
        return observations_of(self.beams, self._simulations.scans(model, seed))

    def totals(self, reference: FitReference, asked: Iterable[tuple[Model, str, int]]) -> list[FloatArray | None]:
        """The statistics that models show, each with the k-th seed of a purpose; None where no sensor has such
        numbers."""
        return [*self.pool.map(_total, ((self.shared, reference.shared, *one) for one in asked))]

    def by_cluster(self, reference: FitReference, model: Model, purpose: str, seeds: int) -> FloatArray:
        """The statistics over each cluster with the first seeds of a purpose, (seeds, n_clusters, n_statistics)."""
        return self._by_cluster(reference.shared, model, purpose, seeds)

    def _by_cluster(self, statistics: Shared[Statistics], model: Model, purpose: str, seeds: int) -> FloatArray:
        tasks = ((self.shared, statistics, model, purpose, k) for k in range(seeds))
        return np.array([*self.pool.map(_clustered, tasks)])

    def reference(self, model: Model, purpose: str) -> FitReference:
        """The statistics around a model, with seeds of their own."""
        tasks = ((self.shared, model, f"{purpose} base", k) for k in range(_BASE_SEEDS))
        statistics = Statistics(self.beams, self.used, [*self.pool.map(FitData.observations, tasks)])
        drawn = self._by_cluster(Shared(statistics), model, f"{purpose} noise", _NOISE_SEEDS)
        drawn -= drawn.mean(axis=0)
        flat = drawn.reshape(-1, drawn.shape[-1])
        least = np.where(statistics.counted, _LEAST_COUNT, 1.0)
        metric = Metric.shrunk(flat.T @ flat / (_NOISE_SEEDS - 1.0), least, _SHRUNK)
        parts = statistics.by_cluster(self.measured)
        return FitReference(statistics, metric, parts.sum(axis=0), parts)

    def restricted(self, keep: BoolArray) -> FitData:
        """The frames with no more than the beams that are kept, (n_beams,)."""
        frames = [
            _frame_of(frame, self.beams.key[keep & (self.beams.frame == i)], i) for i, frame in enumerate(self.frames)
        ]
        there = [i for i, frame in enumerate(frames) if len(frame.ideal)]
        if len(there) < len(frames):
            frames = [frames[i] for i in there]
        return FitData(frames, _beams_of(self.beams, keep), self.used[keep], self.seed, self.pool)


def _total(data: FitData, statistics: Statistics, model: Model, purpose: str, k: int) -> FloatArray | None:
    try:
        return statistics.total(data.observations(model, purpose, k))
    except UsageError:
        return None


def _clustered(data: FitData, statistics: Statistics, model: Model, purpose: str, k: int) -> FloatArray:
    return statistics.by_cluster(data.observations(model, purpose, k))


def _frame_of(frame: Frame, keys: npt.NDArray[np.int64], number: int) -> Frame:
    """A frame with the beams of some keys, all rows of a beam or none, and the echoes of those beams."""
    rows, echoes = (np.isin(key_of(number, t.layer, t.point), keys) for t in (frame.ideal, frame.measured))
    ideal, measured = frame.ideal.take(np.flatnonzero(rows)), frame.measured.take(np.flatnonzero(echoes))
    return dataclasses.replace(frame, ideal=ideal, measured=measured)


def _beams_of(beams: BeamTable, keep: BoolArray) -> BeamTable:
    """Some rows of a table of beams; what stands beside a beam stays known where that beam is left out."""
    found = beams.without(~keep)
    # Frames are numbered anew where one of them has no beam left; keys follow.
    frame = np.unique(found.frame, return_inverse=True)[1].astype(np.int64)
    key = key_of(frame, found.layer, found.point)
    # The frames' own scans have no other beams either, but for those that were left out before.
    return dataclasses.replace(found, frame=frame, key=key, whole=beams.whole)
