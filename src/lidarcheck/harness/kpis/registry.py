"""The kinds of KPI that a scenario may ask for, in one table.

A new kind is a small function of `KpiInput` and an entry in the table of its family.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from lidarcheck.harness.kpis.base import KpiKind
from lidarcheck.harness.kpis.echoes import ECHO_KINDS, GHOST_KINDS
from lidarcheck.harness.kpis.features import FEATURE_KINDS
from lidarcheck.harness.kpis.neighbours import NEIGHBOUR_KINDS
from lidarcheck.harness.kpis.readout import READOUT_KINDS
from lidarcheck.harness.kpis.surface import DISTANCE_KINDS, SURFACE_KINDS, TREND_KINDS

__all__ = ["KINDS"]

_COUNTED = {"area": "AREA", "peak": "PEAK", "width": "WIDTH"}
"""What a SPAD array counts, as it stands in the names of kinds."""


def _with_column(name: str, kind: KpiKind) -> KpiKind:
    """The kind with the feature that it is of, where its name has one."""
    words = name.split("_")
    return replace(kind, column=next((column for word, column in _COUNTED.items() if word in words), ""))


KINDS: Mapping[str, KpiKind] = MappingProxyType(
    {
        name: _with_column(name, kind)
        for name, kind in {
            **SURFACE_KINDS,
            **TREND_KINDS,
            **NEIGHBOUR_KINDS,
            **ECHO_KINDS,
            **GHOST_KINDS,
            **READOUT_KINDS,
            **DISTANCE_KINDS,
            **FEATURE_KINDS,
        }.items()
    }
)
"""Every kind of KPI by the name that a scenario uses."""
