"""Edits of a table as data: what each changed, undo and redo without limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lidarcheck.formats.lut import Axis, LutFile

__all__ = ["Edit", "History", "edit_between"]


@dataclass(frozen=True, slots=True)
class Edit:
    """What an edit changed: for each row of a table Y as it was spelled before, and after."""

    axis: Axis
    what: str
    before: tuple[tuple[int, str], ...]
    after: tuple[tuple[int, str], ...]

    def record(self) -> dict[str, Any]:
        """The edit as a journal has it."""
        return {"edit": self.axis, "what": self.what, "before": list(self.before), "after": list(self.after)}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Edit:
        """The edit of a journal's record; `KeyError`, `TypeError` or `ValueError` where it is none."""
        axis: Axis = "horizontal" if record["edit"] == "horizontal" else "vertical"
        before, after = (tuple((int(row), str(text)) for row, text in record[name]) for name in ("before", "after"))
        return cls(axis, str(record["what"]), before, after)

    def applied(self, lut: LutFile, *, back: bool = False) -> LutFile:
        """The file with this edit, or without it again."""
        return lut.with_texts(self.axis, dict(self.before if back else self.after))


def edit_between(before: LutFile, after: LutFile, axis: Axis, what: str) -> Edit | None:
    """What leads from one file to the other in one table; None if nothing does."""
    rows = range(len(before.tables[axis]))
    changed = [row for row in rows if before.text(axis, row) != after.text(axis, row)]
    if not changed:
        return None
    olds, news = (tuple((row, lut.text(axis, row)) for row in changed) for lut in (before, after))
    return Edit(axis, what, olds, news)


class History:
    """The edits made, and those taken back that can be made again."""

    def __init__(self) -> None:
        self.done: list[Edit] = []
        self.undone: list[Edit] = []

    def add(self, edit: Edit) -> None:
        """A new edit; what was taken back before is gone."""
        self.done.append(edit)
        self.undone.clear()

    def undo(self) -> Edit:
        """Take the last edit back and give it."""
        self.undone.append(self.done.pop())
        return self.undone[-1]

    def redo(self) -> Edit:
        """Make the last edit that was taken back again, and give it."""
        self.done.append(self.undone.pop())
        return self.done[-1]
