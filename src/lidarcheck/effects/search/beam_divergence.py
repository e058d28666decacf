"""What a search must know of `beam_divergence`.

Few rays are fast, and near a flat profile of the light; more see what the faint flanks of a bell meet, and are tried
once all is fitted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.geometry.footprint import offsets_rad
from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, Probe, SearchSpec

_FEW, _MORE = 3, 5


def _with_more_rays(probe: Probe, x: FloatArray) -> Probe:
    """The same footprint with more rays along either axis, which spread as far in the root mean square."""
    factor = _spread(int(probe.fixed["rays"])) / _spread(_MORE)
    return replace(probe.weaker(x, factor), fixed={**probe.fixed, "rays": _MORE})


def _spread(rays: int) -> float:
    """How far so many rays of a footprint of width 1 spread, in the root mean square."""
    return float(np.std(offsets_rad(1.0, rays)))


SPEC = SearchSpec(
    "beam_divergence",
    free=(FreeParameter("vertical_deg", LOG_STEP, log=True), FreeParameter("horizontal_deg", LOG_STEP, log=True)),
    fixed_starts=(
        {"vertical_deg": 0.06, "horizontal_deg": 0.12},
        {"vertical_deg": 0.15, "horizontal_deg": 0.3},
    ),
    fixed={"rays": _FEW},
    amounts=("vertical_deg", "horizontal_deg"),
    groups=frozenset({"aim"}),
    at_edges=True,
    splits_echoes=True,
    form_errors={"vertical_deg": 0.25, "horizontal_deg": 0.25},  # a beam's profile, of which few rays have no flanks
    finer=_with_more_rays,
    watched_by=("mixed_pixel_share", "multi_echo_share", "range_noise"),
    shown_by=("others", "map"),
)
