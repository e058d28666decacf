"""A line that is typed: its text, where the cursor is, and what keys do to it."""

from __future__ import annotations

import re
from collections.abc import Callable

from lidarcheck.tui.widgets.lines import Line

__all__ = ["Typed"]

_LONGEST = 500
_NO_LETTER = re.compile(r"[\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ufeff]|[\ud800-\udfff]")


class Typed:
    """`text`, and the cursor before its letter number `at`."""

    def __init__(self, text: str = "") -> None:
        self.text = text
        self.at = len(text)

    def insert(self, text: str) -> None:
        """Put a text in at the cursor: the first line of what was pasted, without control characters."""
        first = next((part for part in text.splitlines() if part.strip()), "") if len(text) > 1 else text
        clean = _NO_LETTER.sub("", first)[: max(_LONGEST - len(self.text), 0)]
        self.text = f"{self.text[: self.at]}{clean}{self.text[self.at :]}"
        self.at += len(clean)

    def key(self, key: str, character: str | None) -> bool:
        """Do what a key does here; whether it does anything."""
        if key in _MOVES:
            self.at = _MOVES[key](self.text, self.at)
        elif key in _CUTS:
            start, end = sorted((self.at, _CUTS[key](self.text, self.at)))
            self.text, self.at = f"{self.text[:start]}{self.text[end:]}", start
        elif character is not None and character.isprintable():
            self.insert(character)
        else:
            return False
        return True

    def line(self, width: int) -> Line:
        """The part of it that is seen in so many columns, with the cursor."""
        first = max(self.at - max(width, 1) + 1, 0)
        seen = f"{self.text} "[first : first + max(width, 1)]
        here = self.at - first
        return ((seen[:here], "text"), (seen[here : here + 1], "cursor"), (seen[here + 1 :], "text"))


def _word_before(text: str, at: int) -> int:
    """Where the word before the cursor begins."""
    before = text[:at].rstrip()
    return max(before.rfind(" "), before.rfind("/")) + 1


_Moves = dict[str, Callable[[str, int], int]]
_MOVES: _Moves = {
    "left": lambda _text, at: max(at - 1, 0),
    "right": lambda text, at: min(at + 1, len(text)),
    "home": lambda _text, _at: 0,
    "ctrl+a": lambda _text, _at: 0,
    "end": lambda text, _at: len(text),
    "ctrl+e": lambda text, _at: len(text),
}
_CUTS: _Moves = {
    "backspace": lambda _text, at: max(at - 1, 0),
    "delete": lambda text, at: min(at + 1, len(text)),
    "ctrl+u": lambda _text, _at: 0,
    "ctrl+k": lambda text, _at: len(text),
    "ctrl+w": _word_before,
}
