"""The rows of a vendor's CSV: cells with their lines; a byte order mark, CRLF and blank lines do not matter."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError

__all__ = ["Row", "rows_of"]


_MOST_LINES = 10_000


class Row(NamedTuple):
    """The cells of a line, without the blanks around them."""

    cells: list[str]
    line: int
    file: Path

    def fault(self, what: str, fix: str = "correct the line") -> InputError:
        """The error for a fault of this line, to raise."""
        return InputError(what, file=self.file, line=self.line, fix=fix)

    def whole(self, at: int) -> int | None:
        """The whole number of a cell; None where it is none."""
        text = self.cells[at] if at < len(self.cells) else ""
        return int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else None

    def number(self, at: int, name: str) -> float:
        """The finite number of a cell; `InputError` where it is none."""
        text = self.cells[at] if at < len(self.cells) else ""
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number) or "_" in text:
            raise self.fault(f"{name} is {shown(text)}, not a finite number")
        return number


def rows_of(text: str, file: Path) -> list[Row]:
    """The lines of the text that hold something; `InputError` where there are more than any sensor has channels."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n", _MOST_LINES)
    if len(lines) > _MOST_LINES and lines[-1].strip():
        raise InputError(f"more than {_MOST_LINES} lines", file=file, fix="is this a table of a sensor's channels?")
    found = [Row([c.strip(' \t"') for c in line.split(",")], at, file) for at, line in enumerate(lines, 1)]
    return [row for row in found if any(row.cells)]
