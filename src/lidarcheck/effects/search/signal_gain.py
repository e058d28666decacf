"""What a search must know of `signal_gain`."""

from lidarcheck.effects.search.base import GAIN_ERROR, FreeParameter, SearchSpec
from lidarcheck.effects.search.parts import UsualError

SPEC = SearchSpec(
    "signal_gain",
    free=(FreeParameter("gain", 0.05, log=True),),
    fixed_starts=({"gain": 0.8}, {"gain": 1.25}, {"gain": 0.5}),
    factors=("gain",),
    groups=frozenset({"light", "detector"}),
    special_case_of="layer_gain",  # gains that are alike in all layers
    confused_with={
        "material_reflectance": "targets of other materials at the same range",
        "crosstalk": "many frames of a panel of medium signal: crosstalk scatters AREA more",
    },
    usual_error=UsualError(GAIN_ERROR, ("gain",), log=True),
    may_stay={"area": (0.12, 0.06), "peak": (0.12, 0.06)},
    in_repeats=True,
    watched_by=("area_mean", "detection_probability", "peak_mean"),
    shown_by=("area", "range"),
)
