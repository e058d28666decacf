"""What a search must know of `blooming_vertical`."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec
from lidarcheck.effects.search.retros import HALO, why_unseen

SPEC = SearchSpec(
    "blooming_vertical",
    free=(
        FreeParameter("core_up", 0.4, log=True),
        FreeParameter("core_down", 0.4, log=True),
        FreeParameter("core_rows", LOG_STEP, log=True),
        FreeParameter("skirt_up", 0.4, log=True),
        FreeParameter("skirt_down", 0.4, log=True),
        FreeParameter("skirt_up_rows", LOG_STEP, log=True),
        FreeParameter("skirt_down_rows", LOG_STEP, log=True),
    ),
    fixed_starts=(
        {"core_up": 0.0003, "core_down": 0.0003, "skirt_up": 5e-5, "skirt_down": 5e-5},
        {"core_up": 0.0003, "core_down": 0.002, "skirt_up": 5e-4, "skirt_down": 1e-4},
    ),
    amounts=("core_up", "core_down", "skirt_up", "skirt_down"),
    why_unseen=why_unseen,
    watched_by=HALO,
    shown_by=("others", "map"),
)
