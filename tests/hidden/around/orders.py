"""Which cases a benchmark of models that are not ours holds: the two examples in turn."""

from typing import Final

import numpy as np

from hidden.foreign.orders import CaseOrder

MODELS: Final = ("own_model_c", "own_model_python")
KINDS: Final = (
    "single", "single", "null", "single", "single", "alien", "single", "single", "null_nuisance", "single",
)  # fmt: skip
EFFECTS: Final = (
    "signal_gain", "range_offset", "range_scale", "dropout", "timing_jitter", "boresight", "incidence_falloff",
    "material_reflectance", "layer_gain", "threshold", "ambient_light", "motion", "blockage", "walk_error",
    "interference", "retro_ghost",
)  # fmt: skip
ALIENS: Final = ("range_ripple", "column_gain")


def plan(n: int, seed: int, only: str | None = None) -> list[CaseOrder]:
    """The first `n` cases of a seed's endless list; `only` one kind of them. Twenty cases hide fourteen effects."""
    rng = np.random.default_rng([seed, 51])
    deck = [str(name) for name in rng.permutation(EFFECTS)]
    orders: list[CaseOrder] = []
    dealt = 0
    for i in range(n):
        model, kind, effects = MODELS[i % len(MODELS)], only or KINDS[i // len(MODELS) % len(KINDS)], ()
        if kind == "alien":
            effects = (ALIENS[i % len(ALIENS)],)
        elif kind == "single":
            effects = (deck[dealt % len(deck)],)
            dealt += 1
        own = np.random.default_rng([seed, i, 52])
        orders.append(CaseOrder(i, kind, int(own.integers(2**31)), effects, "medium", model, "street"))
    return orders
