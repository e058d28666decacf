"""One LUT file being edited, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from lidarcheck.calibration.blooming.lut_edit import (
    LutChange,
    changes,
    inserted,
    moved_to,
    set_rows,
    shifted,
    smoothed,
    taken_over,
    without_rows,
)
from lidarcheck.formats.lut import Axis, LutFile, load_lut, parse_lut
from lidarcheck.session.edited_file import EditedFile

__all__ = ["EditedLut"]


class EditedLut(EditedFile[LutFile]):
    """A LUT file, edited."""

    def set(self, axis: Axis, rows: Sequence[int], value: str) -> bool:
        """Rows get a scaled value, or where it has a point or an exponent a true Y; whether that changed anything."""
        true_y = "." in value or "e" in value.lower()
        return self._make(axis, rows, f"set {value}", lambda lut: set_rows(lut, axis, rows, value, true_y=true_y))

    def nudge(self, axis: Axis, rows: Sequence[int], steps: int) -> bool:
        """Rows move by steps of the scale and stop at its ends."""
        return self._make(axis, rows, f"nudge {steps:+d}", lambda lut: shifted(lut, axis, rows, steps, clip=True))

    def smooth(self, axis: Axis, rows: Sequence[int]) -> bool:
        """Rows move half of the way to the line through their neighbours."""
        return self._make(axis, rows, "smooth", lambda lut: smoothed(lut, axis, rows))

    def set_x(self, axis: Axis, row: int, value: str) -> bool:
        """A row gets another X, which must lie between those of its neighbours; whether that changed anything."""
        return self._make(axis, [row], f"X = {value}", lambda lut: moved_to(lut, axis, row, value))

    def insert(self, axis: Axis, row: int) -> bool:
        """A new row after this one, between it and the next."""
        return self._make(axis, [row], "add a row", lambda lut: inserted(lut, axis, row))

    def remove(self, axis: Axis, rows: Sequence[int]) -> bool:
        """Rows are taken out; one must stay."""
        return self._make(axis, rows, "take out", lambda lut: without_rows(lut, axis, rows))

    def take(self, axis: Axis, other: LutFile, what: str, rows: Sequence[int] | None = None) -> bool:
        """Rows get the Y that another table has at their X, all as one edit; whether that changed anything."""
        return self._make(axis, rows or (), what, lambda lut: taken_over(lut, axis, other, rows))

    def edited(self, axis: Axis) -> list[bool]:
        """Whether each row of a table differs from what was saved, or is new."""
        there = axis in self.saved.tables
        own = {c.row for c in self.diff() if c.table == axis and not math.isnan(c.after)}
        return [row in own or not there for row in range(len(self.current.tables[axis]))]

    def _make(self, axis: Axis, rows: Sequence[int], what: str, make: Callable[[LutFile], LutFile]) -> bool:
        self._check_editable()
        after = make(self.current)
        at = ", ".join(f"{self.current.tables[axis].x[row]:g}" for row in rows)
        return self._edit(after, what, f"{axis} X {at}" if at else axis)

    def _load(self) -> LutFile:
        return load_lut(self.path)

    def _parse(self, content: bytes) -> LutFile:
        return parse_lut(content, self.path)

    def _differences(self, before: LutFile, after: LutFile) -> list[LutChange]:
        return changes(before, after)

    def _alike(self, one: LutFile, other: LutFile) -> bool:
        return set(one.tables) == set(other.tables)
