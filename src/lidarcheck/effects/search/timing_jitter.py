"""What a search must know of `timing_jitter`."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec

SPEC = SearchSpec(
    "timing_jitter",
    free=(FreeParameter("sigma_ns", LOG_STEP, log=True), FreeParameter("amplitude_power", 0.1)),
    fixed_starts=({"sigma_ns": 0.3}, {"sigma_ns": 1.0}),
    amounts=("sigma_ns",),
    in_repeats=True,
    in_fitted_laws=True,
    watched_by=("range_noise",),
    shown_by=("range", "histogram"),
)
