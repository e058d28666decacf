"""Rays of a scan's rows: where they come from, how they turn, and what they meet then.

Effects that aim beams elsewhere compose: each takes the rows' rays as they are, changes them, and asks anew what they
meet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.effects.geometry.own_rays import AimedRays, moving_of, rank_in_beam, rays_of, second_rows
from lidarcheck.effects.geometry.surfaces import LocalSurfaces, surfaces_of
from lidarcheck.effects.shared.reflectance import reflectance_of, with_reflectance
from lidarcheck.rays import Rays, Velocity
from lidarcheck.scan import IdealScan

__all__ = [
    "AimedRays",
    "directions_of",
    "moving_of",
    "rank_in_beam",
    "rays_of",
    "recast",
    "redirected",
    "second_rows",
    "slid",
    "turned",
    "with_met_reflectance",
]

_FAR_M = 1e4


def recast(
    ideal: IdealScan, rays: Rays, around: Surroundings, moving: Mapping[int, Velocity] | None = None
) -> IdealScan:
    """The ideal scan with what these rays meet, shape (n,); beams, shares, times and unknown columns stay.

    `moving`: objects that move from now on, besides those that moved already. A hit beyond the sensor's range is none.
    What a scene's panes and mirrors show behind themselves is not cast anew, but taken from the rows beside it.
    """
    objects = {**moving_of(rays, around.caster), **(moving or {})}
    max_range_m = around.sensor.max_range_m
    hits = around.caster.cast(rays, moving=objects or None, max_range_m=max_range_m)
    met = (hits.distance_m > 0.0) & (hits.distance_m <= max_range_m)
    aimed = AimedRays(rays.origin_m, rays.direction, rays.time_s, rays.slot, objects)
    has_objects = ideal.object_id is not None or around.scene is not None
    new = replace(
        ideal,
        distance_m=np.where(met, hits.distance_m, 0.0),
        material_id=np.where(met, hits.material_id, ideal.material_id),
        incidence_deg=np.where(met, np.clip(hits.incidence_deg, 0.0, 90.0), 0.0),
        object_id=hits.object_id if has_objects else None,
        rays=aimed,
    )
    new = with_met_reflectance(new, ideal, rays, around)
    return new if around.scene is None else _with_second_rows(new, ideal, max_range_m)


def with_met_reflectance(new: IdealScan, before: IdealScan, rays: Rays, around: Surroundings) -> IdealScan:
    """`new` with the reflectance of what its rays meet now; where a scene is met, of rows that stay on their material.

    `before`: the rows that it was made of, in the same places.
    """
    own, caster = reflectance_of(before), around.caster
    if own is None:
        return new
    met = reflectance_of(caster.ideal) if isinstance(caster, LocalSurfaces) else None
    if isinstance(caster, LocalSurfaces) and met is not None and len(caster.grid.order):
        reach = np.where(new.distance_m > 0.0, new.distance_m, _FAR_M)[:, None]
        return with_reflectance(new, met[caster.pick(rays.origin_m + reach * rays.direction, rays.slot)])
    return with_reflectance(new, np.where(new.material_id == before.material_id, own, np.nan))


def slid(ideal: IdealScan, rays: Rays, around: Surroundings) -> IdealScan:
    """The ideal scan with what these rays, shape (n,), meet if each stays on the plane of its own row.

    A ray that would meet it beyond the sensor's range meets nothing.
    """
    surfaces = surfaces_of(ideal, around)
    row = np.arange(len(ideal))
    distance = surfaces.along(row, rays.origin_m, rays.direction)
    met = (distance > 0.0) & (distance <= around.sensor.max_range_m)
    return replace(
        ideal,
        distance_m=np.where(met, distance, 0.0),
        incidence_deg=np.where(met, surfaces.incidence_deg(row, rays.direction), 0.0),
        rays=AimedRays(rays.origin_m, rays.direction, rays.time_s, rays.slot, moving_of(rays, around.caster)),
    )


def _with_second_rows(new: IdealScan, old: IdealScan, max_range_m: float) -> IdealScan:
    """`new` with the rows that lie behind panes and mirrors moved over the old ones as their rays have moved."""
    before, after = rays_of(old), rays_of(new)
    second = second_rows(old, before)
    if not second.any():
        return new
    # The first rows stand for beams that show nothing besides: their neighbours must not reach into those.
    shown = second | ~np.isin(_beams(old), _beams(old.take(second)))
    table = replace(old, distance_m=np.where(second, old.distance_m, 0.0), rays=None).take(shown)
    surfaces = LocalSurfaces.of(table)
    rows = np.flatnonzero(second)
    axes = surfaces.rays.take(second[shown])
    direction = axes.direction + after.direction[rows] - before.direction[rows]
    direction /= np.sqrt(np.square(direction).sum(axis=1, keepdims=True))
    origin = after.origin_m[rows] - before.origin_m[rows]
    hits = surfaces.cast(Rays(origin, direction, axes.time_s, axes.slot), max_range_m=max_range_m)
    columns = {name: np.array(getattr(new, name)) for name in ("distance_m", "material_id", "incidence_deg")}
    if old.object_id is not None and new.object_id is not None:
        columns["object_id"] = np.array(new.object_id)
    for name, column in columns.items():
        column[rows] = getattr(hits, name)
    return replace(new, **columns)  # type: ignore[arg-type]


def _beams(ideal: IdealScan) -> npt.NDArray[np.int64]:
    return ideal.layer.astype(np.int64) << 32 | ideal.point


def redirected(rays: Rays, direction: FloatArray) -> Rays:
    """The same rays along other unit vectors, shape (n, 3)."""
    return replace(rays, direction=direction)


def directions_of(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    """Unit vectors of angles [rad], shape (n, 3)."""
    cosine = elementary.cos(elevation)
    return np.stack(
        [elementary.cos(azimuth) * cosine, elementary.sin(azimuth) * cosine, elementary.sin(elevation)], axis=-1
    )


def turned(
    direction: FloatArray,
    yaw_deg: float | FloatArray,
    pitch_deg: float | FloatArray,
    roll_deg: float | FloatArray = 0.0,
    *,
    as_a_body: bool = True,
) -> FloatArray:
    """Directions (n, 3) turned by angles that are numbers or of shape (n,).

    Yaw positive to the left (about Z), pitch positive upward (about -Y), roll positive where the left side rises (about
    X). As a body: one rotation about the vector (roll, -pitch, yaw), so that the negative angles turn back exactly.
    Otherwise yaw adds to each direction's azimuth and pitch to its elevation, whatever the azimuth; roll has no part.
    """
    if not as_a_body:
        x, y, z = direction.T
        azimuth = elementary.arctan2(y, x) + np.deg2rad(yaw_deg)
        return directions_of(azimuth, elementary.arctan2(z, elementary.hypot(x, y)) + np.deg2rad(pitch_deg))
    vector = np.broadcast_arrays(np.deg2rad(roll_deg), -np.deg2rad(pitch_deg), np.deg2rad(yaw_deg), direction[:, 0])[:3]
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    # Rodrigues' formula; np.sinc(x) is sin(pi x) / (pi x), which is 1 at 0.
    across = _cross(vector, direction.T)
    twice = _cross(vector, across)
    sine, versine = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    columns = [u + sine * a + versine * b for u, a, b in zip(direction.T, across, twice, strict=True)]
    return np.stack(columns, axis=-1)


def _cross(one: Any, other: Any) -> list[FloatArray]:
    """The vector product, coordinate by coordinate."""
    return [one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2] for i in range(3)]
