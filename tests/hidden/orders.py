"""Which cases a benchmark holds: deterministic in number and seed, and balanced in every beginning."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from .forms import STRENGTHS

NAMES: Final = (
    "signal_gain", "ambient_light", "dark_counts", "crosstalk", "afterpulsing", "dead_time", "pulse_shape",
    "timing_jitter", "range_offset", "range_scale", "walk_error", "threshold", "boresight", "beam_divergence",
    "incidence_falloff", "material_reflectance", "layer_gain", "blooming_vertical", "blooming_horizontal",
    "retro_ghost", "mirror_multipath", "fog", "rain", "motion", "vibration", "blockage", "interference", "dropout",
)  # fmt: skip
GROUPS: Final = {
    "amplitude": ("signal_gain", "material_reflectance", "incidence_falloff", "layer_gain", "blockage"),
    "background": ("ambient_light", "dark_counts", "threshold"),
    "detector": ("crosstalk", "afterpulsing", "dead_time", "pulse_shape"),
    "range": ("range_offset", "range_scale", "walk_error", "timing_jitter"),
    "aim": ("boresight", "beam_divergence", "motion", "vibration"),
    "bright": ("blooming_vertical", "blooming_horizontal", "retro_ghost"),
    "stray": ("mirror_multipath", "fog", "rain", "interference", "dropout"),
}
# Hidden with their own name out of the catalogue: only such as no other name, and no nuisance, can stand in for.
IRREPLACEABLE: Final = (
    "timing_jitter", "walk_error", "layer_gain", "blooming_vertical", "fog", "beam_divergence", "interference",
    "retro_ghost", "pulse_shape", "vibration", "incidence_falloff", "mirror_multipath", "blooming_horizontal",
    "blockage", "range_scale", "dropout",
)  # fmt: skip
ALIEN_NAMES: Final = (
    "range_ripple", "gated_gain", "stuck_columns", "peak_compression", "column_gain", "layer_offset", "coarse_range",
    "polarised_gain", "width_clock", "area_gain", "amplitude_noise",
)  # fmt: skip
SCENES_FOR: Final = {
    "blooming_vertical": ("sign",), "blooming_horizontal": ("sign",), "retro_ghost": ("sign",),
    "incidence_falloff": ("lab", "mixed"), "mirror_multipath": ("street", "mixed"),
    "beam_divergence": ("street", "mixed", "lab"),
    "boresight": ("street", "mixed", "lab"), "vibration": ("street", "mixed"), "motion": ("street", "mixed"),
    "material_reflectance": ("lab", "mixed", "street"),
}  # fmt: skip
SHARES: Final = {"single": 0.40, "pair": 0.15, "null_nuisance": 0.13, "null": 0.12, "left_out": 0.10, "alien": 0.10}
SEVERAL: Final = "several"  # three or four effects at once; asked for by name, no part of the mixture
FEWEST_OF_SEVERAL: Final = 3
WITH_NUISANCE: Final = 0.5


@dataclass(frozen=True)
class CaseOrder:
    """What a case is to hide; `exclude` names what the explainer must leave out of its catalogue."""

    number: int
    kind: str
    seed: int
    effects: tuple[str, ...]
    strength: str
    variant: str
    scene: str
    exclude: tuple[str, ...] = ()


def _kinds(n: int) -> list[str]:
    """The kind that lags most behind its share comes next, so that every beginning is balanced."""
    count = dict.fromkeys(SHARES, 0)
    kinds = []
    for i in range(n):
        kind = max(SHARES, key=lambda k: SHARES[k] * (i + 1) - count[k])
        count[kind] += 1
        kinds.append(kind)
    return kinds


def _pair(rng: np.random.Generator, first: str) -> tuple[str, str]:
    """A second effect from another group."""
    group = next(g for g, names in GROUPS.items() if first in names)
    others = [g for g in GROUPS if g != group]
    names = GROUPS[others[int(rng.integers(len(others)))]]
    second = names[int(rng.integers(len(names)))]
    both = (first, second)
    return min(both, key=NAMES.index), max(both, key=NAMES.index)


def _several(rng: np.random.Generator, first: str, count: int) -> tuple[str, ...]:
    """So many effects, each of another group."""
    group = next(g for g, names in GROUPS.items() if first in names)
    others = rng.permutation([g for g in GROUPS if g != group])[: count - 1]
    names = [first, *(str(rng.choice(GROUPS[str(g)])) for g in others)]
    return tuple(sorted(names, key=NAMES.index))


def _scene(effects: tuple[str, ...], rng: np.random.Generator) -> str:
    wanted = [SCENES_FOR[e] for e in effects if e in SCENES_FOR]
    if not wanted:
        return str(rng.choice(["street", "lab", "sign", "mixed", "mixed"]))
    common = [s for s in wanted[0] if all(s in w for w in wanted)]
    return str(rng.choice(common)) if common else "mixed"


def plan(n: int, seed: int, only: str | None = None) -> list[CaseOrder]:
    """The first `n` cases of a seed's endless list; `only` one kind of them, numbered from 0 too."""
    rng = np.random.default_rng([seed, 20])
    deck = {
        "single": list(rng.permutation(NAMES)), "pair": list(rng.permutation(NAMES)),
        "left_out": list(rng.permutation(IRREPLACEABLE)), "alien": list(rng.permutation(ALIEN_NAMES)),
        SEVERAL: list(rng.permutation(NAMES)),
    }  # fmt: skip
    kinds = (*SHARES, SEVERAL)
    turn = dict.fromkeys(kinds, 0)
    orders: list[CaseOrder] = []
    for kind in _kinds(n) if only is None else [only] * n:
        k = turn[kind]
        turn[kind] += 1
        own = np.random.default_rng([seed, kinds.index(kind), k])
        name = str(deck[kind][k % len(deck[kind])]) if kind in deck else ""
        # Beyond one round of all names, each comes at its next strength.
        strength = STRENGTHS[(k + k // len(NAMES)) % 3] if kind == "single" else STRENGTHS[1 + k % 2]
        effects = {
            "single": (name,),
            "left_out": (name,),
            "alien": (name,),
            "pair": _pair(own, name) if kind == "pair" else (),
            SEVERAL: _several(own, name, FEWEST_OF_SEVERAL + k % 2) if kind == SEVERAL else (),
        }.get(kind, ())
        variant, scene = ("SMART", "SLIM")[int(own.integers(2))], _scene(effects, own)
        exclude = effects if kind == "left_out" else ()
        orders.append(
            CaseOrder(len(orders), kind, int(own.integers(2**31)), effects, strength, variant, scene, exclude)
        )
    return orders
