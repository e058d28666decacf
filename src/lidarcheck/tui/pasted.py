"""What is pasted, as text alone: escape sequences in it are not keys."""

from __future__ import annotations

import re

__all__ = ["Pasted"]

_START, _END = "\x1b[200~", "\x1b[201~"
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
_MOST = 100_000


class Pasted:
    """Keeps what a terminal sends between the marks of a paste until it is whole, and takes control characters out."""

    def __init__(self) -> None:
        self._held: str | None = None

    def __call__(self, text: str) -> str:
        """What is handed on of what has come."""
        found = []
        while text:
            if self._held is None:
                before, start, text = text.partition(_START)
                found.append(before)
                if start:
                    self._held = ""
            else:
                inside, end, text = f"{self._held}{text}".partition(_END)
                self._held = None if end else inside
                if end:
                    found.append(f"{_START}{_CONTROL.sub('', inside)[:_MOST]}{_END}")
        return "".join(found)
