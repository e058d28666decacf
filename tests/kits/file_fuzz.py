"""Malformed files of every format, each read in a process with a memory limit and a time limit.

What is no error of lidarcheck's own (`LidarcheckError`), ends the process, takes more memory or never ends, fails.
The file of a seed and a number is the same everywhere.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import multiprocessing
import os
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

__all__ = ["Failure", "fuzzed", "one"]

MOST_S = 5.0
"""Of the processor's time; a file may wait ten times as long for a processor."""
MOST_BYTES = 1 << 30
"""What reading a file may take beyond what the process has when it begins."""


@dataclass(frozen=True)
class Failure:
    """A file that was not read as it should be. `how`: `traceback`, `memory`, `hang`, `crash`."""

    number: int
    name: str
    how: str
    words: str
    content: bytes


def one(seed: int, number: int, made: Sequence[Any]) -> tuple[Any, bytes]:
    """Which of the seeds a number is of, and the malformed content."""
    from fuzz_mutations import mutated

    own = made[number % len(made)]
    return own, mutated(own.content, [other.content for other in made], random.Random(f"{seed} {number}"))


def fuzzed(
    seed: int,
    numbers: Sequence[int],
    jobs: int,
    outcomes: Counter[str],
    *,
    made_by: str = "fuzz_seeds",
    most_s: float = MOST_S,
) -> Iterator[Failure]:
    """Read the files of these numbers; the failures as they come.

    `outcomes`: counts what came of them, by seed. `made_by`: the module whose `seeds` gives the valid files.
    """
    waiting = list(reversed(numbers))
    with tempfile.TemporaryDirectory(prefix="lidarcheck-fuzz-") as place, contextlib.ExitStack() as stack:
        crew = [stack.enter_context(_Reader((seed, made_by), Path(place) / str(at), most_s)) for at in range(jobs)]
        idle = list(crew)
        while waiting or len(idle) < len(crew):
            while waiting and idle:
                idle.pop().begin(waiting.pop())
            for reader in _ready(crew):
                name, how, words = reader.end()
                outcomes[f"{name} {how}"] += 1
                if how not in ("read", "refused"):
                    content = reader.file(name).read_bytes() if reader.file(name).is_file() else b""
                    yield Failure(reader.number, name, how, words, content)
                idle.append(reader)


def _ready(crew: Sequence[_Reader]) -> list[_Reader]:
    busy = [reader for reader in crew if reader.busy]
    said = wait([reader.pipe for reader in busy], timeout=0.2)
    return [reader for reader in busy if reader.pipe in said or reader.overdue]


class _Reader:
    """A process that reads one file after the other; another one takes its place where it has ended."""

    def __init__(self, of: tuple[int, str], directory: Path, most_s: float) -> None:
        self.of, self.directory, self.most_s = of, directory, most_s
        self.busy, self.number, self.name = False, -1, ""
        directory.mkdir()

    def __enter__(self) -> _Reader:
        self._start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def _start(self) -> None:
        self.pipe, other = multiprocessing.Pipe()
        work = multiprocessing.get_context("spawn").Process(
            target=_work, args=(other, *self.of, str(self.directory)), daemon=True
        )
        work.start()
        other.close()
        self.process = work
        self.names: list[str] = self.pipe.recv()

    def _stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def file(self, name: str) -> Path:
        return self.directory / name

    def begin(self, number: int) -> None:
        self.number, self.busy, self.since_s = number, True, time.monotonic()
        self.cpu_s = self._cpu_s()
        self.pipe.send(number)

    def _cpu_s(self) -> float:
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    @property
    def overdue(self) -> bool:
        passed_s = time.monotonic() - self.since_s
        return passed_s > self.most_s and (passed_s > 10 * self.most_s or self._cpu_s() - self.cpu_s > self.most_s)

    def end(self) -> tuple[str, str, str]:
        """What came of it: the file's name, how, and in words."""
        self.busy = False
        name = self.names[self.number % len(self.names)]
        try:
            if self.pipe.poll():
                how, words = self.pipe.recv()
                return name, how, words
            how, words = "hang", f"not read within {self.most_s:g} s"
        except (EOFError, OSError):
            self.process.join()
            how, words = "crash", f"the process ended with {self.process.exitcode}"
        self._stop()
        self._start()
        return name, how, words


def _work(pipe: Connection, seed: int, made_by: str, directory: str) -> None:
    """Read files as they are asked for, in a process of its own."""
    warnings.simplefilter("ignore")
    logging.getLogger("lidarcheck").setLevel(logging.CRITICAL)
    place = Path(directory)
    made = importlib.import_module(made_by).seeds(place)
    for own in made:
        (place / own.name).write_bytes(own.content)
    for own in made:
        own.read(place / own.name)  # which loads what reading needs
    most = _size() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    pipe.send([own.name for own in made])
    while True:
        own, content = one(seed, pipe.recv(), made)
        file = place / own.name
        file.write_bytes(content)
        pipe.send(_read(own.read, file))
        file.write_bytes(own.content)  # which others may name


def _read(read: Any, file: Path) -> tuple[str, str]:
    from lidarcheck.errors import LidarcheckError

    try:
        read(file)
    except LidarcheckError as error:
        if isinstance(error.__cause__, MemoryError):
            return "memory", "".join(traceback.format_exception(error))
        lines = error.lines()
        wrong = [line for line in lines if not line.startswith("error: ") or len(line) > 2000]
        return ("traceback", f"no line for a user: {wrong[0][:500]}") if wrong or not lines else ("refused", "")
    except MemoryError:
        return "memory", traceback.format_exc()
    except Exception:  # noqa: BLE001 - whatever it is, it is what was looked for
        return "traceback", traceback.format_exc()
    return "read", ""


def _size() -> int:
    """Bytes of address space."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


if sys.platform != "linux":
    raise ImportError("the fuzz of files needs /proc")
