"""What a search must know of `incidence_falloff`: a power of the cosine, and a table of what that has not quite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.incidence_falloff import STEP_DEG
from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec, Variant
from lidarcheck.effects.search.evidence import Evidence, Observations
from lidarcheck.effects.search.parts import ListReader
from lidarcheck.effects.search.residuals import at_knots

_FREE = (FreeParameter("exponent", 0.1),)
_ANGLES = round(90.0 / STEP_DEG) + 1
_BESIDES = 0.3
"""The table is what the power has not quite: no more than this part of the span of the curve itself."""


def _about_lambert(settings: dict[str, Any], factor: float) -> dict[str, Any]:
    """An exponent of 1 is none of this effect."""
    return settings | {"exponent": 1.0 + (settings["exponent"] - 1.0) * factor}


def _factors(evidence: Evidence, shown: Sequence[Observations], probe: Probe, x: FloatArray) -> tuple[float, ...]:
    """The table of factors times what surfaces still ask for at each incidence, within limits."""
    dimming, beams = evidence.dimming(shown), evidence.beams
    used = np.flatnonzero((dimming.weight > 0.0) & ~beams.retro & ~evidence.expected.at_edge)
    step = np.clip(beams.incidence_deg[used] / STEP_DEG, 0.0, _ANGLES - 1.0)
    more = at_knots(step, dimming.log_gain[used], dimming.weight[used], _ANGLES)
    seen = np.quantile(beams.incidence_deg[used], [0.01, 0.99]) if len(used) else np.zeros(2)
    law = probe.effect(x).settings()
    cosine = np.cos(np.deg2rad(np.minimum(seen, law["level_from_deg"])))
    most = _BESIDES * abs(law["exponent"] - 1.0) * float(np.ptp(np.log(np.maximum(cosine, 1e-3))))
    table = np.log(np.asarray(probe.settings.get("factors") or np.ones(_ANGLES))) + more
    return tuple(np.round(np.exp(np.clip(table, -most, most)), 4).tolist())


SPEC = SearchSpec(
    "incidence_falloff",
    free=_FREE,
    fixed_starts=({"exponent": 0.6}, {"exponent": 1.5}, {"exponent": 2.5}),
    variants=(
        Variant(
            "levelling",
            {"exponent": 1.8, "level_from_deg": 65.0},
            (*_FREE, FreeParameter("level_from_deg", 4.0)),
        ),
    ),
    order=15,
    rescale=_about_lambert,
    groups=frozenset({"light"}),
    list_reader=ListReader("factors", _factors, rounds=2),
    watched_by=("area_incidence_exponent", "area_mean", "detection_probability"),
    shown_by=("area", "incidence"),
)
