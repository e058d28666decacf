"""What a search must know of `blooming_horizontal`."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec
from lidarcheck.effects.search.retros import HALO, why_unseen

SPEC = SearchSpec(
    "blooming_horizontal",
    free=(
        FreeParameter("core_left", 0.4, log=True),
        FreeParameter("core_right", 0.4, log=True),
        FreeParameter("core_columns", LOG_STEP, log=True),
        FreeParameter("skirt_left", 0.4, log=True),
        FreeParameter("skirt_right", 0.4, log=True),
        FreeParameter("skirt_left_columns", LOG_STEP, log=True),
        FreeParameter("skirt_right_columns", LOG_STEP, log=True),
    ),
    fixed_starts=(
        {"core_left": 1e-4, "core_right": 1e-4},
        {"core_left": 1e-3, "core_right": 1e-3, "skirt_left": 2e-5, "skirt_right": 2e-5},
    ),
    amounts=("core_left", "core_right", "skirt_left", "skirt_right"),
    why_unseen=why_unseen,
    watched_by=HALO,
    shown_by=("others", "map"),
)
