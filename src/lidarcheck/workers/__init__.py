"""Work side by side: a group of workers that run tasks and hold what many of these need.

`WorkerPool` is the interface and works in the caller itself; `Threads` and `Processes` are on this machine,
`Cluster` has a scheduler of dask. Results come in the order of the tasks and do not depend on who worked.
"""

from lidarcheck.workers.base import Shared, WorkerPool
from lidarcheck.workers.identity import one_blas_thread
from lidarcheck.workers.local import Processes, Threads

__all__ = ["Processes", "Shared", "Threads", "WorkerPool", "one_blas_thread"]
