"""Finding what can be done: the palette by letters, the menu by keys; and going to a screen or a pane by its letter."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events

from lidarcheck.tui.actions import Action, key_name
from lidarcheck.tui.widgets.lines import Line
from lidarcheck.tui.widgets.listing import Listing
from lidarcheck.tui.widgets.overlay import Dialog
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["Jump", "Menu", "Palette"]

_KEYS, _NAMES = 10, 16


class _Actions(Listing[Action]):
    """Actions that can be done, with their keys."""

    def __init__(self, title: str, actions: Sequence[Action]) -> None:
        self.able = [action for action in actions if action.method]
        super().__init__(title, self.able)

    def row(self, item: Action, width: int) -> Line:
        """Key, name and help."""
        keys = key_name(item.keys[0]) if item.keys else ""
        return ((f"{keys:{_KEYS}}", "title"), (f"{item.name:{_NAMES}} ", "text"), (item.help, "dim"))


class Palette(_Actions):
    """Any action, found by parts of its name or its help."""

    keys = "Type a part of the name   Enter does it   Esc or ^G back"

    def __init__(self, actions: Sequence[Action]) -> None:
        super().__init__("Find an action", actions)
        self.typed = Typed()

    def changed(self) -> None:
        """Narrow it down."""
        words = self.typed.text.lower().split() if self.typed else []
        self.list_again([a for a in self.able if all(word in f"{a.name} {a.help}".lower() for word in words)])


class Menu(_Actions):
    """What can be done here; the key of an action does it, as it would without the menu."""

    keys = "Enter or its key does it   Esc or ^G back"

    def key(self, event: events.Key) -> None:
        """Do what the key does."""
        action = next((action for action in self.items if event.key in action.keys), None)
        if action is None or event.key == "enter":
            super().key(event)
        else:
            self.dismiss(action)


class Jump(Dialog[str]):
    """Gives the letter that is pressed. The letters lie over tabs and titles, and it has no box."""

    boxed = False

    def __init__(self) -> None:
        super().__init__("")

    def body(self, width: int) -> list[Line]:
        """Nothing."""
        return []

    def key(self, event: events.Key) -> None:
        """Any letter."""
        self.dismiss(event.character or event.key)
