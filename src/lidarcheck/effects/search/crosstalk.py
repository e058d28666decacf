"""What a search must know of `crosstalk`."""

from lidarcheck.effects.search.base import FreeParameter, SearchSpec

SPEC = SearchSpec(
    "crosstalk",
    free=(FreeParameter("sides", 0.4, log=True), FreeParameter("corners", 0.7, log=True)),
    fixed_starts=(
        {"sides": 0.03, "corners": 0.015},
        {"sides": 0.1, "corners": 0.05},
        {"sides": 0.3, "corners": 0.12},
    ),
    amounts=("sides", "corners"),
    groups=frozenset({"detector"}),
    form_errors={"sides": 0.12, "corners": 0.20},  # how detectors lie side by side
    watched_by=("area_spread", "peak_mean", "false_alarm_probability", "area_mean"),
    shown_by=("peak", "amplitude"),
)
