"""The commands that were started from the interface: what each was, how it ended, and where its results lie.

Each has a directory in `.lidarcheck/tui/runs`, whose `run.json` is written when the run begins, when it ends, and when
its results are taken over.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shlex
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import write_text
from lidarcheck.session.own_files import make_own_directory, own_directory
from lidarcheck.trust.places import own_place

__all__ = ["Plan", "Run", "RunBook", "line_of"]

_RECORD, _MOST = "run.json", 40
DONE, STOPPED, RUNNING = "done", "stopped", "running"


@dataclass(frozen=True)
class Plan:
    """What is to be run in the project's directory. `steps`: the arguments of each command, one after the other.

    `makes`: the file that is there when all is done; `takes`: what its results are for, by what they are (`table`,
    `model`, ...), and what else the taking over needs; `copies`: contents that are not on the disk, by the files that
    the command reads them from. Paths are relative to the project.
    """

    name: str
    steps: tuple[tuple[str, ...], ...]
    makes: str
    takes: Mapping[str, str] = field(default_factory=dict)
    copies: Mapping[str, bytes] = field(default_factory=dict)


def line_of(steps: tuple[tuple[str, ...], ...]) -> str:
    """The commands as a shell takes them."""
    return " && ".join(shlex.join(("lidarcheck", *step)) for step in steps)


@dataclass(frozen=True)
class Run:
    """A run. `started`, `ended`: seconds since the epoch, None while it goes on; `process`: its number, and since when
    it is there in the system's own ticks; `code`: the exit code; `fault`: the error that it ended with.
    """

    number: int
    name: str
    steps: tuple[tuple[str, ...], ...]
    makes: str
    takes: Mapping[str, str]
    started: float
    process: tuple[int, int] = (0, 0)
    ended: float | None = None
    code: int | None = None
    fault: str = ""
    taken: bool = False

    @property
    def line(self) -> str:
        """The commands as a shell takes them."""
        return line_of(self.steps)

    @property
    def state(self) -> str:
        """`running`, `done`, `stopped`, or `failed: WHY`."""
        if self.ended is None:
            return RUNNING
        if self.code == 0:
            return DONE
        return f"failed: {self.fault}" if self.fault else STOPPED


class RunBook:
    """The runs of a project, the last one first."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.runs: list[Run] = []
        with contextlib.suppress(OSError):
            found = [_read(path / _RECORD) for path in (own_directory(root) / "runs").iterdir()]
            self.runs = sorted((run for run in found if run is not None), key=lambda run: -run.number)
        for run in [run for run in self.runs if run.ended is None and not self.is_alive(run)]:
            with contextlib.suppress(InputError, OSError):
                self._keep(self._unseen(run))

    @property
    def next_directory(self) -> str:
        """Where the results of the next run will lie, relative to the project."""
        return self._name(1 + max((run.number for run in self.runs), default=0))

    def directory(self, run: Run) -> Path:
        """Where the results of a run lie."""
        return self.root / self._name(run.number)

    def _name(self, number: int) -> str:
        return (own_directory(Path()) / "runs" / str(number)).as_posix()

    def begin(self, plan: Plan) -> Run:
        """Note that a run begins, and make its directory with what it reads; `InputError` where that cannot be."""
        number = 1 + max((run.number for run in self.runs), default=0)
        run = Run(number, plan.name, plan.steps, plan.makes, dict(plan.takes), time.time())
        make_own_directory(self.root)
        directory = self.directory(run)
        try:
            own_place(directory, self.root).mkdir(parents=True)
            for name, content in plan.copies.items():
                own_place(self.root / name, self.root).parent.mkdir(parents=True, exist_ok=True)
                (self.root / name).write_bytes(content)
        except OSError as error:
            what = f"cannot make the directory: {error.strerror}"
            raise InputError(what, file=directory, fix="make the project's directory writable") from error
        self._keep(run)
        self._drop_old()
        return run

    def process(self, run: Run, number: int) -> Run:
        """It is this process that runs it now."""
        return self._keep(dataclasses.replace(run, process=(number, _born(number))))

    def end(self, run: Run, code: int, fault: str = "") -> Run:
        """It has ended."""
        return self._keep(dataclasses.replace(run, ended=time.time(), code=code, fault=fault))

    def took(self, run: Run) -> Run:
        """Its results were taken over."""
        return self._keep(dataclasses.replace(run, taken=True))

    def _keep(self, run: Run) -> Run:
        self.runs = sorted([run, *(one for one in self.runs if one.number != run.number)], key=lambda one: -one.number)
        directory = own_place(self.directory(run), self.root)
        if directory.is_dir():
            write_text(directory / _RECORD, json.dumps(asdict(run), indent=1) + "\n")
        return run

    def _drop_old(self) -> None:
        """Runs of long ago go, with what they wrote."""
        for run in self.runs[_MOST:]:
            if run.ended is not None:
                with contextlib.suppress(InputError, OSError):
                    shutil.rmtree(own_place(self.directory(run), self.root))
        self.runs = [run for run in self.runs if self.directory(run).is_dir()]

    # Runs whose end nobody saw

    def is_alive(self, run: Run) -> bool:
        """Whether the process of a run is there, and not another one that has its number now."""
        number, born = run.process
        return born > 0 and _born(number) == born

    def look(self) -> bool:
        """Look at runs that an earlier interface has started; whether one of them has ended."""
        ended = [run for run in self.runs if run.ended is None and not self.is_alive(run)]
        for run in ended:
            self._keep(self._unseen(run))
        return bool(ended)

    def _unseen(self, run: Run) -> Run:
        """It ended while nobody looked: with all that it makes, or without."""
        made = self.root / run.makes
        try:
            when = made.stat().st_mtime
        except OSError:
            return dataclasses.replace(run, ended=time.time(), code=130)
        return dataclasses.replace(run, ended=when, code=0 if when >= run.started - 1.0 else 130)


def _born(process: int) -> int:
    """Since when a process is there, in ticks since the system's start; 0 for none, also for one that has ended."""
    try:
        words = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
        return 0 if words[0] == "Z" else int(words[19])
    except (OSError, ValueError, IndexError):
        return 0


def _read(path: Path) -> Run | None:
    """A run of an earlier session; None for what is no record of one."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        steps = tuple(tuple(str(word) for word in step) for step in found["steps"])
        takes = {str(name): str(value) for name, value in found["takes"].items()}
        number, born = (int(one) for one in found["process"])
        ended, code = found["ended"], found["code"]
        return Run(
            number=int(found["number"]),
            name=str(found["name"]),
            steps=steps,
            makes=str(found["makes"]),
            takes=takes,
            started=float(found["started"]),
            process=(number, born),
            ended=None if ended is None else float(ended),
            code=None if code is None else int(code),
            fault=str(found["fault"]),
            taken=found["taken"] is True,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
