"""A fit of laws under way: what is known, what is free, what was found."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.ideals.repeats.groups import Groups, gap_m, grouped
from lidarcheck.ideals.repeats.laws.spread import Sample
from lidarcheck.ideals.repeats.neighbours import at_edges
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.ideals.repeats.response import response_of
from lidarcheck.sensor import Feature, Linear, Sensor

__all__ = ["BY_90", "THRESHOLD", "Fitted", "Work", "sample_of"]

BY_90 = 1.645
"""Standard errors to either end of a 90 % interval."""


THRESHOLD = "threshold"
"""The key of sensor files whose value hits and misses tell."""


@dataclass(frozen=True)
class Fitted:
    """A number and the ends of its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass
class Work:
    """A fit under way: the sensor as it is known, what is free, and what has been found."""

    seen: Observations
    feature: Feature | None
    use: BoolArray
    sensor: Linear
    free: set[str]
    fitted: dict[str, Fitted] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def put(self, name: str, value: float, error: float | None = None, ends: tuple[float, float] | None = None) -> None:
        """Take a number as found, within its bounds; `error`: its standard error."""
        bound = type(self.sensor).numbers()[name]
        value = float(np.clip(value, bound.low, bound.high))
        low, high = ends or (value - BY_90 * (error or 0.0), value + BY_90 * (error or 0.0))
        self.fitted[name] = Fitted(value, float(max(low, bound.low)), float(min(high, bound.high)))
        missing = tuple(m for m in self.sensor.missing if m != name)
        changed: dict[str, Any] = {name: value}
        self.sensor = replace(self.sensor, missing=missing, **changed)

    def note(self, text: str) -> None:
        """Keep what could not be fitted, and why, once."""
        if text not in self.notes:
            self.notes.append(text)


def sample_of(
    seen: Observations, feature: Feature | None, sensor: Sensor, use: BoolArray
) -> tuple[Sample, Groups, FloatArray]:
    """Rays of one surface and beside no edge that were seen twice or more; all surfaces; the gaps."""
    response, amplitudes = response_of(sensor, feature), seen.amplitudes(feature, sensor)
    gaps = gap_m(response, sensor, amplitudes.value, seen.path_m)
    groups = grouped(seen, amplitudes, gaps, use)
    place = np.full(len(seen.rays), np.nan)
    place[groups.ray[groups.main]] = groups.path_m[groups.main]
    clean = groups.main & ~groups.two[groups.ray] & ~at_edges(seen.rays, place)[groups.ray]
    rows = np.flatnonzero(clean & (groups.hits >= 2) & ~groups.capped)
    amplitude = np.nan_to_num(groups.amplitude[rows])
    sample = Sample(
        amplitude, groups.path_m[rows], groups.hits[rows], groups.fired[groups.ray[rows]], groups.range_var[rows],
        np.nan_to_num(groups.amplitude_var[rows]), np.nan_to_num(groups.high[rows] - groups.low[rows]),
    )  # fmt: skip
    return sample, groups, gaps
