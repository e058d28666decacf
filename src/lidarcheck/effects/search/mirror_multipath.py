"""What a search must know of `mirror_multipath`."""

from __future__ import annotations

import numpy as np

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence

_FREE = (FreeParameter("reflectivity", LOG_STEP, log=True), FreeParameter("grazing", 0.1))


def _starts_of_each(evidence: Evidence) -> list[Probe]:
    """Each material as the mirror."""
    beams = evidence.beams
    ids = np.unique(beams.material_id[(beams.material_id >= 0) & ~beams.retro])
    return [Probe("mirror_multipath", {"reflectivity": 0.5}, _FREE, {"material_id": int(i)}) for i in ids]


SPEC = SearchSpec(
    "mirror_multipath",
    free=_FREE,
    fixed_starts=({"reflectivity": 0.15}, {"reflectivity": 0.5}),
    starts_of_each=_starts_of_each,
    order=11,
    amounts=("reflectivity",),
    shows_images=True,
    why_unseen=lambda _evidence: "no surface mirrors another that the sensor sees",
    watched_by=("echo_share", "echo_range_mean", "multi_echo_share", "false_alarms_per_beam"),
    shown_by=("others", "map"),
)
