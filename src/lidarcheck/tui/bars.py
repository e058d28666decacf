"""The bars above and below the screens, and the log: what the interface says."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Sequence

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.project import Project
from lidarcheck.tui.actions import SCREENS, Action, key_name
from lidarcheck.tui.entries import Entry, key_entries, line_of, tab_entries
from lidarcheck.tui.host import STOPS
from lidarcheck.tui.widgets.lines import Line, Lines, line, printable
from lidarcheck.tui.widgets.seven_bit import is_seven_bit
from lidarcheck.tui.widgets.themes import Role

__all__ = ["Bars"]

_KEPT_LINES, _ROOM_FOR_NAME = 1000, 100
_LEAST_ROOM = 40
"""Columns that what was said has at least beside the sensor's name."""
_READ_S = 4.0
"""How long a line that was said stands before the progress of a run takes its place again."""


class Bars:
    """Four lines and a pane. `context`: filled by `context.context_line`; `status`: what was said last, and whether it
    is bad.

    `sensor`: what the project's models are of, besides the built-in SPAD arrays. `labelled`: the tabs show the letters
    to jump by. `tabs`, `entries`: what of the first and the last line is where.
    """

    def __init__(self) -> None:
        names = ("top", "context", "status", "keys")
        self.top, self.context, self.below, self.keys = (Lines(id=name, bar=True) for name in names)
        self.log = Lines("Log", label="l", id="log", folds=True)
        self.said: deque[tuple[str, bool]] = deque(maxlen=_KEPT_LINES)
        self.status: tuple[str, bool] = ("reading the project ...", False)
        self.sensor = ""
        self._width = 80
        self._progress: dict[str, str] = {}
        self._waits = ""
        self._screen = ""
        self._said_s = float("-inf")
        self._project = ""
        self.seven_bit = is_seven_bit(os.environ)
        self.labelled = False
        self.tabs: list[Entry] = []
        self.entries: list[Entry] = []

    def show(self, screen: str, project: Project, width: int) -> None:
        """The tabs and what was said, for the screen that is seen."""
        self._screen, self._width = screen, width
        self._project = project.root.resolve().name
        self._show_tabs()
        self._show_status()

    def _show_tabs(self) -> None:
        if not self._screen:
            return
        how = {"bracketed": self.seven_bit, "labelled": self.labelled}
        self.tabs = tab_entries(self._screen, self._progress.keys(), self._width, **how)
        tabs = line_of(self.tabs)
        if self._width >= _ROOM_FOR_NAME and not self.labelled:
            tabs = (*tabs, (f"   lidarcheck: {self._project}", "title"))
        self.top.show([tabs])

    def show_labels(self, are_shown: bool) -> None:
        """The letters to jump by, in the tabs."""
        self.labelled = are_shown
        self._show_tabs()

    def show_keys(self, actions: Sequence[Action], width: int) -> None:
        """The last line: what can be done here."""
        self.entries = key_entries(actions, width)
        self.keys.show([line_of(self.entries)])

    def _show_status(self) -> None:
        running = self._running() if time.monotonic() - self._said_s >= _READ_S else ""
        text, bad = (running, False) if running else self.status
        role: Role = "bad" if bad else "text"
        room = self._width - len(self.sensor) - 3
        if not self.sensor or room < _LEAST_ROOM:
            self.below.show([line(text, role)])
        else:
            cut = text if len(text) <= room else f"{text[: room - 1]}…"
            self.below.show([((f"{cut:{room}}  ", role), (self.sensor, "dim"))])

    def _running(self) -> str:
        """The progress of the screen that is seen; else that of another, which x does not stop from here; else what
        numbers wait for.
        """
        if self._screen in self._progress:
            return self._progress[self._screen]
        others = (f"{key_name(SCREENS[name].key)} {text}" for name, text in self._progress.items())
        return next(others, self._waits).removesuffix(STOPS)

    def progress(self, text: str, screen: str) -> None:
        """What a run of a screen says while it runs; empty when it has ended."""
        if not text:
            self._progress.pop(screen, None)
        else:
            if screen not in self._progress:
                self._said_s = float("-inf")
            self._progress[screen] = text
        self._show_status()
        self._show_tabs()

    def wait(self, why: str) -> None:
        """What keeps numbers waiting, for as long as it does; empty for nothing."""
        if why and why != self._waits:
            self._said_s = float("-inf")
        self._waits = why
        self._show_status()

    def say(self, text: str | LidarcheckError, project: Project, bad: bool) -> None:
        """One line for the user, which the log keeps."""
        bad = bad or isinstance(text, LidarcheckError)
        lines = text.lines() if isinstance(text, LidarcheckError) else [text]
        for one in lines:
            self.note(project.inside(one), bad)
        more = f" (and {len(lines) - 1} more: L)" if len(lines) > 1 else ""
        self.status = (printable(project.inside(lines[0])) + more, bad)
        self._said_s = time.monotonic()
        self._show_status()

    def note(self, text: str, bad: bool) -> None:
        """A line for the log alone."""
        self.said.append((f"{time.strftime('%H:%M:%S')} {text}", bad))
        if self.log.has_class("shown"):
            self.show_log()

    def show_log(self) -> None:
        """The log's lines, the last one in sight."""
        lines: list[Line] = [line(text, "bad" if bad else "dim") for text, bad in self.said]
        self.log.show(lines, cursor=len(self.said) - 1)
