"""A list of what can be switched on and off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from textual import events

from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, cursor_after, line
from lidarcheck.tui.widgets.overlay import Dialog
from lidarcheck.tui.widgets.themes import Role

__all__ = ["Choose", "Switch"]


class Switch(Protocol):
    """A line of the list; `able`: whether it can be switched."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def on(self) -> bool:
        """How it is at first."""

    @property
    def words(self) -> str:
        """What is beside it."""

    @property
    def able(self) -> bool:
        """Whether it can be switched."""


class Choose(Dialog[frozenset[str]]):
    """Gives the names that are on when Enter is pressed; None after Escape."""

    keys = "Space on or off   a none, or as it was   Enter takes it   Esc or ^G back"

    def __init__(self, title: str, switches: Sequence[Switch]) -> None:
        super().__init__(title)
        self.switches = list(switches)
        self.on = {switch.name for switch in switches if switch.on}
        self.line = 0

    def key(self, event: events.Key) -> None:
        """Switch, move, take or leave."""
        if event.key in CURSOR_KEYS:
            self.line = cursor_after(event.key, self.line, len(self.switches), max(self.rows, 1))
        elif event.key == "space":
            self._switch()
        elif event.key == "a":
            self.on = set() if self.on else {switch.name for switch in self.switches if switch.on}
        elif event.key == "enter":
            self.dismiss(frozenset(self.on))
        elif event.key == "q":
            self.dismiss(None)

    def _switch(self) -> None:
        if self.switches and self.switches[self.line].able:
            self.on ^= {self.switches[self.line].name}

    def clicked(self, number: int) -> None:
        """As Space on that line."""
        if number < len(self.switches):
            self.line = number
            self._switch()

    def cursor(self) -> int | None:
        """The line that Space switches."""
        return self.line

    def body(self, width: int) -> list[Line]:
        """A line each."""
        return [self._line(number, switch) for number, switch in enumerate(self.switches)] or [
            line("there is nothing to choose", "dim")
        ]

    def _line(self, number: int, switch: Switch) -> Line:
        mark = ("x" if switch.name in self.on else " ") if switch.able else "-"
        here = number == self.line
        text = f"{'>' if here else ' '}[{mark}] {switch.name:26} "
        role: Role = "cursor" if here else "text" if switch.able else "dim"
        return ((text, role), (switch.words, "cursor" if here else "dim"))
