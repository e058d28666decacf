"""The command palette: any action of the screen that is seen, found by letters of its name or its help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import Input

from lidarcheck.tui.actions import Action, key_name
from lidarcheck.tui.widgets.dialogs import text_input
from lidarcheck.tui.widgets.lines import Lines, line

__all__ = ["Palette"]


class Palette(ModalScreen[Action | None]):
    """Any action, found by letters of its name or its help."""

    CSS = """
    Palette { background: $background; }
    Palette Input { border: none; height: 1; padding: 0; background: $background; }
    """
    AUTO_FOCUS = "Input"
    BINDINGS: ClassVar[list[Any]] = [
        Binding("escape", "dismiss_none", show=False),
        Binding("down", "move(1)", show=False, priority=True),
        Binding("up", "move(-1)", show=False, priority=True),
    ]

    def __init__(self, actions: Sequence[Action]) -> None:
        super().__init__()
        self._actions = [action for action in actions if action.method]
        self._found = self._actions
        self._at = 0

    def compose(self) -> ComposeResult:
        """A line to type in, and what fits."""
        yield text_input("")
        yield Lines("Type a part of the name; Enter does it, Esc leaves", id="found")

    def on_mount(self) -> None:
        """All of them at first."""
        self._show()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Narrow it down."""
        words = event.value.lower().split()
        self._found = [a for a in self._actions if all(word in f"{a.name} {a.help}".lower() for word in words)]
        self._at = 0
        self._show()

    def on_input_submitted(self) -> None:
        """Do what the cursor is on."""
        self.dismiss(self._found[self._at] if self._found else None)

    def action_move(self, by: int) -> None:
        """Up and down."""
        self._at = max(min(self._at + by, len(self._found) - 1), 0)
        self._show()

    def action_dismiss_none(self) -> None:
        """Escape."""
        self.dismiss(None)

    def _show(self) -> None:
        lines = []
        for number, action in enumerate(self._found):
            mark = ">" if number == self._at else " "
            text = f"{mark} {key_name(action.keys[0]):10}{action.name:18}{action.help}"
            lines.append(line(text, "cursor" if number == self._at else "text"))
        self.query_one("#found", Lines).show(lines or [line("  nothing is called so", "dim")], cursor=self._at)
