"""Questions: one that a key answers, one that a text answers, and the palette."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import Input

from lidarcheck.tui.actions.registry import Action
from lidarcheck.tui.widgets.lines import Line, Lines, line

__all__ = ["Ask", "AskText", "Palette"]

_CSS = """
Ask, AskText, Palette { background: $background; }
Ask Input, AskText Input, Palette Input { border: none; height: 1; padding: 0; background: $background; }
"""
_SCROLL = {"pagedown": 1, "pageup": -1, "down": 1, "up": -1, "space": 1}


UNASKED_S = 0.7
"""For how long a question that comes by itself takes no key: what was typed then was meant for the screen below."""


class Ask(ModalScreen[str | None]):
    """A question with what belongs to it; one of `answers` (key: what it does) or Escape.

    `unasked`: it comes by itself, as a file is changed or a review ends, perhaps while something else is typed.
    """

    CSS = _CSS

    def __init__(self, title: str, lines: Sequence[Line], answers: Mapping[str, str], *, unasked: bool = False) -> None:
        super().__init__()
        self._deaf_s = UNASKED_S if unasked else 0.0
        self._shown_s = 0.0
        self._title, self._lines, self._answers = title, list(lines), dict(answers)

    def compose(self) -> ComposeResult:
        """The text, and the answers in the last line."""
        yield Lines(self._title, id="question", folds=True)
        yield Lines(id="answers", bar=True)

    def on_mount(self) -> None:
        """Fill both."""
        self._shown_s = time.monotonic()
        self.query_one("#question", Lines).show(self._lines)
        keys = "   ".join(f"{key} {what}" for key, what in [*self._answers.items(), ("Esc", "back")])
        self.query_one("#answers", Lines).show([line(keys, "title")])
        self.query_one("#question", Lines).focus()

    def on_key(self, event: events.Key) -> None:
        """Answer, scroll or leave."""
        event.stop()
        if time.monotonic() - self._shown_s < self._deaf_s:
            return
        key = "Enter" if event.key == "enter" else event.character or event.key
        if key in self._answers:
            self.dismiss(key)
        elif event.key in ("escape", "q", "f1"):
            self.dismiss(None)
        elif event.key in _SCROLL:
            self.query_one("#question", Lines).page(_SCROLL[event.key])


class AskText(ModalScreen[str | None]):
    """A question that a text answers."""

    CSS = _CSS
    AUTO_FOCUS = "Input"
    BINDINGS: ClassVar[list[Any]] = [Binding("escape", "dismiss_none", show=False)]

    def __init__(self, title: str, value: str = "", lines: Sequence[Line] = ()) -> None:
        super().__init__()
        self._title, self._value, self._lines = title, value, list(lines)

    def compose(self) -> ComposeResult:
        """The question and a line to type in."""
        yield Lines(self._title, id="question", folds=True)
        yield _input(self._value)

    def on_mount(self) -> None:
        """What belongs to the question."""
        self.query_one("#question", Lines).show(self._lines)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Enter."""
        self.dismiss(event.value.strip() or None)

    def action_dismiss_none(self) -> None:
        """Escape."""
        self.dismiss(None)


class Palette(ModalScreen[Action | None]):
    """Any action, found by letters of its name or its help."""

    CSS = _CSS
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
        yield _input("")
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


def _input(value: str) -> Input:
    field: Any = Input(value, select_on_focus=False)
    field.cursor_blink = False
    return field  # type: ignore[no-any-return]


_NAMES = {
    "plus": "+", "minus": "-", "equals_sign": "=", "right_square_bracket": "]", "left_square_bracket": "[",
    "escape": "Esc", "pagedown": "PgDn", "pageup": "PgUp",
}  # fmt: skip


def key_name(key: str) -> str:
    """A key as people call it."""
    if key in _NAMES:
        return _NAMES[key]
    if key.startswith("ctrl+"):
        return f"^{key[5:].upper()}"
    return key if len(key) == 1 else "+".join(part.capitalize() for part in key.split("+"))
