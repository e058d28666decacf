"""What a search must know of `fog`: its overlap and its layers; `fog_patches` measures patches."""

from __future__ import annotations

from typing import Any

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec, Variant
from lidarcheck.effects.search.fog_patches import refined, words
from lidarcheck.effects.search.parts import BeamByBeam

_FREE = (
    FreeParameter("mor_m", LOG_STEP, log=True),
    FreeParameter("backscatter", 0.3, log=True),
    FreeParameter("overlap_start_m", 0.3),
    FreeParameter("overlap_full_m", 0.3, log=True),
)
_STRATA = (*_FREE, FreeParameter("thinning_per_m", 0.1))
_NEAR, _FAR = {"overlap_start_m": 1.0, "overlap_full_m": 7.0}, {"overlap_start_m": 5.0, "overlap_full_m": 15.0}
_SMOOTH = {"backscatter": 0.046, "overlap_power": 2.0}
_THIN = {"thinning_per_m": 0.2}
_VEIL = _FREE[1:]
_NO_LOSS = {"mor_m": 2e4, "overlap_power": 2.0}
_THINNEST, _FARTHEST_M = 0.02, 1e5
"""Fog is scaled down to no less, and to no longer a sight."""


def _denser(settings: dict[str, Any], factor: float) -> dict[str, Any]:
    """Density is the inverse of the range of sight."""
    return settings | {"mor_m": min(settings["mor_m"] / max(factor, _THINNEST), _FARTHEST_M)}


SPEC = SearchSpec(
    "fog",
    free=_FREE,
    fixed_starts=(
        {"mor_m": 60.0, "overlap_start_m": 1.0, "overlap_full_m": 3.0},
        {"mor_m": 250.0, "overlap_start_m": 1.0, "overlap_full_m": 3.0},
        {"mor_m": 500.0, "backscatter": 0.025, "overlap_start_m": 5.0, "overlap_full_m": 15.0},
    ),
    variants=(
        Variant("far overlap", {"mor_m": 150.0, "backscatter": 0.046} | _FAR, _FREE),
        Variant("smooth overlap", {"mor_m": 150.0} | _NEAR | _SMOOTH, _FREE),
        Variant("smooth overlap", {"mor_m": 600.0} | _NEAR | _SMOOTH, _FREE),
        Variant("smooth far overlap", {"mor_m": 150.0} | _FAR | _SMOOTH, _FREE),
        Variant("smooth far overlap", {"mor_m": 600.0} | _FAR | _SMOOTH, _FREE),
        Variant("layers", {"mor_m": 150.0} | _NEAR | _SMOOTH | _THIN, _STRATA),
        Variant("layers", {"mor_m": 150.0} | _FAR | _SMOOTH | _THIN, _STRATA),
    ),
    beside_repeats=(
        Variant("veil", _NEAR | _NO_LOSS | {"backscatter": 3.0}, _VEIL),
        Variant("far veil", _FAR | _NO_LOSS | {"backscatter": 3.0}, _VEIL),
    ),
    order=14,
    rescale=_denser,
    ascending=(("overlap_start_m", "overlap_full_m"),),
    confused_with={"rain": "many frames of the air close to the sensor: drops are single, fog is a veil"},
    beam_by_beam=BeamByBeam("patches", refined, words),
    watched_by=("area_loss_per_metre", "echo_share", "stray_range_onset", "area_mean", "detection_probability"),
    shown_by=("others", "histogram"),
)
