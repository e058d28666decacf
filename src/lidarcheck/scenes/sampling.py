"""An ideal scan of a scene: which rays are cast, and what mirrors and panes show behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.rays import Caster, Hits, Rays, Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.scenes.firing import Span, fired, places
from lidarcheck.scenes.optics import Optics
from lidarcheck.sensor import Sensor

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
    """Which of a sensor's beams are cast and how.

    None: all layers or points, as many rays a beam as the sensor's footprint needs, as far as the sensor reaches.
    `motion` is the sensor's own velocity and yaw rate [deg/s], None for no sweep. `frame`: where columns do not repeat,
    which frame of a run, from 0: each begins elsewhere; None: the beams are those of a frame already.
    """

    sensor: Sensor
    layers: Span = None
    points: Span = None
    sub_beams: int | None = None
    second_hits: bool = True
    motion: tuple[Velocity, float] | None = None
    max_range_m: float | None = None
    frame: int | None = 0

    def __post_init__(self) -> None:
        if self.sub_beams is not None and not 1 <= self.sub_beams <= MAX_SUB_BEAMS:
            what = f"sub_beams = {self.sub_beams} is out of range"
            raise UsageError(what, fix=f"use a whole number from 1 to {MAX_SUB_BEAMS}")
        if not 0.0 < self.reach_m <= 1000.0:
            raise UsageError(f"max_range_m = {self.max_range_m} is out of range", fix="use a number above 0 to 1000 m")
        if self.motion is not None and not np.all(np.isfinite([*self.motion[0], self.motion[1]])):
            raise UsageError("the sensor's velocity or yaw rate is not finite", fix="use finite numbers")
        if self.frame is not None and self.frame < 0:
            raise UsageError(f"frame = {self.frame} is below 0", fix="count frames from 0")

    @property
    def reach_m(self) -> float:
        """What lies farther is not met."""
        return self.sensor.max_range_m if self.max_range_m is None else self.max_range_m


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
    sent = fired(how.sensor, how.layers, how.points, how.sub_beams, how.motion, how.frame)
    rays, n = sent.rays, sent.rays_each
    moving = scene.velocities_m_s if how.motion is not None else None
    hits = scene.cast(rays, moving=moving, max_range_m=how.reach_m)
    rows = _Rows(
        np.arange(len(rays)), hits.distance_m, hits.material_id, hits.object_id, hits.incidence_deg,
        np.full(len(rays), 1.0 / n),
    )  # fmt: skip
    further = _behind_optics(scene, rays, hits, 1.0 / n, how) if how.second_hits and scene.optics else []
    if further:
        rows = _Rows._make(np.concatenate(columns) for columns in zip(rows, *further, strict=True))
    beam = rows.ray // n if n > 1 else rows.ray
    own_rays = n > 1 or how.motion is not None
    slot = _rank(beam) if own_rays else np.zeros(0, dtype=np.int32)
    if further or n > 1:
        order = _order(beam, rows.distance_m)
        rows, beam = _Rows._make(column[order] for column in rows), beam[order]
        slot = slot[order] if own_rays else slot
    layer, point = sent.layer[beam], sent.point[beam]
    return IdealScan(
        layer,
        point,
        rows.distance_m,
        rows.material_id,
        rows.incidence_deg,
        object_id=rows.object_id,
        time_s=None if how.motion is None else rays.time_s[rows.ray],
        share=rows.share if further else None,
        rays=replace(rays.take(rows.ray), slot=slot) if own_rays else None,
        extra=places(sent.beams, layer, point, rows.distance_m, sent.axes.take(rows.ray) if n > 1 else None),
        beams=sent.beams,
    )


def _rank(beam: IndexArray) -> npt.NDArray[np.int32]:
    """Rank of each row among those of its beam: its sub-beams' own rows first, what mirrors and panes add behind."""
    order = np.argsort(beam, kind="stable")
    rank = np.empty(len(beam), dtype=np.int32)
    count = np.bincount(beam)
    rank[order] = np.arange(len(beam)) - np.repeat(np.cumsum(count) - count, count)
    return rank


def _order(beam: IndexArray, distance_m: FloatArray) -> IndexArray:
    """The order of the rows by beam, those of a beam by distance, equal ones as they stand.

    Single rows of beams come in order of beam; only the others are sorted.
    """
    count = np.bincount(beam)
    alone = count[beam] == 1
    others = np.flatnonzero(~alone)
    order = np.empty(len(beam), dtype=np.int64)
    place = np.repeat(count, count) == 1
    order[place] = np.flatnonzero(alone)
    order[~place] = others[np.lexsort((distance_m[others], beam[others]))]
    return order


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
    passing = np.flatnonzero(np.isin(hits.material_id, list(scene.optics)))
    first = Hits(*(getattr(hits, name)[passing] for name in Hits.__dataclass_fields__))
    n = len(passing)
    ways = [_Ways(passing, rays.take(passing), first, np.zeros(n), np.full(n, share))]
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
    hits = scene.cast(rays, moving=moving, max_range_m=how.reach_m)
    # The way begins on the surface, not a millimetre off: the plane that is met tells by how much that is nearer.
    facing = np.einsum("ij,ij->i", direction, hits.normal)
    sideways = np.einsum("ij,ij->i", off, hits.normal)
    met = (hits.distance_m > 0.0) & (facing < 0.0)
    distance = hits.distance_m + np.divide(sideways, facing, out=np.zeros(len(met)), where=met)
    before = way.before_m + way.hits.distance_m
    met &= (distance > 0.0) & (before + distance <= how.reach_m)
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
