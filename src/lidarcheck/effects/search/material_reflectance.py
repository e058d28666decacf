"""What a search must know of `material_reflectance`."""

from __future__ import annotations

import numpy as np

from lidarcheck.effects.search.base import REFLECTANCE_ERROR, FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.parts import UsualError

_FREE = (FreeParameter("factor", 0.05, log=True),)
_LEAST, _ANY = 0.05, 1.3
"""From a smaller ln gain than this the search begins with a factor that shows."""


def _starts(evidence: Evidence) -> list[Probe]:
    """Each material, as much brighter or darker as its echoes ask for."""
    ids, place = np.unique(evidence.beams.material_id, return_inverse=True)
    gain, _ = evidence.dimming().mean(np.where(evidence.beams.material_id >= 0, place, -1), len(ids))
    found = []
    for material, g in zip(ids, gain, strict=True):
        if material < 0:
            continue
        factor = float(np.exp(g)) if abs(g) > _LEAST else _ANY
        found.append(Probe("material_reflectance", {"factor": factor}, _FREE, {"material_id": int(material)}))
    return found


SPEC = SearchSpec(
    "material_reflectance",
    free=_FREE,
    starts=_starts,
    order=1,
    factors=("factor",),
    groups=frozenset({"light"}),
    usual_error=UsualError(REFLECTANCE_ERROR, ("factor",), log=True),
    watched_by=("area_mean", "detection_probability", "peak_mean"),
    shown_by=("area", "material"),
)
