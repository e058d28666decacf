"""A list of what can be switched on and off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from textual import events
from textual.app import ComposeResult
from textual.screen import ModalScreen

from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, Lines, cursor_after, line

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


class Choose(ModalScreen[frozenset[str] | None]):
    """Gives the names that are on when Enter is pressed; None after Escape."""

    CSS = "Choose { background: $background; }"

    def __init__(self, title: str, switches: Sequence[Switch]) -> None:
        super().__init__()
        self._title, self._switches = title, list(switches)
        self.on = {switch.name for switch in switches if switch.on}
        self.at = 0

    def compose(self) -> ComposeResult:
        """The list, and the keys in the last line."""
        yield Lines(self._title, id="switches")
        yield Lines(id="answers", bar=True)

    def on_mount(self) -> None:
        """Fill both."""
        keys = "Space on or off   a none, or as it was   Enter takes it   Esc back"
        self.query_one("#answers", Lines).show([line(keys, "title")])
        self.query_one("#switches", Lines).focus()
        self._show()

    def on_key(self, event: events.Key) -> None:
        """Switch, move, take or leave."""
        event.stop()
        if event.key in CURSOR_KEYS:
            rows = max(self.query_one("#switches", Lines).rows, 1)
            self.at = cursor_after(event.key, self.at, len(self._switches), rows)
        elif event.key == "space" and self._switches and self._switches[self.at].able:
            self.on ^= {self._switches[self.at].name}
        elif event.key == "a":
            self.on = set() if self.on else {switch.name for switch in self._switches if switch.on}
        elif event.key == "enter":
            self.dismiss(frozenset(self.on))
            return
        elif event.key in ("escape", "q"):
            self.dismiss(None)
            return
        self._show()

    def _show(self) -> None:
        self.query_one("#switches", Lines).show(
            [self._line(number, switch) for number, switch in enumerate(self._switches)]
            or [line("  there is nothing to choose", "dim")],
            cursor=self.at,
        )

    def _line(self, number: int, switch: Switch) -> Line:
        mark = ("x" if switch.name in self.on else " ") if switch.able else "-"
        text = f"{'>' if number == self.at else ' '}[{mark}] {switch.name:26} "
        return ((text, "text" if switch.able else "dim"), (switch.words, "dim"))
