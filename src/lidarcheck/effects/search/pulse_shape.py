"""What a search must know of `pulse_shape`: wider or narrower, with a tail, a second pulse, or a slow fall."""

from lidarcheck.effects.search.base import FreeParameter, SearchSpec, Variant

_STRETCH, _TAIL_SHARE = FreeParameter("stretch", 0.05, log=True), FreeParameter("tail_share", 0.3, log=True)
_TAIL_NS = FreeParameter("tail_ns", 0.25, log=True)
_SECOND = (_STRETCH, _TAIL_SHARE, FreeParameter("tail_delay_ns", 1.0))
_FALL = (*_SECOND, _TAIL_NS)
_TWICE = {"stretch": 1.0, "tail_ns": 0.5, "tail_delay_ns": 9.0}
_SLOW = {"stretch": 1.0, "tail_ns": 1.0}

SPEC = SearchSpec(
    "pulse_shape",
    free=(_STRETCH, _TAIL_SHARE, _TAIL_NS),
    fixed_starts=(
        {"stretch": 0.75, "tail_share": 0.001},
        {"stretch": 1.3, "tail_share": 0.001},
        {"stretch": 1.0, "tail_share": 0.1, "tail_ns": 8.0},
    ),
    variants=(
        Variant("second pulse", _TWICE | {"tail_share": 0.05}, _SECOND),
        Variant("second pulse", _TWICE | {"tail_share": 0.2}, _SECOND),
        Variant("slow fall", _SLOW | {"tail_share": 0.1, "tail_delay_ns": 2.5}, _FALL),
        Variant("slow fall", _SLOW | {"tail_share": 0.35, "tail_delay_ns": 3.5}, _FALL),
    ),
    order=17,
    factors=("stretch",),
    groups=frozenset({"detector"}),
    confused_with={"threshold": "the echo's WIDTH over AREA on a bright panel"},
    form_errors={"tail_share": 0.20, "tail_ns": 0.10},  # what a tail is taken to be
    watched_by=("width_mean", "peak_mean", "area_mean"),
    shown_by=("width", "histogram"),
)
