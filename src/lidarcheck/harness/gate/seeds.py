"""Which seeds are run for what, and running them side by side.

A golden is made from its own 64 seeds, of which the first 8 are the paired ones; 32 more make the reference of its
distances, so that no seed is compared with itself. Fresh seeds follow from one number and are never among these.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.harness.gate import evidence
from lidarcheck.harness.kpis.spec import SeedMeasurement
from lidarcheck.model.external import stop_external_models
from lidarcheck.workers import Shared, Threads, WorkerPool, one_blas_thread
from lidarcheck.workers.cores import usable_cores

__all__ = [
    "GOLDEN_SEEDS",
    "QUANTILE_LEVELS",
    "REFERENCE_SEEDS",
    "Progress",
    "Runner",
    "ScenarioJob",
    "SeedRecord",
    "distance",
    "fresh_seeds",
    "quantile_function",
    "record_of",
]

GOLDEN_SEEDS = tuple(range(evidence.FULL_SEEDS))
REFERENCE_SEEDS = tuple(range(evidence.FULL_SEEDS, evidence.FULL_SEEDS + 32))
QUANTILE_LEVELS = 129
_LOWEST_FRESH, _FRESH_BITS = 1 << 20, 31

Progress = Callable[[int, int, str], None]
"""Called with (seeds done, seeds to do, scenario)."""


@dataclass(frozen=True, slots=True)
class SeedRecord:
    """What is kept of one seed: KPI values, trials, the quantile function of each feature, the echoes' digest."""

    values: Mapping[str, float]
    trials: Mapping[str, int]
    quantiles: Mapping[str, FloatArray]
    digest: str


class ScenarioJob(NamedTuple):
    """A scenario to be run: its name, what runs a seed of it, and the list that its records are appended to. `forget`
    is called when its seeds are done, so that what they shared need not stay until all scenarios are."""

    label: str
    run: Callable[[int], SeedMeasurement]
    records: list[SeedRecord]
    forget: Callable[[], object] = lambda: None


class Runner:
    """Runs seeds of several scenarios side by side, whose results do not depend on who works.

    `pool`: who works, `jobs` threads where None: the kernels release the interpreter's lock. On an error or interrupt
    nothing new is started, external models are killed, kernels that run are waited for, and no record is kept.
    `progress` is called from the calling thread.
    """

    def __init__(
        self, jobs: int | None = None, progress: Progress | None = None, pool: WorkerPool | None = None
    ) -> None:
        self._jobs = jobs or usable_cores()
        self._progress = progress or (lambda done, total, label: None)
        self._pool = pool
        self._held: dict[int, Shared[Callable[[int], SeedMeasurement]]] = {}
        self._done = 0

    def seeds(self, jobs: Sequence[ScenarioJob], seeds: Sequence[int]) -> None:
        """Run `seeds` of every job and append their records, in the order of the seeds."""
        tasks = [*self._order(jobs, seeds)]
        if not tasks:
            return
        total = self._done + len(tasks)
        self._progress(self._done, total, tasks[0][0].label)
        found: list[SeedRecord] = []
        # External models may run for minutes; nobody waits for them after an error or an interrupt.
        own = Threads(self._jobs, hurry=stop_external_models)
        with one_blas_thread(), own if self._pool is None else contextlib.nullcontext(self._pool) as pool:
            for record in pool.map(_run, ((self._holding(job), seed) for job, seed in tasks)):
                self._progress(self._done + len(found) + 1, total, tasks[len(found)][0].label)
                found.append(record)
                if tasks[len(found) - 1][1] == seeds[-1]:
                    tasks[len(found) - 1][0].forget()
        self._done = total
        for (job, _), record in zip(tasks, found, strict=True):
            job.records.append(record)

    def _order(self, jobs: Sequence[ScenarioJob], seeds: Sequence[int]) -> Iterator[tuple[ScenarioJob, int]]:
        """As many scenarios side by side as there are workers: what all seeds of one share is then found once, by its
        first seed, while others do the same for theirs."""
        for at in range(0, len(jobs), self._jobs):
            beside = jobs[at : at + self._jobs]
            yield from ((job, seed) for job in beside for seed in seeds[:1])
            yield from ((job, seed) for job in beside for seed in seeds[1:])

    def _holding(self, job: ScenarioJob) -> Shared[Callable[[int], SeedMeasurement]]:
        """What runs a seed, the same thing for all seeds of a scenario."""
        return self._held.setdefault(id(job.run), Shared(job.run))


def _run(run: Callable[[int], SeedMeasurement], seed: int) -> SeedRecord:
    return record_of(run(seed))


def fresh_seeds(number: int | None, count: int) -> tuple[int, ...]:
    """`count` different seeds that follow from `number` (None: the usual ones), none of them a golden's own."""
    name = "default" if number is None else str(number)
    seeds: dict[int, None] = {}
    draw = 0
    while len(seeds) < count:
        word = hashlib.sha256(f"fresh seed {name} {draw}".encode()).digest()
        seed = int.from_bytes(word[:8], "big") % (1 << _FRESH_BITS)
        if seed >= _LOWEST_FRESH:
            seeds[seed] = None
        draw += 1
    return tuple(seeds)


def quantile_function(sample: npt.NDArray[np.floating[Any]]) -> FloatArray:
    """The sample's quantiles at the 129 levels (i + ½)/129; nan throughout if it is empty or holds a nan."""
    values = np.sort(np.asarray(sample, dtype=np.float64).ravel())
    if values.size == 0 or not np.isfinite(values).all():
        return np.full(QUANTILE_LEVELS, np.nan)
    levels = (np.arange(QUANTILE_LEVELS) + 0.5) / QUANTILE_LEVELS
    return values[np.minimum((levels * values.size).astype(np.int64), values.size - 1)]


def distance(quantiles: FloatArray, reference: FloatArray) -> float:
    """1-Wasserstein distance [the feature's unit] of two quantile functions, by the midpoint rule over their levels."""
    return float(np.abs(quantiles - reference).mean())


def record_of(measurement: SeedMeasurement) -> SeedRecord:
    """The measurement without its samples, which are large."""
    return SeedRecord(
        values={name: float(value) for name, value in measurement.values.items()},
        trials={name: int(count) for name, count in measurement.trials.items()},
        quantiles={name: quantile_function(sample) for name, sample in measurement.samples.items()},
        digest=measurement.digest,
    )
