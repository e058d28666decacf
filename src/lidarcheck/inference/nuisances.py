"""What may be a little wrong without being worth a name: table entries, the sensor's place. Fitted, within bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import STAGES, Effect
from lidarcheck.effects.finding import make, with_role
from lidarcheck.effects.geometry.surfaces import normals_of, surfaces_of
from lidarcheck.effects.search import search_spec
from lidarcheck.effects.search.base import GAIN_ERROR, POSE_ERROR_DEG, REFLECTANCE_ERROR
from lidarcheck.effects.search.parts import UsualError
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces, aimed
from lidarcheck.scan import IdealScan

__all__ = [
    "GAIN_ERROR",
    "LIMIT",
    "POSE_ERROR_DEG",
    "REFLECTANCE_ERROR",
    "Nuisance",
    "at",
    "axes_of",
    "beside",
    "is_usual_error",
]


HEIGHT_ERROR_M = 0.01
"""Usual error (standard deviation) of the sensor's height."""

_FARTHEST_MOVED_M, _NEAREST_M = 1.0, 1e-3
"""A surface seen at a grazing angle is taken to move no farther, and none to come behind the sensor."""
_SAME_PLANE_DEG = 1.0
"""A plane found from the beams beside is a beam's own surface where it is met at nearly the angle that is stated."""

LIMIT = 2.5
"""No nuisance is more than so many of its usual errors; what is larger is an effect and gets a name."""


@dataclass(frozen=True)
class Nuisance:
    """How far gain, reflectances and pose are off, each in units of its usual error; nothing by default. The sensor's
    height is worth no name and no place in a model: it is put right where a model is held against a measurement."""

    yaw: float = 0.0
    pitch: float = 0.0
    materials: Mapping[int, float] = field(default_factory=dict)
    height: float = 0.0

    @property
    def penalty(self) -> float:
        """Sum of squares: how unusual that is."""
        return float(self.yaw**2 + self.pitch**2 + self.height**2 + sum(v**2 for v in self.materials.values()))

    @property
    def usual(self) -> bool:
        """Whether none is at its limit, and all reflectances together are off by no more than a gain may be."""
        return self._within_limits(GAIN_ERROR)

    @property
    def conceivable(self) -> bool:
        """Whether none is at its limit, and all reflectances together are off by no more than a gain and the mean of so
        many of them may be."""
        of_mean = REFLECTANCE_ERROR / np.sqrt(max(len(self.materials), 1))
        return self._within_limits(float(np.hypot(GAIN_ERROR, of_mean)))

    def _within_limits(self, common_error: float) -> bool:
        values = [self.yaw, self.pitch, self.height, *self.materials.values()]
        common = float(np.mean([*self.materials.values()])) if self.materials else 0.0
        return max(map(abs, values)) < 0.95 * LIMIT and abs(common) * REFLECTANCE_ERROR < LIMIT * common_error

    @property
    def still(self) -> bool:
        """Whether the beams look where they should."""
        return self.yaw == 0.0 and self.pitch == 0.0

    def said_by(self, effect: Effect, parameter: str) -> float:
        """How much of this an effect's parameter says itself, in its unit; of a factor, its logarithm."""
        error = search_spec(effect.name).usual_error
        if error is None or parameter not in error.parameters:
            return 0.0
        if effect.role == "gain":
            return REFLECTANCE_ERROR * (float(np.mean([*self.materials.values()])) if self.materials else 0.0)
        if effect.role == "reflectance":
            return REFLECTANCE_ERROR * self.materials.get(int(effect.settings()["material_id"]), 0.0)
        return POSE_ERROR_DEG * {"yaw_deg": self.yaw, "pitch_deg": self.pitch}.get(parameter, 0.0)

    def model(self, model: Model) -> Model:
        """The model with the reflectances of this nuisance."""
        if not any(self.materials.values()):
            return model
        table = {
            i: replace(entry, reflectance=_scaled(entry.reflectance, self.materials.get(i, 0.0)))
            for i, entry in model.materials.items()
        }
        return replace(model, materials=table)

    def calibrated(self, model: Model, *, own_surface: bool = False) -> Model:
        """The model corrected for this nuisance: reflectances of its table, and a small boresight correction.

        `own_surface`: it leaves each beam on the surface that it meets, unless the model turns the view already.
        """
        model = self.model(model)
        if self.still:
            return model
        old = next((e.settings() for e in model.effects if e.role == "pose"), {})
        turn = {
            "yaw_deg": float(old.get("yaw_deg", 0.0)) + round(self.yaw * POSE_ERROR_DEG, 5),
            "pitch_deg": float(old.get("pitch_deg", 0.0)) + round(self.pitch * POSE_ERROR_DEG, 5),
        }
        kept = {"own_surface": 1} if own_surface and not old else {}
        return model.with_(make(with_role("pose").name, {**old, **turn, **kept}))

    def posed(self, model: Model, surfaces: Sequence[Surfaces]) -> tuple[Model, list[Surfaces]]:
        """A model and ideal scans, with their surfaces, that show the error of the pose and of the height.

        An ideal scan that was aimed knows surfaces only as they are seen from there: before other effects of aim the
        pose's error is one of them.
        """
        if self.height:
            surfaces = [_seen_from(one, self.height * HEIGHT_ERROR_M) for one in surfaces]
        if self.still:
            return model, list(surfaces)
        if any(effect.stage == "aim" for effect in model.effects):
            return beside(model, self.turn()), list(surfaces)
        turning = replace(model, effects=(self.turn(),))
        return model, [Surfaces(aimed(one.ideal, turning, surfaces=one)) for one in surfaces]

    def turn(self) -> Effect:
        """The pose's error as an effect. Beams stay on their surfaces: which of them look past an edge depends on where
        it lies to a part of a beam, and those that the measurement has are forgiven."""
        angles = {"yaw_deg": self.yaw * POSE_ERROR_DEG, "pitch_deg": self.pitch * POSE_ERROR_DEG}
        return make(with_role("pose").name, {**angles, "own_surface": 1})

    def words(self) -> list[str]:
        """What is off, in words, where it is off by more than a tenth of a usual error."""
        found = []
        for name, value in (("yaw", self.yaw), ("pitch", self.pitch)):
            if abs(value) > 0.1:
                found.append(f"{name} {value * POSE_ERROR_DEG:+.4f} deg")
        if abs(self.height) > 0.1:
            found.append(f"height {self.height * HEIGHT_ERROR_M * 1e3:+.1f} mm")
        for i, value in self.materials.items():
            if abs(value) > 0.1:
                found.append(f"reflectance of material {i} {100.0 * np.expm1(REFLECTANCE_ERROR * value):+.1f} %")
        return found


def _seen_from(surfaces: Surfaces, higher_m: float) -> Surfaces:
    """The surfaces as a sensor sees them that is higher by so much: each beam stays on the plane that it meets."""
    ideal = surfaces.ideal
    shown = surfaces_of(ideal, surfaces)
    normal = normals_of(ideal, surfaces)
    towards = (normal * ideal.beams.directions(ideal.layer, ideal.point)).sum(axis=1)
    per_m = -np.divide(normal[:, 2], towards, out=np.zeros(len(ideal)), where=towards < 0.0)
    fits = np.abs(shown.own_deg - ideal.incidence_deg) < _SAME_PLANE_DEG
    per_m = per_m[_nearest_that_fits(ideal, fits)]
    farther_m = np.clip(higher_m * per_m, -_FARTHEST_MOVED_M, _FARTHEST_MOVED_M)
    hit = ideal.distance_m > 0.0
    distance_m = np.where(hit, np.maximum(ideal.distance_m + farther_m, _NEAREST_M), ideal.distance_m)
    return Surfaces(replace(ideal, distance_m=distance_m))


def _nearest_that_fits(ideal: IdealScan, fits: BoolArray) -> IndexArray:
    """For each row itself where it `fits`, else the nearest row of its layer and material that does, (n,).

    At the end of a sector the beams beside lie in one line and tell no plane. A ground that moved but for those would
    be broken there, and rays that are aimed anew would pass through.
    """
    order = np.lexsort((ideal.point, ideal.material_id, ideal.layer))
    layer, material = ideal.layer[order], ideal.material_id[order]
    group = np.cumsum(np.append(True, (np.diff(layer) != 0) | (np.diff(material) != 0))[: len(order)])
    place = np.arange(len(order))
    before = np.maximum.accumulate(np.where(fits[order], place, -1))
    after = np.minimum.accumulate(np.where(fits[order], place, len(order))[::-1])[::-1]
    found, nearest = place.copy(), np.full(len(order), np.inf)
    for other in (before, after):
        there = np.clip(other, 0, len(order) - 1)
        away = np.abs(ideal.point[order][there] - ideal.point[order])
        nearer = (other == there) & (group[there] == group) & (away < nearest)
        found[nearer], nearest[nearer] = there[nearer], away[nearer]
    row = np.empty(len(order), dtype=np.int64)
    row[order] = order[found]
    return row


def beside(model: Model, effect: Effect) -> Model:
    """The model with an effect before those that it has, also where it has one of that name already."""
    return replace(model, effects=tuple(sorted((effect, *model.effects), key=lambda e: STAGES.index(e.stage))))


def _scaled(reflectance: float, errors: float) -> float:
    """A table entry off by so many usual errors, to five digits; nothing is more than white."""
    return min(float(f"{reflectance * np.exp(REFLECTANCE_ERROR * errors):.5g}"), 1.0) if errors else reflectance


def is_usual_error(effect: Effect, besides: Nuisance | None = None) -> bool:
    """Whether an effect is no more than what gain, a table entry or the pose may be off without being worth a name.

    `besides`: the nuisance that was fitted before it, of which the effect is a further part.
    """
    error = search_spec(effect.name).usual_error
    return error is not None and all(
        abs(_off_by(effect, name, error) + (besides or Nuisance()).said_by(effect, name)) <= LIMIT * error.size
        for name in error.parameters
    )


def _off_by(effect: Effect, parameter: str, error: UsualError) -> float:
    """How far a parameter is from what it is without the effect; of a factor, the logarithm."""
    value = float(effect.settings()[parameter])
    return float(np.log(max(value, 1e-9))) if error.log else value


def axes_of(materials: Sequence[int], effects: Sequence[Effect] = ()) -> list[str | int]:
    """The axes along which a nuisance is fitted beside some effects: yaw, pitch, height, and the materials by number.

    What an effect says of itself is no nuisance: the pose beside an effect that is one, or where the view turns at
    random, a material beside its own.
    """
    posed = any(effect.role == "pose" or _acts_anew(effect) for effect in effects)
    named = {e.settings()["material_id"] for e in effects if e.role == "reflectance"}
    return [*([] if posed else ["yaw", "pitch"]), "height", *(i for i in materials if i not in named)]


def _acts_anew(effect: Effect) -> bool:
    """Whether an effect acts otherwise in each frame, so that a few frames have a mean of their own by chance."""
    acts_anew = search_spec(effect.name).acts_anew
    return acts_anew is not None and acts_anew(effect)


def at(axes: Sequence[str | int], x: FloatArray, *, gain: bool = True) -> Nuisance:
    """The nuisance at a point of those axes, kept within the limits.

    `gain`: whether all materials may be off together, as the gain would make them.
    """
    x = np.clip(x, -LIMIT, LIMIT)
    tables = x[[isinstance(axis, int) for axis in axes]]
    if len(tables):
        # What all materials have in common is the gain's error and the mean of theirs.
        most = LIMIT * np.sqrt((GAIN_ERROR / REFLECTANCE_ERROR) ** 2 + 1.0 / len(tables)) if gain else 0.0
        tables = tables - tables.mean() + np.clip(tables.mean(), -most, most)
        x = np.concatenate([x[: len(x) - len(tables)], tables])
    values = dict(zip(axes, x.tolist(), strict=True))
    yaw, pitch, height = (values.pop(name, 0.0) for name in ("yaw", "pitch", "height"))
    return Nuisance(yaw, pitch, {int(k): v for k, v in values.items()}, height)
