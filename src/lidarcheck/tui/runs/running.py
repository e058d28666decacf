"""The run that goes on, and those before: started, told of, stopped, noted in the project's journal of runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import clock_text
from lidarcheck.session.runs import Plan, Run, RunBook
from lidarcheck.tui.host import STOPS, Host
from lidarcheck.tui.jobs.commands import PROGRAM, CommandProcess, CommandProgress
from lidarcheck.tui.widgets.lines import Line, hanging, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["CommandRuns"]

_SHOWN_S = 0.25
_ROLES: dict[str, Role] = {"done": "good", "running": "edited", "stopped": "dim"}


class CommandRuns:
    """One command runs at a time. `on_end`: hears of a run that is done; `on_change`: the list has changed."""

    def __init__(self, host: Host, program: Sequence[str] = PROGRAM) -> None:
        self.host, self.program = host, tuple(program)
        self.run: Run | None = None
        self.on_end: Callable[[Run], object] = lambda _run: None
        self.on_change: Callable[[], object] = lambda: None
        self._book: RunBook | None = None
        self._process: CommandProcess[CommandProgress] | None = None
        self._step = 0
        self._screen = ""
        self._shown_s = 0.0

    @property
    def book(self) -> RunBook:
        """The journal of the project's runs."""
        if self._book is None:
            self._book = RunBook(self.host.project.root)
        return self._book

    @property
    def running(self) -> bool:
        """Whether a run goes on."""
        return self.run is not None

    # Starting and stopping

    def start(self, plan: Plan, screen: str) -> bool:
        """Run a plan; whether it has begun. `screen`: where its progress is told."""
        if self.running:
            self.host.say("a command is running; x stops it")
            return False
        try:
            self.run, self._step, self._screen = self.book.begin(plan), 0, screen
            self._begin_step()
        except (LidarcheckError, OSError) as error:
            if self.run is not None:
                self.book.end(self.run, 2, str(error).removeprefix("error: "))
            self.run = None
            self.host.say(error if isinstance(error, LidarcheckError) else f"cannot be started: {error}", bad=True)
            return False
        self.host.say(f"{plan.name} runs; x stops it")
        self.on_change()
        return True

    def _begin_step(self) -> None:
        assert self.run is not None
        soon = self.host.soon
        self._process = CommandProcess(
            [*self.program, *self.run.steps[self._step]],
            CommandProgress(),
            on_progress=lambda: soon(self._progressed),
            on_line=lambda text: soon(self.host.note, text, text.startswith("error")),
            on_end=lambda code: soon(self._ended, code),
            output=self.book.directory(self.run) / f"output{self._step or ''}.txt",
            directory=self.book.root,
            environment={"LIDARCHECK_PROGRESS": "json"},
        )
        self.run = self.book.process(self.run, self._process.number)

    def stop(self) -> None:
        """Stop the run, or end it at once."""
        if self._process is None:
            self.host.say("no command is running")
        elif self._process.stop():
            self.host.say("ended at once; what was kept stays")
        else:
            self.host.say("stopping; x once more ends it at once")

    def closing(self) -> None:
        """The interface ends, and the run with it."""
        if self._process is not None:
            self._process.stop()

    # What it tells

    def _progressed(self) -> None:
        now = time.monotonic()
        if self._process is None or self.run is None or now - self._shown_s < _SHOWN_S:
            return
        self._shown_s = now
        self.host.progress(f"{self.run.name}: {self.far_in_words()}{STOPS}", self._screen)
        self.on_change()

    def far_in_words(self) -> str:
        """How far the run is."""
        if self._process is None or self.run is None:
            return ""
        elapsed = clock_text(time.time() - self.run.started)
        return f"{self._process.progress.in_words() or 'starting'}, {elapsed} so far"

    def _ended(self, code: int) -> None:
        """A step has ended: the next one, or what became of it all."""
        if self.run is None or self._process is None:
            return
        progress, self._process = self._process.progress, None
        if code == 0 and self._step + 1 < len(self.run.steps):
            self._step += 1
            try:
                self._begin_step()
            except LidarcheckError as error:
                self._finish(2, error.lines()[0].removeprefix("error: "))
            return
        self._finish(code, progress.fault if code else "")

    def _finish(self, code: int, fault: str) -> None:
        run, self.run = self.run, None
        assert run is not None
        try:
            run = self.book.end(run, code, fault)
        except (LidarcheckError, OSError) as error:
            self.host.note(f"the run is not noted: {error}", True)
        self.host.progress("", self._screen)
        words = {"done": "done"}.get(run.state, run.state)
        self.host.say(f"{run.name}: {words}", bad=code not in (0, 130))
        self.on_change()
        if code == 0:
            self.on_end(run)

    # The list

    def look(self) -> None:
        """Look at runs that an earlier interface has started."""
        if self.book.look():
            self.on_change()

    def lines(self) -> list[Line]:
        """The runs, the last first: how each ended, when, its command."""
        found: list[Line] = []
        for run in self.book.runs:
            state = run.state
            if self.run is not None and run.number == self.run.number:
                state = f"running: {self.far_in_words()}"
            elif state == "done" and run.taken:
                state = "done, taken over"
            when = time.strftime("%m-%d %H:%M", time.localtime(run.started))
            role = _ROLES.get(state.partition(":")[0].partition(",")[0], "bad")
            found.append(((f" {run.number:>3} {when} ", "dim"), (f"{run.name:12} ", "text"), (state, role)))
        return found

    def words(self, run: Run, width: int) -> list[Line]:
        """A run: its command, how it ended, and what it has printed."""
        lines = hanging(run.line, width, "title")
        if run.fault:
            lines += hanging(run.fault, width, "bad")
        for path in sorted(self.book.directory(run).glob("output*.txt")):
            lines += [line(f" {text}") for text in _read(path)]
        return lines


def _read(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()[:500]
    except OSError:
        return []
