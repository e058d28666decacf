"""What a search must know of `range_scale`."""

from __future__ import annotations

import numpy as np

from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.residuals import medians, of_echoes_and_light, range_residuals


def _starts(evidence: Evidence) -> list[Probe]:
    """The scale that goes best through the residuals over the range."""
    found = range_residuals(evidence)
    if found is None:
        return []
    used, residual = found
    y, x = medians(evidence.beams.distance_m[used], residual)
    fraction = float(np.clip(np.sum(x * y) / np.sum(x * x), -0.05, 0.05))
    return of_echoes_and_light("range_scale", {"fraction": fraction})


SPEC = SearchSpec(
    "range_scale",
    free=(FreeParameter("fraction", 0.0001),),
    fixed_starts=({"fraction": 0.001}, {"fraction": -0.001}, {"fraction": 0.006}, {"fraction": -0.006}),
    starts=_starts,
    order=7,
    amounts=("fraction",),
    groups=frozenset({"ranges"}),
    confused_with={
        "walk_error": "panels of 10 % and 80 % at one range",
        "motion": "a scene at rest, the sensor at rest",
    },
    kinds_alike=True,  # over a range of a bin
    may_stay={"range": (0.04, 0.15)},
    in_fitted_pose=True,
    watched_by=("range_residual_per_metre", "range_residual_mean"),
    shown_by=("range", "range"),
)
