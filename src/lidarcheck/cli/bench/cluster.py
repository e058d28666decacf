"""What a task costs on a cluster, beside local processes: one without work of its own, and what many tasks hold."""

from __future__ import annotations

import os
from functools import partial

from lidarcheck.cli.bench.kit import Alternative, Figure, times
from lidarcheck.workers import Processes, Shared, WorkerPool
from lidarcheck.workers.cluster import Cluster

__all__ = ["cluster_figures", "costs"]

_WORKERS = 2
_HELD_BYTES = 50_000_000


def cluster_figures(repeats: int, quick: bool) -> list[Figure]:
    """Milliseconds of a task that does nothing, sent with others and alone, and of bringing 50 MB to each of two
    workers on this machine; none where dask is not installed."""
    try:
        from distributed import LocalCluster
    except ImportError:
        return []
    where = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": 50}
    with (
        LocalCluster(n_workers=_WORKERS, threads_per_worker=1, **where) as there,  # type: ignore[no-untyped-call]
        Cluster(there.scheduler_address) as cluster,
        Processes(_WORKERS) as own,
    ):
        return costs(cluster, own, 100 if quick else 500, _HELD_BYTES, repeats)


def costs(cluster: Cluster, own: WorkerPool, tasks: int, size: int, repeats: int) -> list[Figure]:
    """The figures of two crews. `tasks`: so many are timed together; `size`: of what is held [bytes]."""
    empty = [times(partial(_empty, pool, tasks), repeats) for pool in (cluster, own)]
    cluster.batch_s = 0.0
    alone = [times(partial(_empty, pool, tasks), repeats) for pool in (cluster, own)]
    held = [times(partial(_held, pool, size), repeats) for pool in (cluster, own)]
    return [
        _beside("cluster_short_task_ms", [[1e3 * s / tasks for s in one] for one in empty]),
        _beside("cluster_task_ms", [[1e3 * s / tasks for s in one] for one in alone]),
        _beside(f"cluster_held_{size // 1_000_000}mb_ms", [[1e3 * s for s in one] for one in held]),
    ]


def _empty(pool: WorkerPool, tasks: int) -> None:
    assert [*pool.map(abs, ((-k,) for k in range(tasks)))] == [*range(tasks)]


def _held(pool: WorkerPool, size: int) -> None:
    held, tasks = Shared(os.urandom(size)), 4 * _WORKERS
    assert [*pool.map(len, ((held,) for _ in range(tasks)))] == [size] * tasks


def _beside(name: str, found: list[list[float]]) -> Figure:
    mine, other = (sorted(one) for one in found)
    against = (Alternative("the same on local processes", other[0], other[0] / mine[0]),)
    return Figure(name, "ms", mine[0], mine[len(mine) // 2], len(mine), against)
