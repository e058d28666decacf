"""What a search must know of `ambient_light`: an even sky, or the sun from one of the directions that are tried."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec, Variant

_FREE = (FreeParameter("rate_per_ns", LOG_STEP, log=True), FreeParameter("sky", 0.4, log=True))
_SUN = (
    *_FREE,
    FreeParameter("direct", 0.1),
    FreeParameter("sun_azimuth_deg", 15.0),
    FreeParameter("sun_elevation_deg", 10.0),
)
_DIRECTIONS = tuple(
    {"direct": 0.6, "sun_azimuth_deg": azimuth, "sun_elevation_deg": 40.0}
    for azimuth in (0.0, 60.0, 120.0, 180.0, -120.0, -60.0)
)
"""Where the sun stands cannot be told before it is known how bright it is."""

SPEC = SearchSpec(
    "ambient_light",
    free=_FREE,
    fixed_starts=({"rate_per_ns": 0.0005}, {"rate_per_ns": 0.002}),
    variants=(Variant("from the sun", {"rate_per_ns": 0.002, "direct": 0.6}, _SUN, _DIRECTIONS),),
    order=18,
    amounts=("rate_per_ns",),
    of_background=("rate_per_ns",),
    groups=frozenset({"background"}),
    form_errors={"sky": 0.20},  # what the sky is taken to be
    in_repeats=True,
    in_fitted_laws=True,
    watched_by=("false_alarm_probability", "false_alarms_per_beam", "area_mean"),
    shown_by=("others", "map"),
)
