"""One LUT file being edited, cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lidarcheck.calibration.blooming.lut_edit import LutChange, changes, set_rows, shifted, smoothed
from lidarcheck.formats.lut import Axis, LutFile, load_lut, parse_lut
from lidarcheck.session.edited_file import EditedFile

__all__ = ["EditedLut"]


class EditedLut(EditedFile[LutFile]):
    """A LUT file, edited."""

    def set(self, axis: Axis, rows: Sequence[int], value: str) -> bool:
        """Rows get a scaled value, or where it has a point or an exponent a true Y; whether that changed anything."""
        true_y = "." in value or "e" in value.lower()
        return self._make(f"set {value}", lambda lut: set_rows(lut, axis, rows, value, true_y=true_y))

    def nudge(self, axis: Axis, rows: Sequence[int], steps: int) -> bool:
        """Rows move by steps of the scale and stop at its ends."""
        return self._make(f"nudge {steps:+d}", lambda lut: shifted(lut, axis, rows, steps, clip=True))

    def smooth(self, axis: Axis, rows: Sequence[int]) -> bool:
        """Rows move half of the way to the line through their neighbours."""
        return self._make("smooth", lambda lut: smoothed(lut, axis, rows))

    def _make(self, what: str, make: Callable[[LutFile], LutFile]) -> bool:
        self._check_editable()
        return self._edit(make(self.current), what)

    def _load(self) -> LutFile:
        return load_lut(self.path)

    def _parse(self, content: bytes) -> LutFile:
        return parse_lut(content, self.path)

    def _differences(self, before: LutFile, after: LutFile) -> list[LutChange]:
        return changes(before, after)

    def _alike(self, one: LutFile, other: LutFile) -> bool:
        sizes = [{axis: len(table) for axis, table in lut.tables.items()} for lut in (one, other)]
        return sizes[0] == sizes[1]
