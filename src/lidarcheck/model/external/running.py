"""Running somebody else's model on several ideal scans, side by side."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence

from lidarcheck.model.external.exchange import Request
from lidarcheck.model.external.process import Groups, stop_external_models
from lidarcheck.model.external.program import run_program
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor
from lidarcheck.trust.programs import require_trust
from lidarcheck.workers import Threads
from lidarcheck.workers.cores import usable_cores

__all__ = ["Request", "run_external", "run_requests"]


def run_requests(
    external: External, requests: Sequence[Request], sensor: Sensor | None = None, *, jobs: int | None = None
) -> list[Scan]:
    """The echoes of every request, in their order, which do not depend on what runs beside it.

    `sensor`: whose beams and features the scans have, a built-in one's where None. `jobs`: how many run at a time; all
    cores where None, one in a worker process. After an error or an interrupt what runs of these is killed.
    `ExternalModelError`, one line, with what the model said last, for whatever fails; and when the user does not trust
    it, of which nothing is run then.
    """
    require_trust(external)
    groups: Groups = set()
    if jobs is None:
        jobs = usable_cores() if multiprocessing.parent_process() is None else 1
    tasks = [(request, external, sensor, groups) for request in requests]
    if min(jobs, len(tasks)) < 2:
        return [run_program(*task) for task in tasks]
    with Threads(min(jobs, len(tasks)), hurry=lambda: stop_external_models(groups)) as pool:
        return list(pool.map(run_program, tasks))


def run_external(ideal: IdealScan, external: External, *, seed: int) -> Scan:
    """Let an external model simulate one ideal scan, of which it gets every column; see `run_requests`."""
    from lidarcheck.formats.ideals import table_from_ideal

    return run_requests(external, [Request(ideal, seed, columns=table_from_ideal(ideal).names)])[0]
