"""The KPIs of many frames together: for each its median and spread over the frames, in the memory of one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lidarcheck.kpi.comparison import Comparison

__all__ = ["FrameKpi", "OverFrames"]


class FrameKpi(NamedTuple):
    """A KPI over frames: in how many it is defined, its median there, and its 5 % and 95 % quantiles.

    `kpi`, `of`, `unit`: as a comparison's row has them.
    """

    kpi: str
    of: str
    frames: int
    median: float
    low: float
    high: float
    unit: str


@dataclass
class OverFrames:
    """Takes one comparison after another and keeps of each its KPIs alone."""

    _values: dict[tuple[str, str, str], list[float]] = field(default_factory=dict)

    def add(self, comparison: Comparison) -> None:
        """Add a frame. Of overlap, which has no value of its own, the share of measured points that are covered."""
        for row in comparison.rows():
            value = row.measured if row.kpi == "overlap" else row.value
            of = f"measured {row.of}" if row.kpi == "overlap" else row.of
            self._values.setdefault((row.kpi, of, row.unit), []).append(float(value))

    def kpis(self) -> list[FrameKpi]:
        """The KPIs in the order in which they first came up; NaN where one is defined in no frame."""
        found = []
        for (kpi, of, unit), values in self._values.items():
            known = np.array(values)[np.isfinite(values)]
            low, median, high = np.quantile(known, [0.05, 0.5, 0.95]).tolist() if len(known) else [float("nan")] * 3
            found.append(FrameKpi(kpi, of, len(known), median, low, high, unit))
        return found
