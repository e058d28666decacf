"""What a search must know of `interference`: foreign pulses in single beams, in stripes of columns, or in lines."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec, Variant

_SHARE, _SIGNAL = FreeParameter("share", LOG_STEP, log=True), FreeParameter("signal", 0.3, log=True)
_FARTHEST, _COLUMNS = FreeParameter("farthest_m", LOG_STEP, log=True), FreeParameter("columns", 0.4, log=True)
_STRIPES = {"share": 0.02, "signal": 2.0, "columns": 0.08, "spread_decades": 0.1}

SPEC = SearchSpec(
    "interference",
    free=(_SHARE, _SIGNAL, _FARTHEST),
    fixed_starts=({"share": 0.01, "signal": 1.0}, {"share": 0.06, "signal": 3.0}),
    variants=(
        Variant("stripes", _STRIPES, (_SHARE, _SIGNAL, _FARTHEST, _COLUMNS)),
        Variant(
            "lines",
            _STRIPES | {"column_span_m": 10.0},
            (_SHARE, _SIGNAL, _COLUMNS, FreeParameter("column_span_m", 0.4, log=True)),
        ),
    ),
    order=19,
    amounts=("share",),
    of_signal=("signal",),
    at_random="adds echoes",
    form_errors={"share": 0.12},  # how often it strikes
    in_repeats=True,
    watched_by=(
        "false_alarms_per_beam",
        "false_alarm_probability",
        "echo_range_mean",
        "stray_range_onset",
        "echo_area_mean",
    ),
    shown_by=("others", "map"),
)
