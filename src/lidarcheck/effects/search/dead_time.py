"""What a search must know of `dead_time`: it acts in whole bins."""

from typing import Any

import numpy as np

from lidarcheck.effects.search.base import FreeParameter, SearchSpec, Variant
from lidarcheck.sensor import SpadArray

_FREE = (FreeParameter("shift_ns", 1.0), FreeParameter("spread_ns", 0.5))
_RECOVERY = (FreeParameter("shift_ns", 1.0), FreeParameter("recovery_ns", 0.3, log=True))


def _at_least_a_bin(settings: dict[str, Any], _factor: float) -> dict[str, Any]:
    """Less than one bin is nothing, from which no slope leads away."""
    shift_ns = settings.get("shift_ns")
    if shift_ns:
        settings["shift_ns"] = float(np.copysign(max(abs(shift_ns), 1.0), shift_ns))
    return settings


SPEC = SearchSpec(
    "dead_time",
    free=_FREE,
    fixed_starts=(
        {"shift_ns": -3.0, "spread_ns": 0.0},
        {"shift_ns": 4.0, "spread_ns": 0.0},
        {"shift_ns": 0.0, "spread_ns": 3.0},
    ),
    variants=(
        Variant("varying", {"shift_ns": 2.0, "spread_ns": 3.0}, _FREE),
        Variant("varying", {"shift_ns": 1.0, "spread_ns": 1.0}, _FREE),
        Variant("recovering", {"shift_ns": -2.0, "spread_ns": 0.0, "recovery_ns": 4.0}, _RECOVERY),
    ),
    order=13,
    amounts=("shift_ns",),
    rescale=_at_least_a_bin,
    groups=frozenset({"detector"}),
    least_errors={"shift_ns": 0.6},
    whole_steps={"shift_ns": lambda sensor: SpadArray.narrow(sensor).bin_ns},
    watched_by=("multi_echo_share", "area_mean", "echo_range_mean", "width_mean"),
    shown_by=("area", "amplitude"),
)
