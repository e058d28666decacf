"""What a search must know of `boresight`."""

from __future__ import annotations

import numpy as np

from lidarcheck.effects.search.base import POSE_ERROR_DEG, FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.parts import UsualError
from lidarcheck.effects.search.residuals import best_factors, range_residuals

_USUAL_DEG = (0.3, 0.3)
"""Angles that are no surprise."""
_FREE = (FreeParameter("yaw_deg", 0.03), FreeParameter("pitch_deg", 0.015))


def _starts(evidence: Evidence) -> list[Probe]:
    """A sensor that looks elsewhere, as ranges have changed along the slopes of surfaces."""
    found = range_residuals(evidence)
    if found is None:
        return []
    used, residual = found
    factors = best_factors(evidence.beams.slope_m_per_deg[used], residual, _USUAL_DEG)
    pitch, yaw = np.clip(factors, -2.0, 2.0).tolist()
    return [Probe("boresight", {"yaw_deg": yaw, "pitch_deg": pitch}, _FREE)] if pitch or yaw else []


SPEC = SearchSpec(
    "boresight",
    free=_FREE,
    fixed_starts=tuple(
        {"yaw_deg": y, "pitch_deg": p}
        for y, p in (
            *((y, 0.0) for y in (0.12, -0.12, 0.4, -0.4)),
            *((0.0, p) for p in (0.06, -0.06, 0.2, -0.2, 0.4, -0.4)),
            *((y * size, p * size) for size in (0.1, 0.3) for y in (1.0, -1.0) for p in (1.0, -1.0)),
        )
    ),
    starts=_starts,
    order=8,
    amounts=("yaw_deg", "pitch_deg"),
    groups=frozenset({"aim"}),
    special_case_of="vibration",  # a view that is turned alike in all columns
    confused_with={"motion": "a scene at rest, the sensor at rest", "vibration": "a sensor on a firm stand"},
    usual_error=UsualError(POSE_ERROR_DEG, ("yaw_deg", "pitch_deg", "roll_deg")),
    at_edges=True,
    least_errors={"yaw_deg": POSE_ERROR_DEG, "pitch_deg": POSE_ERROR_DEG},
    in_fitted_pose=True,
    watched_by=("echo_layer_mean", "echo_point_mean", "range_residual_per_layer", "range_noise", "area_mean"),
    shown_by=("range", "map"),
)
