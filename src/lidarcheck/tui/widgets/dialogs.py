"""Questions: one that a key answers, and one that a text answers."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import Input

from lidarcheck.tui.widgets.lines import Line, Lines, line

__all__ = ["Ask", "AskText", "text_input"]

_CSS = """
Ask, AskText { background: $background; }
Ask Input, AskText Input { border: none; height: 1; padding: 0; background: $background; }
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
        self._ignores_keys_s = UNASKED_S if unasked else 0.0
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
        if time.monotonic() - self._shown_s < self._ignores_keys_s:
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
        yield text_input(self._value)

    def on_mount(self) -> None:
        """What belongs to the question."""
        self.query_one("#question", Lines).show(self._lines)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Enter."""
        self.dismiss(event.value.strip() or None)

    def action_dismiss_none(self) -> None:
        """Escape."""
        self.dismiss(None)


def text_input(value: str) -> Input:
    """A line to type in, as all of the interface's are: without a frame or a blinking cursor."""
    field: Any = Input(value, select_on_focus=False)
    field.cursor_blink = False
    return field  # type: ignore[no-any-return]
