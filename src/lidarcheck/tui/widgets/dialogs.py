"""Questions: one that a key answers, and one that a text answers."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from textual import events

from lidarcheck.tui.widgets.lines import Line, folded
from lidarcheck.tui.widgets.overlay import Dialog
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["Ask", "AskText"]

_SCROLL = {"pagedown": 1, "pageup": -1, "space": 1}
_STEP = {"down": 1, "up": -1}
_LAST = 10**6


UNASKED_S = 0.7
"""For how long a question that comes by itself takes no key: what was typed then was meant for the screen below."""


class Ask(Dialog[str]):
    """A question with what belongs to it; one of `answers` (key: what it does), or None.

    `unasked`: it comes by itself, as a file is changed or a review ends, perhaps while something else is typed.
    """

    def __init__(self, title: str, lines: Sequence[Line], answers: Mapping[str, str], *, unasked: bool = False) -> None:
        super().__init__(title)
        self.ignores_keys_s = UNASKED_S if unasked else 0.0
        self._shown_s = 0.0
        self._lines, self._answers = list(lines), dict(answers)
        self.keys = "   ".join(f"{key} {what}" for key, what in [*self._answers.items(), ("Esc or ^G", "back")])

    def opened(self) -> None:
        """From now on."""
        self._shown_s = time.monotonic()

    @property
    def text(self) -> str:
        """What belongs to it, as text."""
        return "".join(f"{''.join(text for text, _ in parts).rstrip()}\n" for parts in self._lines)

    def body(self, width: int) -> list[Line]:
        """What belongs to it."""
        return [part for parts in self._lines for part in folded(parts, width)]

    def listens(self) -> bool:
        """Not while what is typed was meant for the screen."""
        return time.monotonic() - self._shown_s >= self.ignores_keys_s

    def key(self, event: events.Key) -> None:
        """Answer, scroll or leave."""
        key = "Enter" if event.key == "enter" else event.character or event.key
        if key in self._answers:
            self.dismiss(key)
        elif event.key in ("q", "f1", "question_mark", "enter") and (event.key != "enter" or not self._answers):
            self.dismiss(None)
        elif event.key in _SCROLL:
            self.page(_SCROLL[event.key])
        elif event.key in _STEP:
            self.top += _STEP[event.key]
        elif event.key in ("home", "end"):
            self.top = _LAST if event.key == "end" else 0


class AskText(Dialog[str]):
    """A question that a text answers; None for an empty one."""

    keys = "Enter takes it   ^U empties the line   Esc or ^G back"

    def __init__(self, title: str, value: str = "", lines: Sequence[Line] = ()) -> None:
        super().__init__(title)
        self.typed = Typed(value)
        self._lines = list(lines)

    def body(self, width: int) -> list[Line]:
        """What belongs to it."""
        return [part for parts in self._lines for part in folded(parts, width)]

    def key(self, event: events.Key) -> None:
        """Enter; the rest scrolls."""
        if event.key == "enter" and self.typed is not None:
            self.dismiss(self.typed.text.strip() or None)
        elif event.key in _SCROLL:
            self.page(_SCROLL[event.key])
