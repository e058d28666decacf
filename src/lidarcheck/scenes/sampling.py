"""An ideal scan of a scene: which rays are cast, and what mirrors and panes show behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.rays import Caster, Hits, Rays, Velocity, sweep_time_s
from lidarcheck.scan import IdealScan
from lidarcheck.scenes.optics import Optics
from lidarcheck.sensor import LAYERS, POINTS, beam_directions

__all__ = ["MAX_SUB_BEAMS", "OpticalCaster", "Sampling", "sampled"]

MAX_SUB_BEAMS = 8
"""Per axis: a full frame then has 32 million rows."""

_SURFACES = 4
"""Mirrors and panes that a light's way may meet one after another, as the two windows of a car and one behind."""

_FAINTEST = 1e-5
"""Ways that leave less than this share of the light are given up."""

_OFF_M = 1e-3
"""So far from the surface a reflected or transmitted ray begins: embree's single precision is 3e-5 m at 300 m."""


class OpticalCaster(Caster, Protocol):
    """A caster that knows which materials mirror or let light through, as a scene does."""

    @property
    def optics(self) -> Mapping[int, Optics]:
        """The optics of those materials, by number."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """Which beams are cast and how; `motion` is the sensor's own velocity and yaw rate [deg/s], None for no sweep."""

    layers: tuple[int, int] = (0, LAYERS - 1)
    points: tuple[int, int] = (0, POINTS - 1)
    sub_beams: int = 1
    second_hits: bool = True
    motion: tuple[Velocity, float] | None = None
    max_range_m: float = 300.0

    def __post_init__(self) -> None:
        for name, (first, last), count in (("layers", self.layers, LAYERS), ("points", self.points, POINTS)):
            if not 0 <= first <= last < count:
                what = f"{name} = [{first}, {last}] is out of range"
                raise UsageError(what, fix=f"use [first, last], both included, from 0 to {count - 1}")
        if not 1 <= self.sub_beams <= MAX_SUB_BEAMS:
            what = f"sub_beams = {self.sub_beams} is out of range"
            raise UsageError(what, fix=f"use a whole number from 1 to {MAX_SUB_BEAMS}")
        if not 0.0 < self.max_range_m <= 1000.0:
            raise UsageError(f"max_range_m = {self.max_range_m} is out of range", fix="use a number above 0 to 1000 m")
        if self.motion is not None and not np.all(np.isfinite([*self.motion[0], self.motion[1]])):
            raise UsageError("the sensor's velocity or yaw rate is not finite", fix="use finite numbers")


class _Rows(NamedTuple):
    """Rows of the ideal scan in the making: the ray each belongs to, and what is seen there."""

    ray: IndexArray
    distance_m: FloatArray
    material_id: npt.NDArray[np.int32]
    object_id: npt.NDArray[np.int32]
    incidence_deg: FloatArray
    share: FloatArray


def sampled(scene: OpticalCaster, how: Sampling) -> IdealScan:
    """The ideal scan of those beams; see `Scene.ideal`."""
    layer, point, rays = _fired(how)
    moving = scene.velocities_m_s if how.motion is not None else None
    hits = scene.cast(rays, moving=moving, max_range_m=how.max_range_m)
    each = 1.0 / how.sub_beams**2
    rows = _Rows(
        np.arange(len(rays)), hits.distance_m, hits.material_id, hits.object_id, hits.incidence_deg,
        np.full(len(rays), each),
    )  # fmt: skip
    further = _behind_optics(scene, rays, hits, each, how) if how.second_hits and scene.optics else []
    if further:
        rows = _Rows._make(np.concatenate(columns) for columns in zip(rows, *further, strict=True))
    beam = rows.ray // how.sub_beams**2
    slot = _rank(beam)
    if further or how.sub_beams > 1:
        order = np.lexsort((rows.distance_m, beam))
        rows, beam, slot = _Rows._make(column[order] for column in rows), beam[order], slot[order]
    own_rays = how.sub_beams > 1 or how.motion is not None
    return IdealScan(
        layer[beam],
        point[beam],
        rows.distance_m,
        rows.material_id,
        rows.incidence_deg,
        object_id=rows.object_id,
        time_s=None if how.motion is None else rays.time_s[rows.ray],
        share=rows.share if further else None,
        rays=replace(rays.take(rows.ray), slot=slot) if own_rays else None,
    )


def _rank(beam: IndexArray) -> npt.NDArray[np.int32]:
    """Rank of each row among those of its beam: its sub-beams' own rows first, what mirrors and panes add behind."""
    order = np.argsort(beam, kind="stable")
    rank = np.empty(len(beam), dtype=np.int32)
    rank[order] = np.arange(len(beam)) - np.searchsorted(beam[order], beam[order])
    return rank


def _fired(how: Sampling) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Rays]:
    """(layer, point) of every beam, layer by layer, and its rays, those of one beam together."""
    a = np.arange(how.layers[0], how.layers[1] + 1, dtype=np.int32)
    b = np.arange(how.points[0], how.points[1] + 1, dtype=np.int32)
    layer, point = np.repeat(a, len(b)), np.tile(b, len(a))
    n = how.sub_beams
    if n == 1:
        direction, slot = beam_directions(layer, point), np.zeros(len(layer), dtype=np.int32)
        column = point
    else:
        # The middles of n by n equal parts of the cell.
        offset = (np.arange(n) + 0.5) / n - 0.5
        up, left = np.repeat(offset, n), np.tile(offset, n)
        direction = beam_directions(np.add.outer(layer, up).ravel(), np.add.outer(point, left).ravel())
        slot = np.tile(np.arange(n * n, dtype=np.int32), len(layer))
        column = np.repeat(point, n * n)
    origin, time_s = np.zeros((len(slot), 3)), np.zeros(len(slot))
    if how.motion is not None:
        time_s = sweep_time_s(column)
        origin = time_s[:, None] * np.asarray(how.motion[0], dtype=np.float64)
        direction = _turned(direction, np.deg2rad(how.motion[1]) * time_s)
    return layer, point, Rays(origin, direction, time_s, slot)


def _turned(direction: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Directions turned to the left about Z."""
    cosine, sine = elementary.cos(angle_rad), elementary.sin(angle_rad)
    x, y, z = direction[:, 0], direction[:, 1], direction[:, 2]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=1)


class _Ways(NamedTuple):
    """Ways of light that have met a surface: the ray at its last leg, what it met, its length before, its share."""

    ray: IndexArray
    rays: Rays
    hits: Hits
    before_m: FloatArray
    share: FloatArray

    def take(self, rows: npt.NDArray[np.bool_]) -> _Ways:
        hits = Hits(*(getattr(self.hits, name)[rows] for name in Hits.__dataclass_fields__))
        return _Ways(self.ray[rows], self.rays.take(rows), hits, self.before_m[rows], self.share[rows])


def _behind_optics(scene: OpticalCaster, rays: Rays, hits: Hits, share: float, how: Sampling) -> list[_Rows]:
    """The rows that mirrors and panes add.

    The light passes them on its way there and back again, so that it keeps the square of one passage's share; the range
    equation holds for the length of the unfolded way, since a flat mirror's image is as large as the thing.
    """
    ways = [_Ways(np.arange(len(rays)), rays, hits, np.zeros(len(rays)), np.full(len(rays), share))]
    found: list[_Rows] = []
    for _ in range(_SURFACES):
        ways = [further for way in ways for further in _next_legs(scene, way, how)]
        if not ways:
            break
        found += [_rows_of(way) for way in ways]
    return found


def _next_legs(scene: OpticalCaster, way: _Ways, how: Sampling) -> list[_Ways]:
    """What the ways show that go on from a mirror or pane; those that meet nothing are left out."""
    mirror, transmission = (_of_material(scene, way.hits.material_id, name) for name in ("mirror", "transmission"))
    met = way.hits.distance_m > 0.0
    legs = []
    for passage, reflected in ((mirror, True), (transmission, False)):
        share = way.share * passage**2
        lit = met & (passage > 0.0) & (share >= _FAINTEST)
        if lit.any():
            leg = _leg(scene, way.take(lit)._replace(share=share[lit]), how, reflected=reflected)
            if len(leg.ray):
                legs.append(leg)
    return legs


def _leg(scene: OpticalCaster, way: _Ways, how: Sampling, *, reflected: bool) -> _Ways:
    normal, direction = way.hits.normal, way.rays.direction
    point = way.rays.origin_m + way.hits.distance_m[:, None] * direction
    off = normal * (_OFF_M if reflected else -_OFF_M)
    if reflected:
        direction = direction - 2.0 * np.einsum("ij,ij->i", direction, normal)[:, None] * normal
    rays = Rays(point + off, direction, way.rays.time_s, way.rays.slot)
    moving = scene.velocities_m_s if how.motion is not None else None
    hits = scene.cast(rays, moving=moving, max_range_m=how.max_range_m)
    # The way begins on the surface, not a millimetre off: the plane that is met tells by how much that is nearer.
    facing = np.einsum("ij,ij->i", direction, hits.normal)
    sideways = np.einsum("ij,ij->i", off, hits.normal)
    met = (hits.distance_m > 0.0) & (facing < 0.0)
    distance = hits.distance_m + np.divide(sideways, facing, out=np.zeros(len(met)), where=met)
    before = way.before_m + way.hits.distance_m
    met &= (distance > 0.0) & (before + distance <= how.max_range_m)
    true_hits = Hits(distance, hits.material_id, hits.object_id, hits.incidence_deg, hits.normal)
    begun = Rays(point, direction, rays.time_s, rays.slot)
    return _Ways(way.ray, begun, true_hits, before, way.share).take(met)


def _of_material(scene: OpticalCaster, material_id: npt.NDArray[np.int32], name: str) -> FloatArray:
    value = np.zeros(len(material_id))
    for number, optics in scene.optics.items():
        value[material_id == number] = getattr(optics, name)
    return value


def _rows_of(way: _Ways) -> _Rows:
    hits = way.hits
    return _Rows(
        way.ray, way.before_m + hits.distance_m, hits.material_id, hits.object_id, hits.incidence_deg, way.share
    )
