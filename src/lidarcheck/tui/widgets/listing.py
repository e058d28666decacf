"""A list in the box, of which one line is taken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from textual import events

from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, cursor_after, line
from lidarcheck.tui.widgets.overlay import Dialog

__all__ = ["Listing"]

T = TypeVar("T")


class Listing(Dialog[T]):
    """`items`: what is listed; `number`: the one that Enter takes."""

    steady = True
    widest = 84
    empty = "nothing is called so"

    def __init__(self, title: str, items: Sequence[T]) -> None:
        super().__init__(title)
        self.items = list(items)
        self.number = 0

    def row(self, item: T, width: int) -> Line:
        """The line of an item, without the mark of the cursor."""
        raise NotImplementedError

    def list_again(self, items: Sequence[T]) -> None:
        """Other items, with the cursor on the first."""
        self.items, self.number = list(items), 0

    def key(self, event: events.Key) -> None:
        """Take the item under the cursor, or move it."""
        if event.key == "enter":
            self.dismiss(self.items[self.number] if self.items else None)
        elif event.key in CURSOR_KEYS:
            self.number = cursor_after(event.key, self.number, len(self.items), max(self.rows, 1))

    def wheel(self, by: int) -> None:
        """Move the cursor."""
        self.number = max(min(self.number + by, len(self.items) - 1), 0)

    def clicked(self, number: int) -> None:
        """Take that one."""
        if number < len(self.items):
            self.dismiss(self.items[number])

    def cursor(self) -> int | None:
        """The line that is to be seen."""
        return self.number

    def body(self, width: int) -> list[Line]:
        """A line each; that of the cursor reversed, behind a mark."""
        lines: list[Line] = []
        for number, item in enumerate(self.items):
            row = self.row(item, width - 2)
            here = number == self.number
            lines.append((("> ", "cursor"), *((text, "cursor") for text, _ in row)) if here else (("  ", "text"), *row))
        return lines or [line(self.empty, "dim")]
