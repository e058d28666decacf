"""Edits of a file as data: what each changed, undo and redo without limit.

Each edit has a number, and so has each time that one is taken back or made again: all from one counter, so that the
histories of several files are one order.
"""

from __future__ import annotations

import base64
import dataclasses
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.session.journal import Record

__all__ = ["Edit", "History", "Place", "edit_between", "replayed", "unpacked"]

_WORTH_BYTES = 160
"""From this size on packing makes an edit smaller."""


@dataclass(frozen=True, slots=True)
class Edit:
    """An edit: at byte `at` of the file `old` stood, and `new` stands now. `what`: in words; `number`: see above."""

    what: str
    at: int
    old: bytes
    new: bytes
    number: int = 0

    def record(self) -> Record:
        """The edit as a journal has it."""
        old, new = self.old.decode("latin-1"), self.new.decode("latin-1")
        return {"edit": self.what, "at": self.at, "old": old, "new": new, "n": self.number}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Edit:
        """The edit of a journal's record; `KeyError`, `TypeError` or `ValueError` where it is none."""
        old, new = (str(record[name]).encode("latin-1") for name in ("old", "new"))
        return cls(str(record["edit"]), int(record["at"]), old, new, int(record.get("n", 0)))

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


@dataclass(frozen=True, slots=True)
class Place:
    """A packed edit in a history: its number, and since when it is among those done or undone, by the same counter."""

    number: int
    since: int
    packed: bytes


class History:
    """The edits made, and those taken back that can be made again; packed, since there may be tens of thousands.

    `latest`: the highest number that was given here, of an edit or of a step back or forth; `made`: that of the newest
    edit.
    """

    def __init__(self) -> None:
        self.done: list[Place] = []
        self.undone: list[Place] = []
        self.latest = self.made = 0

    def add(self, edit: Edit) -> None:
        """A new edit; what was taken back before is gone. One without a number gets the next."""
        self.made = self.latest = max(edit.number, self.latest + 1)
        numbered = dataclasses.replace(edit, number=self.made)
        self.done.append(Place(self.made, self.made, _packed(numbered)))
        self.undone.clear()

    def top(self, verb: str) -> Place | None:
        """Where the edit stands that "undo" or "redo" would be for; None where there is none. For any thread."""
        found = (self.done if verb == "undo" else self.undone)[-1:]
        return found[0] if found else None

    def last(self, verb: str) -> Edit | None:
        """That edit."""
        place = self.top(verb)
        return None if place is None else unpacked(place)

    def move(self, verb: str, number: int = 0) -> Edit:
        """Take the last edit back ("undo") or make it again ("redo"), and give it; `number`: of this step."""
        stack, other = (self.done, self.undone) if verb == "undo" else (self.undone, self.done)
        self.latest = max(number, self.latest + 1)
        other.append(dataclasses.replace(stack.pop(), since=self.latest))
        return unpacked(other[-1])


def replayed(records: list[Record], path: Path) -> tuple[bytes, History, list[str]]:
    """(the content after all edits of a journal, their history, the hashes that the file had when it was saved).

    Records that an older version wrote have no numbers: they get them in their order.
    """
    try:
        content, history = base64.b64decode(records[0]["base"]), History()
        saved = [str(records[0]["saved"])]
        for record in records[1:]:
            if "edit" in record:
                edit = Edit.of(record)
                content = edit.applied(content)
                history.add(edit)
            elif "undo" in record or "redo" in record:
                verb = "undo" if "undo" in record else "redo"
                content = history.move(verb, int(record.get("n", 0))).applied(content, back=verb == "undo")
            elif "saved" in record or "kept" in record:
                saved.append(str(record.get("saved", record.get("kept"))))
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"the journal is damaged: {error}", file=path, fix="it is kept") from error
    return content, history, saved


def _packed(edit: Edit) -> bytes:
    text = json.dumps(edit.record(), separators=(",", ":")).encode()
    return text if len(text) < _WORTH_BYTES else zlib.compress(text)


def unpacked(place: Place) -> Edit:
    """The edit at a place of a history."""
    packed = place.packed
    return Edit.of(json.loads(packed if packed.startswith(b"{") else zlib.decompress(packed)))
