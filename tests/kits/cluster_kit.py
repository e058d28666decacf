"""A real scheduler of Dask and real workers on the loopback address, for tests of what runs on a cluster."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

PATIENCE_S = 60.0
SCHEDULER = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
WORKER = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--memory-limit", "0")


class Farm:
    """One scheduler and its workers, processes of their own; all are killed when it is left."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.workers: list[subprocess.Popen[bytes]] = []
        self._log = (directory / "farm.log").open("wb")
        where = directory / "scheduler.json"
        # A task that ends its third worker is given up; by default it would be the fourth.
        settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "2"}
        self.scheduler = self._start([*SCHEDULER, "--scheduler-file", str(where)], settings)
        until(where.is_file)
        until(lambda: where.read_text().rstrip().endswith("}"))
        self.address = str(json.loads(where.read_text())["address"])

    def _start(self, arguments: list[str], settings: Mapping[str, str]) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False", **settings}
        command = [sys.executable, "-m", *arguments]
        return subprocess.Popen(command, env=environment, stdout=self._log, stderr=self._log, cwd=self.directory)

    def add(self, count: int = 1, **settings: str) -> list[subprocess.Popen[bytes]]:
        """More workers; they join when they are ready."""
        command = ["distributed.cli.dask_worker", self.address, *WORKER, "--local-directory", str(self.directory)]
        new = [self._start(command, settings) for _ in range(count)]
        self.workers += new
        return new

    def kill(self, count: int | None = None) -> None:
        """So many workers are gone at once, all of them where None."""
        for worker in self.workers[:count]:
            worker.kill()
            worker.wait()
        del self.workers[:count]

    def close(self) -> None:
        """Nothing is left of it."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self._log.close()


def until(holds: Callable[[], object]) -> None:
    """Wait until something holds; it is an error if it does not for long."""
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end, "the cluster of the test does not get ready"
        time.sleep(0.02)
