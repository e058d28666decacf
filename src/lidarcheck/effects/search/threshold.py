"""What a search must know of `threshold`: one between two whole numbers is dithered; most are not."""

from lidarcheck.effects.search.base import FreeParameter, SearchSpec

SPEC = SearchSpec(
    "threshold",
    free=(FreeParameter("shift", 1.0),),
    fixed_starts=({"shift": 2.0}, {"shift": -2.0}, {"shift": 6.0}),
    amounts=("shift",),
    of_threshold=("shift",),
    groups=frozenset({"background"}),
    whole_steps={"shift": lambda _sensor: 1.0},
    in_repeats=True,
    in_fitted_laws=True,
    watched_by=("detection_probability", "false_alarm_probability", "width_mean", "area_mean"),
    shown_by=("detected", "amplitude"),
)
