"""An ideal scan of a target that was cut out of measured scans: its form fitted or its pose known, the beams cast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.ideals.fitting import FEWEST_ECHOES, Fit, Rays, cylinder_start, fitted, plane_start, standing
from lidarcheck.ideals.surfaces import Cylinder, Met, Plane, Surface, inside
from lidarcheck.model.chain import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.scenes.firing import Span, places
from lidarcheck.sensor import Beams, Sensor

__all__ = ["Region", "Snippet", "cylinder_of", "ideal_of_snippet", "plane_of"]

_SEEDS = 8
"""Simulated frames by which the model's own shift of the range is told: its scatter is then a third of a frame's."""


@dataclass(frozen=True)
class Region:
    """Where the target is cut out: `box_m` x0, x1, y0, y1, z0, z1 in the sensor's frame, and the first and the last
    layer and point, both included; None: no limit."""

    box_m: tuple[float, float, float, float, float, float] | None = None
    layers: Span = None
    points: Span = None

    def holds_beams(self, layer: IntArray, point: IntArray) -> BoolArray:
        """Which beams may belong to it, shape (n,)."""
        found = np.ones(len(layer), dtype=np.bool_)
        for span, number in ((self.layers, layer), (self.points, point)):
            if span is not None:
                found &= (number >= span[0]) & (number <= span[1])
        return found

    def holds_places(self, place_m: FloatArray) -> BoolArray:
        """Which places, shape (n, 3), lie in it."""
        if self.box_m is None:
            return np.asarray(np.isfinite(place_m).all(axis=1))
        low, high = np.array(self.box_m[::2]), np.array(self.box_m[1::2])
        return np.asarray(((place_m >= low) & (place_m <= high)).all(axis=1))


@dataclass(frozen=True)
class Snippet:
    """The ideal scan of all beams, with NaN for those that do not meet the target, and where the target stands.

    `echoes`: those in the region. `fitted`: whether pose or form were fitted to them.
    """

    ideal: IdealScan
    fit: Fit
    echoes: int
    fitted: bool

    @property
    def on_target(self) -> BoolArray:
        """Which rows meet the target, shape (n,)."""
        return np.asarray(self.ideal.distance_m > 0.0)


def plane_of(rays: Rays) -> Fit:
    """The plane that the echoes show, whatever of them lies on it."""
    return fitted(plane_start(rays), rays)


def cylinder_of(rays: Rays, radius_m: float | None = None) -> Fit:
    """The cylinder that the echoes show; `radius_m`: where it is known."""
    return fitted(cylinder_start(rays, radius_m), rays)


def ideal_of_snippet(
    scans: Sequence[Scan],
    sensor: Sensor,
    region: Region,
    target: Surface | None = None,
    *,
    form: str = "plane",
    radius_m: float | None = None,
    fit: bool = False,
    material: int = 1,
    model: Model | None = None,
) -> Snippet:
    """What each of the sensor's beams meets of a target in the region.

    `scans`: echoes of one sensor at rest, whose beams are the same in each. `target`: where it stands; None: found as a
    `form`, "plane" or "cylinder" of `radius_m`. `fit`: its pose is only near, and fitted. A fitted target's distances
    have `DistanceError`, and where a `model` is given, what that model itself adds to its ranges is taken off.
    `UsageError` where too few echoes are there, or no such form.
    """
    beams = _beams_of(scans)
    rays = _echoes(scans, sensor, region)
    if len(rays.range_m) < FEWEST_ECHOES:
        what = f"{len(rays.range_m)} echoes lie in the region, {FEWEST_ECHOES} are needed"
        raise UsageError(what, fix="is it in metres and in the sensor's frame?")
    if target is None:
        found = plane_of(rays) if form == "plane" else cylinder_of(rays, radius_m)
    else:
        found = fitted(target, rays) if fit else standing(target, rays)
    if not found.used.any():
        raise UsageError("no echo lies on the target", fix="is its pose that of the sensor's frame, in metres?")
    estimated = target is None or fit
    layer, point = _numbers(beams, scans)
    cast = _Cast.of(beams, layer, point)
    met, on = _on_target(found, rays, region, cast)
    if not on.any():
        raise UsageError("no beam meets the target", fix="choose a larger region")
    ideal = _ideal(cast, met, on, material, found, estimated)
    if estimated and model is not None:
        ideal = replace(ideal, distance_m=ideal.distance_m - _shift_of_model(found, ideal, on, cast, sensor, model))
    return Snippet(ideal, found, len(rays.range_m), estimated)


@dataclass(frozen=True)
class _Cast:
    """Beams and their rays, a row each."""

    beams: Beams
    layer: IntArray
    point: IntArray
    origin_m: FloatArray
    direction: FloatArray

    @classmethod
    def of(cls, beams: Beams, layer: IntArray, point: IntArray) -> _Cast:
        origin = beams.origins_m(layer, point)
        direction = beams.directions(layer, point)
        return cls(beams, layer, point, np.zeros_like(direction) if origin is None else origin, direction)


def _beams_of(scans: Sequence[Scan]) -> Beams:
    """The beams that all scans have; `UsageError` where columns look elsewhere in each."""
    beams = scans[0].beams
    if any(other.beams != beams for other in scans[1:]):
        what = "the scans' beams do not look the same way in every frame"
        raise UsageError(what, fix="give one scan, and an ideal scan of each")
    return beams


def _numbers(beams: Beams, scans: Sequence[Scan]) -> tuple[IntArray, IntArray]:
    """Layer and point of every beam; of a sensor whose scans bring them those of the scan's rays."""
    layer, point = beams.every()
    if len(layer):
        return layer, point
    number = np.unique(np.stack([scans[0].layer, scans[0].point]), axis=1)
    return number[0], number[1]


def _echoes(scans: Sequence[Scan], sensor: Sensor, region: Region) -> Rays:
    """The echoes in the region along their rays, without what the sensor adds to every range."""
    parts = []
    for scan in scans:
        xyz = np.column_stack([scan.x_m, scan.y_m, scan.z_m])
        rows = np.flatnonzero(scan.beams.has(scan.layer, scan.point) & region.holds_places(xyz))
        rows = rows[region.holds_beams(scan.layer[rows], scan.point[rows])]
        cast = _Cast.of(scan.beams, scan.layer[rows], scan.point[rows])
        added = scan.beams.range_offset_m(scan.layer[rows]) + sensor.range_offset_m
        parts.append(Rays(cast.origin_m, cast.direction, scan.range_m[rows] - added))
    return Rays(*(np.concatenate([getattr(part, name) for part in parts]) for name in Rays.__dataclass_fields__))


def _on_target(found: Fit, rays: Rays, region: Region, cast: _Cast) -> tuple[Met, BoolArray]:
    """What all rays meet of the target's surface, and which of them within its outline and the region.

    A plane without a size and a cylinder without a height go on for ever: theirs is the convex outline of the echoes.
    """
    surface = found.surface
    met = surface.met(cast.origin_m, cast.direction)
    place = cast.origin_m + met.distance_m[:, None] * cast.direction
    on = region.holds_beams(cast.layer, cast.point) & np.isfinite(met.distance_m) & region.holds_places(place)
    if (isinstance(surface, Plane) and surface.size_m is None) or (
        isinstance(surface, Cylinder) and surface.height_m is None
    ):
        used = rays.take(found.used)
        own = surface.met(used.origin_m, used.direction).own_m
        on[on] = inside(surface.outline(met.own_m[on]), surface.outline(own))
    return met, on


def _ideal(cast: _Cast, met: Met, on: BoolArray, material: int, found: Fit, estimated: bool) -> IdealScan:
    cosine = np.abs(np.einsum("ij,ij->i", met.normal, cast.direction))
    distance = np.where(on, met.distance_m, np.nan)
    extra: dict[str, npt.NDArray[np.generic]] = {}
    if estimated:
        error = np.full(len(on), np.nan)
        part = Met(met.distance_m[on], met.normal[on], met.own_m[on])
        error[on] = found.error_m(cast.direction[on], part)
        extra["DistanceError"] = error
    if cast.beams.lattice:
        extra["Edge"] = (on & _beside_others(cast, on)).astype(np.int32)
    return IdealScan(
        cast.layer,
        cast.point,
        distance,
        np.full(len(on), material, dtype=np.int32),
        np.where(on, np.rad2deg(np.arccos(np.minimum(cosine, 1.0))), 0.0),
        extra={**extra, **places(cast.beams, cast.layer, cast.point, distance)},
        beams=cast.beams,
    )


def _beside_others(cast: _Cast, on: BoolArray) -> BoolArray:
    """Beams beside which, along the layer or in the next one, a beam does not meet the target, shape (n,)."""
    column = cast.beams.image_column(cast.layer, cast.point)
    wide = int(column.max()) + 1
    other = np.zeros((int(cast.layer.max()) + 3, wide + 2), dtype=np.bool_)
    other[cast.layer + 1, column + 1] = ~on
    if not np.ptp(np.bincount(column, minlength=wide)):  # a full turn, or a grid whose ends do not matter
        other[:, 0], other[:, -1] = other[:, -2], other[:, 1]
    beside = np.zeros(len(on), dtype=np.bool_)
    for up, left in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        beside |= other[cast.layer + 1 + up, column + 1 + left]
    return beside


def _shift_of_model(
    found: Fit, ideal: IdealScan, on: BoolArray, cast: _Cast, sensor: Sensor, model: Model
) -> FloatArray:
    """By how much the target seems farther in the model's own echoes of it [m], shape (n,); 0 for other beams."""
    target = ideal.take(on)
    shown = [simulate(target, model, seed=seed) for seed in range(_SEEDS)]
    rays = _echoes(shown, sensor, Region())
    seems = fitted(found.surface, rays).surface.met(cast.origin_m[on], cast.direction[on]).distance_m
    shift = np.zeros(len(on))
    shift[on] = np.nan_to_num(seems - ideal.distance_m[on])
    return shift
