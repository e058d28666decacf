"""What an effect does, shown on a small demonstration: the one curve of many that it changes most clearly.

The demonstration runs through the model without and with the effect, a few frames each, from the same seed. Every
quantity is averaged over every axis; of all curves the one is shown whose change stands out most from the noise of the
frames. No effect is known here by name, so one that is added as a file has its plot at once.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects import Effect
from lidarcheck.model.chain import simulate
from lidarcheck.model.showcase.curves import CandidateCurve, candidates
from lidarcheck.model.showcase.features import Features, features
from lidarcheck.model.showcase.scene import MATERIALS, ideal_scan, scene
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor

__all__ = ["EffectCurve", "show"]

FRAMES = 4
_CLEAR = 4.5
"""Standard errors by which the change must exceed what chance does to the whole curve."""
_AS_CLEAR = 0.05
"""Curves whose changes stand out as clearly but for this part: the first of them is shown, which is the simplest."""
_VISIBLE = 0.12
"""A change that is mostly smaller than this part of the curve's height is drawn as a ratio or a difference instead."""


@dataclass(frozen=True)
class EffectCurve:
    """A curve without (`before`) and with (`after`) an effect, shapes (n,).

    `strength`: the change in standard errors, root mean square over the curve; `significant`: whether that is more than
    chance makes. `quantity` and `over` name what is drawn, `label` says it in words.
    """

    effect: str
    quantity: str
    over: str
    label: str
    x_label: str
    y_label: str
    x: FloatArray
    before: FloatArray
    after: FloatArray
    log_x: bool
    strength: float
    significant: bool
    variant: str
    seed: int

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "effect"}


def show(effect: Effect, *, variant: str = "SMART", seed: int = 0) -> EffectCurve:
    """The curve that shows best what an effect does, on the reference sensor of a variant.

    The same arguments give the same curve. `UsageError` for an unknown variant or a seed out of range.
    """
    without = _without(variant, seed)
    found = list(candidates(without, _run(variant, seed, (effect,))))
    most = max(candidate.merit for candidate in found)
    best = next(candidate for candidate in found if candidate.merit >= most - _AS_CLEAR * abs(most))
    return _shown(effect, best, variant, seed)


@functools.lru_cache(maxsize=4)
def _without(variant: str, seed: int) -> Features:
    return _run(variant, seed, ())


def _run(variant: str, seed: int, effects: tuple[Effect, ...]) -> Features:
    model = Model(Sensor.of(variant), MATERIALS, effects)
    return features([simulate(ideal_scan(), model, seed=seed, frame=f, scene=scene()) for f in range(FRAMES)])


def _shown(effect: Effect, best: CandidateCurve, variant: str, seed: int) -> EffectCurve:
    quantity, x, before, after = best.quantity, best.x, best.before, best.after
    words, unit = quantity.words, quantity.unit
    height = float(np.ptp(np.concatenate([before, after]))) if len(x) else 0.0
    if len(x) and float(np.median(np.abs(after - before))) < _VISIBLE * height:
        if quantity.relative == "ratio":
            words, unit, after, before = f"{words}, relative", "1 = without", after / before, before / before
        elif quantity.relative == "change":
            words, after, before = f"{words}: change", after - before, before - before
    strength = float(np.sqrt(best.chi2 / max(len(best.x), 1)))
    return EffectCurve(
        effect=effect.name,
        quantity=quantity.name,
        over=best.axis.name,
        label=f"{words} over {best.axis.label}",
        x_label=best.axis.label,
        y_label=f"{words} [{unit}]",
        x=x,
        before=before,
        after=after,
        log_x=best.axis.log,
        strength=strength,
        significant=best.excess > _CLEAR * float(np.sqrt(2.0 * max(len(best.x), 1))),
        variant=variant,
        seed=seed,
    )
