"""What a worker of a cluster does: see that it is of the same kind as the caller, and do a task."""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from typing import Any

from lidarcheck.errors import WorkerError
from lidarcheck.workers.base import perform
from lidarcheck.workers.identity import Identity, identity, limit_blas
from lidarcheck.workers.keeping import kept

__all__ = ["refusal", "run_tasks"]


def run_tasks(caller: Identity, packed: bytes, keys: Sequence[str], things: Sequence[bytes]) -> tuple[float, list[Any]]:
    """Do packed tasks with what is shared; how long that took [s], and the results.

    `WorkerError` where this process would find other numbers.
    """
    if words := refusal(identity(), caller):
        raise words
    _prepare()
    content = dict(zip(keys, things, strict=True))
    start = time.perf_counter()
    results = perform(packed, lambda key: kept(key, content[key]))
    return time.perf_counter() - start, results


@functools.cache
def _prepare() -> None:
    import scipy.linalg  # noqa: F401 - brings a library of its own, which must be there to be limited

    limit_blas()


def refusal(worker: Identity | BaseException, caller: Identity, address: str = "") -> WorkerError | None:
    """Why a worker cannot take part: it could not say who it is, or differs from the caller."""
    where = f"the worker {address}" if address else "a worker"
    if isinstance(worker, ModuleNotFoundError):
        return WorkerError(f"{where} has no lidarcheck: {worker}", fix=_FIX)
    if isinstance(worker, BaseException):
        return WorkerError(f"{where} cannot say what it runs: {type(worker).__name__}: {worker}", fix=_FIX)
    if words := worker.differences(caller):
        return WorkerError(f"{where} on {worker.host} would find other numbers: it has {words}", fix=_FIX)
    return None


_FIX = "install the same versions on all machines; see docs/cluster.md, which also says what to do about arithmetic"
