"""What an importer gives: the document of a sensor file, what the vendor's file lacks, and remarks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = [
    "SIGNAL",
    "Given",
    "Imported",
    "Lacking",
    "is_whole",
    "linear_lacks",
    "nothing_lost",
    "rate_lacks",
    "rounded",
    "step_lacks",
]

_DIGITS = {"deg": 10, "m": 12, "us": 9}
"""Decimals of what was converted: 1e-10 deg moves a point at 300 m by 3e-10 m."""


@dataclass(frozen=True)
class Given:
    """What the user says beyond the file, None where nothing is said.

    `model`: the sensor's model, or which of several sensors in a file is meant. `rate_hz`: frames a second.
    `azimuth_step_deg`: from a column to the next. `firetimes`, `pattern`: a second file. `state`: which of its states.
    """

    model: str | None = None
    rate_hz: float | None = None
    azimuth_step_deg: float | None = None
    firetimes: Path | None = None
    state: str | None = None
    pattern: Path | None = None


@dataclass(frozen=True)
class Lacking:
    """A key that the file does not give: `key` with its table (`range.max_m`), an example, where to look it up.

    `needed`: whether the sensor file cannot be read without it.
    """

    key: str
    example: Any
    look_up: str
    needed: bool = False


@dataclass(frozen=True)
class Imported:
    """A sensor as a file describes it.

    `document`: the keys of a sensor file, lists as plain lists; what is absent has its default, or is in `lacking`.
    `remarks`: what a user should know of how the numbers came about, a sentence each. `table`: the columns of the file
    that `beams.file` names, for a sensor whose beams are a table.
    """

    document: Mapping[str, Any]
    lacking: tuple[Lacking, ...] = ()
    remarks: tuple[str, ...] = ()
    table: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def completed(self, *, all_keys: bool = False) -> dict[str, Any]:
        """The document with the examples of what is needed and lacking, or with `all_keys` of whatever is lacking."""
        found = {key: dict(value) if isinstance(value, Mapping) else value for key, value in self.document.items()}
        for entry in self.lacking:
            if entry.needed or all_keys:
                table, _, key = entry.key.rpartition(".")
                (found.setdefault(table, {}) if table else found)[key] = entry.example
        return found


def rounded(value: float, unit: str) -> float:
    """A number that a conversion made, without the digits that only its rounding has; `unit`: deg, m or us."""
    return round(value, _DIGITS[unit]) + 0.0  # no -0.0


SIGNAL = Lacking(
    "linear.signal_at_1m",
    461000,
    'from "R at 10 % with P_d" of the data sheet: S R^2 / 0.1 with S - 1.2816 sigma(S) = threshold; '
    "461 000 is 80 m, P_d 0.9, threshold 5.84, excess 0.02",
)
"""The signal of a linear detector, which no vendor's calibration says."""


def rate_lacks(look_up: str) -> Lacking:
    """Frames a second, which the user may also say on the command line."""
    return Lacking("frame_rate_hz", 10, f"{look_up}; or give --rate HZ", needed=True)


def step_lacks(example_deg: float, look_up: str) -> Lacking:
    """From a column to the next, which the user may also say on the command line."""
    return Lacking("beams.azimuth_step_deg", example_deg, f"{look_up}; or give --azimuth-step DEG", needed=True)


def linear_lacks(*, min_m: bool = True, max_m: bool = True) -> tuple[Lacking, ...]:
    """What calibrations of real sensors lack: the gate and the signal."""
    gate = [Lacking("range.min_m", 0.5, "the smallest range of the data sheet")] if min_m else []
    gate += [Lacking("range.max_m", 120, "the largest range that the sensor reports")] if max_m else []
    return (*gate, SIGNAL)


def nothing_lost(floor_m: float) -> dict[str, Any]:
    """The linear detector of a simulator that loses nothing and whose ranges scatter by `floor_m`."""
    return {
        "signal_at_1m": 1e9,
        "threshold": 0,
        "noise": 0,
        "false_rate_hz": 0,
        "range_floor_m": floor_m,
        "edge_factor": 0,
    }


def is_whole(value: float) -> bool:
    """Whether a quotient of two numbers of a file is a whole number."""
    return math.isclose(value, round(value), rel_tol=1e-9, abs_tol=1e-9)
