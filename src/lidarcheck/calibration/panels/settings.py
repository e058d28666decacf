"""What counts as a panel and how its borders are trimmed: everything a person may set, with its allowed range."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lidarcheck.errors import UsageError

__all__ = ["PanelSettings"]


@dataclass(frozen=True)
class PanelSettings:
    """Limits of the search for panels, and of what is taken as an echo on one.

    `range_m`: nearest and farthest centre of a panel. `size_m`: least and largest width and height. `trim_layers`,
    `trim_points`, `trim_m`: what each of the four borders loses; the larger of beams and metres counts. `floor_m`,
    `roof_m`: heights in the sensor frame, found in the data where None. `clearance_m`: what is this close to floor or
    roof belongs to it. `max_incidence_deg`: a panel faces the sensor up to this angle. `window_m`: an echo this close
    to the panel's plane is the panel's. 1 m, not the KPI's 0.749 m: pile-up shifts a white panel at 5 m by 0.65 m.
    `expect`: how many panels there must be, None where nobody knows.
    """

    range_m: tuple[float, float] = (4.0, 85.0)
    size_m: tuple[float, float] = (0.2, 4.0)
    trim_layers: int = 2
    trim_points: int = 1
    trim_m: float = 0.0
    floor_m: float | None = None
    roof_m: float | None = None
    clearance_m: float = 0.15
    max_incidence_deg: float = 60.0
    window_m: float = 1.0
    expect: int | None = None

    def __post_init__(self) -> None:
        _ascending("range", self.range_m, 0.1, 300.0)
        _ascending("size", self.size_m, 0.05, 50.0)
        _within("trim-layers", self.trim_layers, 0, 100, "layers")
        _within("trim-points", self.trim_points, 0, 100, "points")
        _within("trim-m", self.trim_m, 0.0, 5.0, "m")
        _within("clearance-m", self.clearance_m, 0.0, 2.0, "m")
        _within("max-incidence", self.max_incidence_deg, 1.0, 85.0, "degrees")
        _within("window-m", self.window_m, 0.01, 10.0, "m")
        for name, height in (("floor-m", self.floor_m), ("roof-m", self.roof_m)):
            if height is not None:
                _within(name, height, -50.0, 50.0, "m")
        if self.floor_m is not None and self.roof_m is not None and self.floor_m >= self.roof_m:
            raise UsageError(
                f"the floor at {self.floor_m:g} m is not below the roof at {self.roof_m:g} m",
                fix="heights are in the sensor frame, upward positive",
            )
        if self.expect is not None:
            _within("expect", self.expect, 1, 10_000, "panels")


def _ascending(name: str, values: tuple[float, float], low: float, high: float) -> None:
    least, most = values
    if not low <= least < most <= high:
        raise UsageError(
            f"--{name} {least:g} {most:g} is no interval", fix=f"use two ascending lengths from {low:g} to {high:g} m"
        )


def _within(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise UsageError(f"--{name} {value:g} is out of range", fix=f"use {low:g} to {high:g} {unit}")
