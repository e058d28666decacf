"""The command palette: any action of the screen that is seen, found by letters of its name or its help."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events

from lidarcheck.tui.actions import Action, key_name
from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, cursor_after, line
from lidarcheck.tui.widgets.overlay import Dialog
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["Palette"]


class Palette(Dialog[Action]):
    """Any action, found by letters of its name or its help."""

    steady = True
    widest = 84
    keys = "Type a part of the name   Enter does it   Esc or ^G back"

    def __init__(self, actions: Sequence[Action]) -> None:
        super().__init__("Find an action")
        self.typed = Typed()
        self._actions = [action for action in actions if action.method]
        self._found = self._actions
        self._at = 0

    def changed(self) -> None:
        """Narrow it down."""
        words = self.typed.text.lower().split() if self.typed else []
        self._found = [a for a in self._actions if all(word in f"{a.name} {a.help}".lower() for word in words)]
        self._at = 0

    def key(self, event: events.Key) -> None:
        """Do what the cursor is on, or move it."""
        if event.key == "enter":
            self.dismiss(self._found[self._at] if self._found else None)
        elif event.key in CURSOR_KEYS:
            self._at = cursor_after(event.key, self._at, len(self._found), max(self.rows, 1))

    def clicked(self, number: int) -> None:
        """Do it."""
        if number < len(self._found):
            self.dismiss(self._found[number])

    def cursor(self) -> int | None:
        """The action that Enter does."""
        return self._at

    def body(self, width: int) -> list[Line]:
        """An action a line."""
        lines = []
        for number, action in enumerate(self._found):
            mark = ">" if number == self._at else " "
            text = f"{mark} {key_name(action.keys[0]):10}{action.name:18}{action.help}"
            lines.append(line(text, "cursor" if number == self._at else "text"))
        return lines or [line("nothing is called so", "dim")]
