"""The program that ci/freeze asks, as a user does: by its command line."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Result:
    """How a command has ended, and the processor time it took: others may be busy on the machine."""

    code: int
    out: str
    err: str
    seconds: float


@dataclass(frozen=True)
class Tool:
    """The executable under test, asked as a user asks it, on one thread so that times and bytes can be compared.

    `cache`: what it has compiled and filled, for this record alone: what other code has left there must not be read.
    """

    program: Path
    cache: Path

    def ask(self, words: Iterable[object], place: Path) -> Result:
        """Run a command in the directory `place`, whatever it ends with."""
        keep = {key: value for key, value in os.environ.items() if not key.startswith(("LIDARCHECK_", "GITHUB_"))}
        env = keep | dict.fromkeys(ONE_THREAD, "1") | {"COLUMNS": "100", "NO_COLOR": "1", "MPLBACKEND": "Agg"}
        env["LIDARCHECK_CACHE"] = str(self.cache)
        argv = [str(self.program), *map(str, words)]
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            process = subprocess.Popen(argv, cwd=place, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=err)
            try:
                _, status, used = os.wait4(process.pid, 0)
            except BaseException:
                process.terminate()
                raise
            process.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            err.seek(0)
            seconds = used.ru_utime + used.ru_stime
            return Result(process.returncode, out.read().decode(), err.read().decode(), seconds)

    def run(self, *words: object, place: Path) -> None:
        """A command that must end well."""
        done = self.ask(words, place)
        if done.code != 0:
            sys.exit(f"lidarcheck {' '.join(map(str, words))}: {done.err.strip()}")
