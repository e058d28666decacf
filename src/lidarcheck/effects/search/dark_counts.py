"""What a search must know of `dark_counts`."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec

SPEC = SearchSpec(
    "dark_counts",
    free=(FreeParameter("rate_per_ns", LOG_STEP, log=True),),
    fixed_starts=({"rate_per_ns": 0.0002}, {"rate_per_ns": 0.0008}),
    amounts=("rate_per_ns",),
    of_background=("rate_per_ns",),
    groups=frozenset({"background"}),
    confused_with={"ambient_light": "a frame in the dark, or a closed aperture"},
    in_repeats=True,
    in_fitted_laws=True,
    watched_by=("false_alarm_probability", "false_alarms_per_beam", "area_mean"),
    shown_by=("others", "histogram"),
)
