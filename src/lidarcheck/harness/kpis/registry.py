"""The kinds of KPI that a scenario may ask for, in one table.

A new kind is a small function of `KpiInput` and an entry in the table of its family.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from lidarcheck.harness.kpis.base import KpiKind
from lidarcheck.harness.kpis.echoes import ECHO_KINDS, GHOST_KINDS
from lidarcheck.harness.kpis.neighbours import NEIGHBOUR_KINDS
from lidarcheck.harness.kpis.readout import READOUT_KINDS
from lidarcheck.harness.kpis.surface import DISTANCE_KINDS, SURFACE_KINDS, TREND_KINDS

__all__ = ["KINDS"]

KINDS: Mapping[str, KpiKind] = MappingProxyType(
    {
        **SURFACE_KINDS,
        **TREND_KINDS,
        **NEIGHBOUR_KINDS,
        **ECHO_KINDS,
        **GHOST_KINDS,
        **READOUT_KINDS,
        **DISTANCE_KINDS,
    }
)
"""Every kind of KPI by the name that a scenario uses."""
