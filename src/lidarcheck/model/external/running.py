"""Running somebody else's model on several ideal scans, side by side."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence

from lidarcheck.model.external.exchange import Request
from lidarcheck.model.external.process import Groups, stop_external_models
from lidarcheck.model.external.program import run_program
from lidarcheck.model.external.resident import Resident
from lidarcheck.model.external.residents import lent
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
    cores where None, one in a worker process. A server or a module's process stays up for the next call, one for each
    that runs at a time. After an error or an interrupt what runs of these is killed.
    `ExternalModelError`, one line, with what the model said last, for whatever fails; and when the user does not trust
    it, of which nothing is run then.
    """
    require_trust(external)
    groups: Groups = set()
    if jobs is None:
        jobs = usable_cores() if multiprocessing.parent_process() is None else 1
    tasks = [(chunk, external, sensor, groups) for chunk in _chunks(external, requests, jobs, groups)]
    if min(jobs, len(tasks)) < 2:
        return [scan for task in tasks for scan in _run(*task)]
    with Threads(min(jobs, len(tasks)), hurry=lambda: stop_external_models(groups)) as pool:
        return [scan for scans in pool.map(_run, tasks) for scan in scans]


def run_external(ideal: IdealScan, external: External, *, seed: int) -> Scan:
    """Let an external model simulate one ideal scan, of which it gets every column; see `run_requests`."""
    from lidarcheck.formats.ideals import table_from_ideal

    return run_requests(external, [Request(ideal, seed, columns=table_from_ideal(ideal).names)])[0]


def _chunks(external: External, requests: Sequence[Request], jobs: int, groups: Groups) -> list[Sequence[Request]]:
    """The requests, together as many as a server takes, so that all jobs have some."""
    size = 1
    if external.server and len(requests) > 1:
        with lent(external, _start, groups) as resident:
            size = max(1, min(resident.batch, -(-len(requests) // jobs)))
    return [requests[start : start + size] for start in range(0, len(requests), size)]


def _start(external: External, groups: Groups) -> Resident:
    from lidarcheck.model.external.module import ModuleProcess
    from lidarcheck.model.external.server import Server

    return ModuleProcess(external, groups) if external.module else Server(external, groups)


def _run(requests: Sequence[Request], external: External, sensor: Sensor | None, groups: Groups) -> list[Scan]:
    if not (external.server or external.module):
        return [run_program(request, external, sensor, groups) for request in requests]
    with lent(external, _start, groups) as resident:
        return resident.run(requests, sensor)
