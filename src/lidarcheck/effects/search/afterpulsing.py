"""What a search must know of `afterpulsing`."""

from lidarcheck.effects.search.base import FreeParameter, SearchSpec

SPEC = SearchSpec(
    "afterpulsing",
    free=(FreeParameter("probability", 0.4, log=True), FreeParameter("delay_ns", 0.5, log=True)),
    fixed_starts=({"probability": 0.05}, {"probability": 0.15}),
    amounts=("probability",),
    groups=frozenset({"background", "detector"}),
    form_errors={"probability": 0.15},
    watched_by=("echo_share", "width_mean", "multi_echo_share", "area_mean"),
    shown_by=("width", "amplitude"),
)
