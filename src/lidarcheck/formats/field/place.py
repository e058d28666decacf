"""How a recording, a topic in it and a frame of that are named in one word: `FILE#TOPIC@NUMBER`, each part but the file
optional."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

__all__ = ["Named", "named"]

_FRAME = re.compile(r"(.*?)@([0-9]{1,9})")


class Named(NamedTuple):
    """`topic`: empty where none is named; `frame`: its number from 0, None for all of them."""

    file: Path
    topic: str = ""
    frame: int | None = None

    def __str__(self) -> str:
        number = "" if self.frame is None else f"@{self.frame}"
        return f"{self.file}#{self.topic}{number}" if self.topic or number else str(self.file)


def named(place: str | os.PathLike[str]) -> Named:
    """The parts of such a name. A file whose own name holds `#` is that file."""
    text = str(place)
    if "#" not in text or _exists(text):
        return Named(Path(place))
    at = next((at for at in (i for i, c in enumerate(text) if c == "#") if _exists(text[:at])), text.index("#"))
    topic, frame = text[at + 1 :], None
    match = _FRAME.fullmatch(topic)
    if match:
        topic, frame = match[1], int(match[2])
    return Named(Path(text[:at]), topic, frame)


def _exists(text: str) -> bool:
    try:
        return bool(text) and Path(text).exists()
    except (OSError, ValueError):
        return False
