"""Reading a parsed calibration place by place: every fault names the file, the line, the place and what to do."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.words import dotted, kind_of, shown
from lidarcheck.errors import InputError

__all__ = ["MOST_BEAMS", "MOST_CHANNELS", "MOST_LISTED", "Values", "check_degrees", "check_radians"]

MOST_CHANNELS = 4096
"""Channels of a sensor: ten times those of any that is sold."""
MOST_BEAMS = 10_000_000
"""Beams of a grid."""
MOST_LISTED = 1_000_000
"""Beams of a table, and entries of a list: twice those of the reference sensor."""
_EXPORT = "export the file from the sensor again"


@dataclass(frozen=True)
class Values:
    """The values of a parsed document. `as_text`: whether numbers may be written as text, as YAML 1.1 spells 1e-3."""

    data: Any
    lines: LineIndex
    as_text: bool = False

    def fault(self, path: Sequence[str | int], what: str, fix: str = _EXPORT) -> InputError:
        """The error for a fault at that place, to raise."""
        if not self.lines.lines:
            return InputError(what, file=self.lines.file, fix=fix)
        return self.lines.fault(path, what, fix=fix)

    def find(self, *path: str | int) -> Any:
        """What stands there; None where nothing or null does."""
        at = self.data
        for part in path:
            if isinstance(at, dict):
                at = at.get(part)
            elif isinstance(at, list) and isinstance(part, int) and 0 <= part < len(at):
                at = at[part]
            else:
                return None
        return at

    def first(self, *paths: tuple[str | int, ...]) -> tuple[str | int, ...]:
        """The first of the places where something stands; the last where nothing does in any."""
        return next((path for path in paths if self.find(*path) is not None), paths[-1])

    def number(self, *path: str | int, low: float = -math.inf, high: float = math.inf) -> float:
        """The finite number there, from `low` to `high`; `InputError` where there is none."""
        value = self.find(*path)
        if value is None:
            raise self.fault(path, f"{dotted(path)} is missing")
        number = self._finite(value, path)
        if not low <= number <= high:
            fix = f"use a number from {low:g} to {high:g}" if high < math.inf else f"use a number from {low:g}"
            raise self.fault(path, f"{dotted(path)} = {shown(value)} is out of range", fix)
        return number

    def maybe(self, *path: str | int, low: float = -math.inf, high: float = math.inf) -> float | None:
        """The same, None where nothing stands there."""
        return None if self.find(*path) is None else self.number(*path, low=low, high=high)

    def whole(self, *path: str | int, low: int, high: int) -> int:
        """The whole number there; errors as for `number`."""
        number = self.number(*path, low=low, high=high)
        if number != int(number):
            raise self.fault(path, f"{dotted(path)} = {shown(self.find(*path))} is no whole number")
        return int(number)

    def numbers(self, *path: str | int, count: int | None = None) -> list[float]:
        """The list of finite numbers there, of `count` entries where that is said; `InputError` where it is none."""
        values = self.entries(*path)
        if count is not None and len(values) != count:
            raise self.fault(path, f"{dotted(path)} has {len(values)} numbers, {count} are needed")
        return [self._finite(value, (*path, index)) for index, value in enumerate(values)]

    def entries(self, *path: str | int, most: int = MOST_LISTED) -> list[Any]:
        """The list there; `InputError` where there is none, or more than `most` entries."""
        value = self.find(*path)
        if value is None:
            raise self.fault(path, f"{dotted(path)} is missing")
        if not isinstance(value, list):
            raise self.fault(path, f"{dotted(path)} is {kind_of(value)}, not a list")
        if len(value) > most:
            raise self.fault(path, f"{dotted(path)} has {len(value)} entries, no sensor has more than {most}")
        return value

    def text(self, *path: str | int) -> str | None:
        """The text there; None where there is none, `InputError` where it is something else."""
        value = self.find(*path)
        if value is not None and not isinstance(value, str):
            raise self.fault(path, f"{dotted(path)} is {kind_of(value)}, not text")
        return value

    def _finite(self, value: Any, path: Sequence[str | int]) -> float:
        if self.as_text and isinstance(value, str):
            with contextlib.suppress(ValueError):
                value = float(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fault(path, f"{dotted(path)} = {shown(value)} is {kind_of(value)}, not a number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.fault(path, f"{dotted(path)} = {shown(value)} is not a finite number")
        return number


Fault = Callable[[str, str], InputError]
"""Makes the error from what is wrong and the fix."""


def check_degrees(angles: Sequence[float], name: str, fault: Fault, *, most: float = 90.0) -> None:
    """Refuse elevations [deg] beyond `most`, or so small all together that they must be radians."""
    largest = max(map(abs, angles), default=0.0)
    if largest > most:
        raise fault(f"{name} of {largest:g} deg is beyond {most:g}", _EXPORT)
    if len(angles) >= 8 and 0.0 < largest <= math.pi / 2:
        what = f"{name} look like radians: the largest is {largest:g}, and degrees are expected"
        raise fault(what, "multiply them by 57.29578")


def check_radians(angles: Sequence[float], name: str, fault: Fault, *, most: float = math.pi / 2) -> None:
    """Refuse angles [rad] beyond `most`: they must be degrees."""
    largest = max(map(abs, angles), default=0.0)
    if largest > most * (1 + 1e-6):
        what = f"{name} look like degrees: the largest is {largest:g}, and radians are expected"
        raise fault(what, "divide them by 57.29578")
