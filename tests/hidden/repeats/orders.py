"""Which recordings a benchmark of repeats holds: of three, two hide what repeats can show, one what they cannot."""

from dataclasses import dataclass
from typing import Final

import numpy as np

SENSORS: Final = ("XT32", "OS1-128", "SLIM-channels")
"""Sensors that fire the same rays in every frame."""
CHANGES: Final = ("timing_jitter", "dropout", "vibration", "interference", "rain", "ambient_light", "threshold")
"""What differs from repeat to repeat, or makes scatter and loss that the sensor's laws do not have."""
CONSTANT: Final = (
    "range_offset", "range_scale", "walk_error", "material_reflectance", "layer_gain", "incidence_falloff", "blockage",
    "boresight", "retro_ghost", "fog",
)  # fmt: skip
"""What is the same in every repeat."""
KINDS: Final = ("single", "untestable", "single")


@dataclass(frozen=True)
class CaseOrder:
    """What a recording is to hide; `variant` is the sensor, `exclude` names what must not be named."""

    number: int
    kind: str
    seed: int
    effects: tuple[str, ...]
    strength: str
    variant: str
    scene: str = "street"
    exclude: tuple[str, ...] = ()


def plan(n: int, seed: int, only: str | None = None) -> list[CaseOrder]:
    """The first `n` recordings of a seed's endless list; `only` one kind of them, numbered from 0 too.

    Sensors come in turn, each kind with its own, so that thirty recordings hide every effect.
    """
    rng = np.random.default_rng([seed, 51])
    names = {"single": CHANGES, "untestable": CONSTANT, "null": ("",)}
    decks = {kind: [str(name) for name in rng.permutation(every)] for kind, every in names.items()}
    dealt = dict.fromkeys(decks, 0)
    orders: list[CaseOrder] = []
    for i in range(n):
        kind = only or KINDS[i % len(KINDS)]
        at = dealt[kind]
        dealt[kind] += 1
        # Each time that a deck is dealt anew the sensors move on by one.
        sensor = SENSORS[(at + at // len(decks[kind])) % len(SENSORS)]
        name = decks[kind][at % len(decks[kind])]
        own = np.random.default_rng([seed, i, 52])
        orders.append(CaseOrder(i, kind, int(own.integers(2**31)), (name,) if name else (), "medium", sensor))
    return orders
