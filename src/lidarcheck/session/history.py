"""Edits of a file as data: what each changed, undo and redo without limit."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["Edit", "History", "edit_between"]

_WORTH_BYTES = 160
"""From this size on packing makes an edit smaller."""


@dataclass(frozen=True, slots=True)
class Edit:
    """An edit: at byte `at` of the file `old` stood, and `new` stands now. `what`: in words."""

    what: str
    at: int
    old: bytes
    new: bytes

    def record(self) -> dict[str, Any]:
        """The edit as a journal has it."""
        return {"edit": self.what, "at": self.at, "old": self.old.decode("latin-1"), "new": self.new.decode("latin-1")}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Edit:
        """The edit of a journal's record; `KeyError`, `TypeError` or `ValueError` where it is none."""
        old, new = (str(record[name]).encode("latin-1") for name in ("old", "new"))
        return cls(str(record["edit"]), int(record["at"]), old, new)

    def applied(self, content: bytes, *, back: bool = False) -> bytes:
        """The content with this edit, or without it again; `ValueError` where it does not belong to it."""
        here, there = (self.new, self.old) if back else (self.old, self.new)
        end = self.at + len(here)
        if content[self.at : end] != here:
            raise ValueError(f"the edit {self.what} is for another content")
        return content[: self.at] + there + content[end:]


def edit_between(before: bytes, after: bytes, what: str) -> Edit | None:
    """What leads from one content to the other; None if nothing does."""
    if before == after:
        return None
    at = _shared(before, after)
    same = _shared(before[at:][::-1], after[at:][::-1])
    return Edit(what, at, before[at : len(before) - same], after[at : len(after) - same])


def _shared(one: bytes, other: bytes) -> int:
    """How many bytes two contents begin with that are the same; by halves, since most are."""
    low, high = 0, min(len(one), len(other))
    while low < high:
        middle = (low + high + 1) // 2
        if one[:middle] == other[:middle]:
            low = middle
        else:
            high = middle - 1
    return low


class History:
    """The edits made, and those taken back that can be made again; packed, since there may be tens of thousands."""

    def __init__(self) -> None:
        self.done: list[bytes] = []
        self.undone: list[bytes] = []

    def add(self, edit: Edit) -> None:
        """A new edit; what was taken back before is gone."""
        self.done.append(_packed(edit))
        self.undone.clear()

    def last(self, verb: str) -> Edit | None:
        """The edit that "undo" or "redo" would be for; None where there is none."""
        stack = self.done if verb == "undo" else self.undone
        return _unpacked(stack[-1]) if stack else None

    def move(self, verb: str) -> Edit:
        """Take the last edit back ("undo") or make it again ("redo"), and give it."""
        stack, other = (self.done, self.undone) if verb == "undo" else (self.undone, self.done)
        other.append(stack.pop())
        return _unpacked(other[-1])


def _packed(edit: Edit) -> bytes:
    text = json.dumps(edit.record(), separators=(",", ":")).encode()
    return text if len(text) < _WORTH_BYTES else zlib.compress(text)


def _unpacked(packed: bytes) -> Edit:
    return Edit.of(json.loads(packed if packed.startswith(b"{") else zlib.decompress(packed)))
