"""What a search must know of `rain`: many small drops, or few large ones."""

from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, SearchSpec, Variant

_FREE = (
    FreeParameter("rate_mm_h", LOG_STEP, log=True),
    FreeParameter("drop_echo", 0.4, log=True),
    FreeParameter("drop_density", 0.4, log=True, least=0.002),
)
_LARGE = {"beam_diameter_m": 0.001, "divergence_mrad": 2.0, "drop_shape": 2.0, "drop_echo": 5.0, "drop_density": 0.1}
_DROPS = (*_FREE, FreeParameter("drop_shape", 0.5))

SPEC = SearchSpec(
    "rain",
    free=_FREE,
    fixed_starts=({"rate_mm_h": 10.0}, {"rate_mm_h": 40.0}),
    variants=(
        Variant("large drops", {"rate_mm_h": 10.0} | _LARGE, _DROPS),
        Variant("large drops", {"rate_mm_h": 40.0} | _LARGE, _DROPS),
    ),
    order=16,
    amounts=("rate_mm_h",),
    named_by={"drop_density": 0.0},  # drops that nobody sees, and the light that they take, are fog as well
    in_repeats=True,
    watched_by=("false_alarms_per_beam", "echo_range_mean", "area_loss_per_metre", "stray_range_onset"),
    shown_by=("others", "histogram"),
)
