"""What is calibrated besides the names: reflectances and the pose, by usual errors. No finding, and shown apart.

Its share of the gap is measured number by number, so that none of it is taken for an effect's.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.finding import with_role
from lidarcheck.explain.decision.findings import WIDEN
from lidarcheck.explain.report.explanation import Calibrated
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.intervals import HALF_WIDTH, Gap
from lidarcheck.inference.nuisance_fit import nuisance_spread
from lidarcheck.inference.nuisances import POSE_ERROR_DEG, REFLECTANCE_ERROR, Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale, left_by
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["Calibration", "calibrated", "entries", "with_shares"]

_ANGLES = ("yaw", "pitch")


@dataclass(frozen=True)
class Calibration:
    """A model with small errors put right, `off`, none where that comes no nearer; what it leaves of each of `PARTS`,
    shape (n_parts,), and draws of its noise. `own_surface`: see `Nuisance.calibrated`."""

    model: Model
    off: Nuisance
    own_surface: bool
    left: FloatArray
    noise: FloatArray


def calibrated(seen: Scale, model: Model, off: Nuisance, pool: WorkerPool) -> Calibration:
    """The model with the small errors put right that were fitted beside the effects, of reflectances, or of the pose
    too, whichever comes nearest.

    An ideal scan says too little of edges to turn its beams by a part of one: of a pose's error it can be nearer that
    each beam stays on the surface that it meets.
    """
    tables = dataclasses.replace(off, yaw=0.0, pitch=0.0)
    ways = [(Nuisance(), False), *([(tables, False)] if tables.words() else [])]
    posed = [] if off.still else [(off, own) for own in (False, True)]
    models = [one.calibrated(model, own_surface=own) for one, own in (*ways, *posed)]
    found = [*pool.map(Scale.excess_by_part, ((seen.shared, one) for one in models))]
    chance = float(found[0][1].mean(axis=1).std(ddof=1))
    # Two angles that are fitted come a little nearer whatever the pose is.
    left = [excess.mean() + chance * (i >= len(ways)) for i, (excess, _) in enumerate(found)]
    best = int(np.argmin(left))
    return Calibration(model if best == 0 else models[best], *(*ways, *posed)[best], *found[best])


def entries(
    simulator: Simulator, last: Fit, named: Model, put_right: Calibration
) -> tuple[tuple[Calibrated, ...], tuple[Model, ...]]:
    """What a calibration changes, number by number with 90 % intervals, and the models from `named` on that have one
    more of them each; without the shares of the gap. `last`: the fit that it is of, in the lab around its model."""
    axes = _axes(put_right.off)
    if not axes:
        return (), (named,)
    spread = nuisance_spread(simulator, last)
    found, models = [], [named]
    for axis in axes:
        part = _up_to(put_right.off, axes[: axes.index(axis) + 1])
        there = part.calibrated(named, own_surface=put_right.own_surface)
        one = _entry(axis, named, there, HALF_WIDTH * WIDEN * spread.get(axis, 1.0))
        if one.value != one.was:  # of a material that is hardly seen not one digit may change
            models.append(there)
            found.append(one)
    return tuple(found), tuple(models)


def with_shares(
    scale: Scale, found: tuple[Calibrated, ...], models: tuple[Model, ...], gap: Gap, pool: WorkerPool
) -> tuple[Calibrated, ...]:
    """The same with the share of the gap above the floor that each closes on some frames, one after the other."""
    excess = gap.before.value - gap.floor.value
    if not found or excess <= 0.0:
        return found
    left = left_by(scale, models, pool)
    return tuple(
        dataclasses.replace(one, gap_share=(before - after) / excess)
        for one, before, after in zip(found, left[:-1], left[1:], strict=True)
    )


def _axes(off: Nuisance) -> list[str | int]:
    """What is off at all: materials by number, then the angles."""
    materials = [number for number, value in sorted(off.materials.items()) if value]
    return [*materials, *(angle for angle in _ANGLES if getattr(off, angle))]


def _up_to(off: Nuisance, axes: list[str | int]) -> Nuisance:
    """Only these of the errors."""
    materials = {number: value for number, value in off.materials.items() if number in axes}
    yaw, pitch = (float(getattr(off, angle)) if angle in axes else 0.0 for angle in _ANGLES)
    return Nuisance(yaw, pitch, materials)


def _entry(axis: str | int, before: Model, after: Model, half: float) -> Calibrated:
    """One number: what it was, what it is, and how far off it may be, `half` usual errors."""
    if isinstance(axis, int):
        was, value = (model.materials[axis].reflectance for model in (before, after))
        low, high = (value * float(np.exp(sign * REFLECTANCE_ERROR * half)) for sign in (-1.0, 1.0))
        return Calibrated(f"materials.{axis}.reflectance", was, value, low, min(high, 1.0))
    pose = with_role("pose").name
    name = f"{axis}_deg"
    was, value = (
        next((float(e.settings()[name]) for e in model.effects if e.name == pose), 0.0) for model in (before, after)
    )
    return Calibrated(f"{pose}.{name}", was, value, value - POSE_ERROR_DEG * half, value + POSE_ERROR_DEG * half)
