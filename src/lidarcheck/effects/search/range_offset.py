"""What a search must know of `range_offset`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.motion import driving_ahead
from lidarcheck.effects.search.parts import Imitation
from lidarcheck.effects.search.residuals import of_echoes_and_light, range_residuals


def _starts(evidence: Evidence) -> list[Probe]:
    """The offset of most ranges."""
    found = range_residuals(evidence)
    return [] if found is None else of_echoes_and_light("range_offset", {"offset_m": float(np.median(found[1]))})


def _driving(evidence: Evidence, settings: Mapping[str, Any]) -> Probe | None:
    """A sensor that drives ahead so fast that ranges are as much longer in the middle of the frame."""
    return driving_ahead(evidence, float(settings["offset_m"]))


SPEC = SearchSpec(
    "range_offset",
    free=(FreeParameter("offset_m", 0.005),),
    fixed_starts=({"offset_m": 0.04}, {"offset_m": -0.04}, {"offset_m": 0.3}, {"offset_m": -0.3}),
    starts=_starts,
    order=6,
    amounts=("offset_m",),
    groups=frozenset({"ranges"}),
    confused_with={
        "range_scale": "one target at two ranges far apart",
        "motion": "a scene at rest, the sensor at rest",
        "walk_error": "panels of 10 % and 80 % at one range",
    },
    # A walk read off the data can be nearly the same at all amplitudes, a motion in all columns of a narrow view.
    imitated_by=("walk_error", "motion"),
    imitation=Imitation("motion", _driving),
    kinds_alike=True,  # over a range of a bin
    may_stay={"range": (0.04, 0.15)},
    in_fitted_pose=True,
    watched_by=("range_residual_mean", "range_residual_median"),
    shown_by=("range", "histogram"),
)
