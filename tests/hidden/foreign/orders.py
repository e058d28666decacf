"""Which cases a benchmark of foreign sensors holds: six sensors in turn, ten cases of each in sixty."""

from dataclasses import dataclass
from typing import Final

import numpy as np

SENSORS: Final = ("HDL-32E", "TMF8820-short", "OS1-128", "SLIM-channels", "XT32", "VLP-16")
KINDS: Final = (
    "single", "null", "single", "single", "alien", "single", "single", "null_nuisance", "single", "single",
)  # fmt: skip
EFFECTS: Final = {
    "linear": (
        "signal_gain", "range_offset", "range_scale", "dropout", "timing_jitter", "boresight", "incidence_falloff",
        "material_reflectance", "layer_gain", "threshold", "ambient_light", "motion", "blockage", "walk_error", "fog",
        "interference", "retro_ghost",
    ),
    "photon_histogram": (
        "signal_gain", "range_offset", "range_scale", "timing_jitter", "incidence_falloff", "material_reflectance",
        "ambient_light", "dark_counts", "pulse_shape", "walk_error",
    ),
    "spad_array": (
        "signal_gain", "range_offset", "range_scale", "dropout", "timing_jitter", "boresight", "incidence_falloff",
        "material_reflectance", "layer_gain", "threshold", "ambient_light", "motion", "blockage", "walk_error", "fog",
        "interference", "retro_ghost", "dark_counts", "pulse_shape",
    ),
}  # fmt: skip
ALIENS: Final = ("range_ripple", "column_gain")
DETECTOR: Final = dict.fromkeys(SENSORS, "linear") | {
    "TMF8820-short": "photon_histogram", "SLIM-channels": "spad_array",
}  # fmt: skip


@dataclass(frozen=True)
class CaseOrder:
    """What a case is to hide; `variant` is the sensor, `exclude` names what must not be named."""

    number: int
    kind: str
    seed: int
    effects: tuple[str, ...]
    strength: str
    variant: str
    scene: str
    exclude: tuple[str, ...] = ()


def plan(n: int, seed: int, only: str | None = None) -> list[CaseOrder]:
    """The first `n` cases of a seed's endless list; `only` one kind of them, numbered from 0 too.

    The sensors come in turn. Sensors of one detector share a deck of effects, so that sixty cases hide every effect.
    """
    rng = np.random.default_rng([seed, 31])
    decks = {detector: [str(name) for name in rng.permutation(names)] for detector, names in EFFECTS.items()}
    dealt = dict.fromkeys(decks, 0)
    orders: list[CaseOrder] = []
    for i in range(n):
        sensor = SENSORS[i % len(SENSORS)]
        kind = only or KINDS[i // len(SENSORS) % len(KINDS)]
        detector, effects = DETECTOR[sensor], ()
        if kind == "alien":
            # A histogram chip has three columns: a gain of columns is no pattern there.
            effects = (ALIENS[0] if detector == "photon_histogram" else ALIENS[i % len(SENSORS) % 2],)
        elif kind == "single":
            effects = (decks[detector][dealt[detector] % len(decks[detector])],)
            dealt[detector] += 1
        own = np.random.default_rng([seed, i, 32])
        scene = "bench" if detector == "photon_histogram" else "street"
        orders.append(CaseOrder(i, kind, int(own.integers(2**31)), effects, "medium", sensor, scene))
    return orders
