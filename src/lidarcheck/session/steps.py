"""What a number is compared with: the files at the start, before the last step, at the baseline, after each edit."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lidarcheck.session.edited_file import EditedFile
from lidarcheck.session.history import edit_between
from lidarcheck.session.inputs import Inputs
from lidarcheck.session.own_files import content_hash
from lidarcheck.session.session import Session

__all__ = ["STEP_S", "EditMade", "Steps"]

STEP_S = 2.0
"""Edits of the same rows that follow each other within so long are one step."""
_MOST = 500
"""Edits that are kept with what the files held after them."""


@dataclass(frozen=True)
class EditMade:
    """An edit, and the files after it. `number`: the session's count then; `file`: the name of the one it was made
    in.
    """

    number: int
    what: str
    file: str
    contents: Mapping[str, bytes] = field(repr=False)


class Steps:
    """Follows the files that are open in a session; `look` is told of each change, in one thread.

    A state is what the edited files held, by real path: inputs are made of it when they are asked for, so that a file
    that was opened later has in it what it began with.
    """

    def __init__(self, session: Session, clock: Callable[[], float] = time.monotonic) -> None:
        self._session, self._clock = session, clock
        self._start: dict[str, bytes] = {}
        self._now: dict[str, bytes] = {}
        self._before: Mapping[str, bytes] = {}
        self._baseline: Mapping[str, bytes] | None = None
        self._done: dict[str, int] = {}
        self._last: tuple[float, tuple[str, int, int]] = (float("-inf"), ("", 0, 0))
        self.made: deque[EditMade] = deque(maxlen=_MOST)

    # What belongs to which state

    @property
    def start(self) -> Inputs:
        """The files as they were when the session began."""
        return self.inputs_of({})

    @property
    def before(self) -> Inputs:
        """The files as the step of the last edit found them, or as they were when the baseline was set."""
        return self.inputs_of(self._before if self._baseline is None else self._baseline)

    @property
    def has_baseline(self) -> bool:
        """Whether `before` is a baseline that somebody has set."""
        return self._baseline is not None

    def inputs_of(self, contents: Mapping[str, bytes]) -> Inputs:
        """Inputs with the edited files in a state."""
        return Inputs({**self._start, **contents}, self._session.disk, self._session.edits)

    def started_with(self, inputs: Inputs) -> dict[str, bytes]:
        """What files held at the start, by real path; those alone that hold something else in these inputs."""
        return {name: content for name, content in self._start.items() if inputs.digest(name) != content_hash(content)}

    # What happens

    def look(self) -> bool:
        """Take note of what the files hold now; whether that is another state than at the last look."""
        files = {os.path.realpath(file.path): file for file in self._session.open_files()}
        # What is not on the disk, as settings that are the defaults, is an input from its first edit on.
        files = {name: file for name, file in files.items() if file.dirty or file.path.exists()}
        for name, file in files.items():
            if name not in self._start:
                self._start[name] = self._now[name] = file.saved.content or b""
        before = dict(self._now)
        self._now |= {name: file.content for name, file in files.items()}
        changed = [name for name, content in self._now.items() if content != before[name]]
        for name in changed:
            self._step(name, files[name], before)
        return bool(changed)

    def _step(self, name: str, file: EditedFile[Any], before: Mapping[str, bytes]) -> None:
        """An edit, which begins a step unless it goes on with the last one."""
        moment, cells = self._clock(), _cells(name, before[name], self._now[name])
        last_s, last_cells = self._last
        if cells != last_cells or moment - last_s > STEP_S:
            self._before = before
        self._last = moment, cells
        done = len(file.history.done)
        undone = done < self._done.get(name, 0)
        self._done[name] = done
        edit = file.history.last("redo" if undone else "undo")
        what = "read again" if edit is None else f"taken back: {edit.what}" if undone else edit.what
        self.made.append(EditMade(self._session.edits, what, file.path.name, dict(self._now)))

    def set_baseline(self) -> bool:
        """What is set now is what numbers are compared with from now on; once more at the same state: no longer.
        Whether there is a baseline now.
        """
        self._baseline = None if self._baseline == self._now else dict(self._now)
        return self.has_baseline


def _cells(name: str, old: bytes, new: bytes) -> tuple[str, int, int]:
    """Which numbers of a file an edit is about: of text between commas and line ends the first and the last."""
    edit = edit_between(old, new, "")
    if edit is None:
        return name, 0, 0
    end = edit.at + len(edit.old)
    return name, _count(old[: edit.at]), _count(old[:end])


def _count(text: bytes) -> int:
    return sum(text.count(mark) for mark in (b",", b"\n", b"="))
