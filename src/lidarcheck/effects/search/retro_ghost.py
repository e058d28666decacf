"""What a search must know of `retro_ghost`."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec
from lidarcheck.effects.search.retros import why_unseen

SPEC = SearchSpec(
    "retro_ghost",
    free=(
        FreeParameter("strength", LOG_STEP, log=True),
        FreeParameter("extra_m", 0.1),
        FreeParameter("exponent", 0.3),
    ),
    fixed_starts=({"strength": 3e-5}, {"strength": 1.5e-4}),
    amounts=("strength",),
    why_unseen=why_unseen,
    form_errors={"extra_m": 0.35},
    watched_by=("ghost_count_ratio", "ghost_area_ratio", "ghost_peak_ratio", "multi_echo_share"),
    shown_by=("others", "histogram"),
)
