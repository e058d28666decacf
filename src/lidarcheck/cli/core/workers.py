"""Who works for a command: this machine's cores, or the workers of a scheduler."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.terminal import stage
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.workers import WorkerPool

__all__ = ["Scheduler", "workers"]


def _address(_type: Any, tokens: Sequence[Any]) -> str:
    from lidarcheck.workers.address import check_address

    return check_address(tokens[0].value)


Scheduler = Annotated[
    str,
    Parameter(
        converter=_address,
        help="A scheduler of Dask, tcp://HOST:PORT, whose workers do the work in the place of this machine's cores.",
    ),
]


@contextlib.contextmanager
def workers(scheduler: str | None, jobs: int | None) -> Iterator[WorkerPool | None]:
    """The scheduler's workers; None, for this machine's cores, where no scheduler is named."""
    if scheduler is None:
        yield None
        return
    if jobs is not None:
        raise UsageError("--jobs does not go with --scheduler, whose workers are its own", fix="leave one of them out")
    from lidarcheck.workers.cluster import Cluster

    with contextlib.ExitStack() as stack:
        with stage(f"looking for workers at {scheduler}"):
            cluster = stack.enter_context(Cluster(scheduler))
        yield cluster
