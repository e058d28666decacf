"""The surfaces that an ideal scan shows, as something that rays can be cast against."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import BeamGrid
from lidarcheck.effects.geometry.beam_tree import BeamTree
from lidarcheck.effects.geometry.lattice import lattice_of
from lidarcheck.effects.geometry.moving_surfaces import Mover, hidden_behind, mover_of
from lidarcheck.effects.geometry.own_rays import rays_of
from lidarcheck.effects.geometry.planes import planes_of
from lidarcheck.effects.geometry.planes_around import planes_around
from lidarcheck.rays import Caster, Hits, Rays, Velocity
from lidarcheck.scan import IdealScan

__all__ = ["LocalSurfaces", "normals_of", "surfaces_of"]

Slots = npt.NDArray[np.int32]
Pick = Callable[[FloatArray, Slots], IndexArray]

_BLOCK = 1 << 15
"""Rays at a time: what is at hand then stays in the processor's cache."""
_STEPS = 5
_FAR_M = 1e4
_STRETCH = 2.0
"""A surface is continued to at most this multiple of the distance at which its beam met it, and to at least 1 / it."""


@dataclass(frozen=True)
class LocalSurfaces:
    """What an ideal scan alone tells of its surroundings: a small plane for each row; a `lidarcheck.rays.Caster`.

    A ray meets the plane of a beam beside which, seen from the sensor, its hit lies: exact where surfaces are flat.
    Where between two beams an edge is, nobody knows: each pair of beams has its own place for it, see
    `BeamGrid.cells`. Meant for rays that begin within a metre or two of the sensor. Between and beyond the beams that
    were fired a near one's plane goes on. A plane seen at a grazing angle is met at most 2 times as far, and at least
    half as far, as its beam met it. A ray whose beam met nothing meets nothing. The ideal scan's own rays get its own
    numbers back, to the last bit.

    `m`, (n, 3), and `offset`, (n,): the rows' planes m . x = offset; `known`: whether neighbours told the slope;
    `own_deg`: the incidence by the plane, from which changes count. `on_axis`: whether the scan's rays are the beams'
    axes; others keep the cells around them, half a beam to either side, whose edges then lie halfway.
    """

    ideal: IdealScan
    rays: Rays
    grid: BeamGrid | BeamTree
    point_m: FloatArray
    m: FloatArray
    offset: FloatArray
    own_deg: FloatArray
    known: npt.NDArray[np.bool_]
    on_axis: bool = True

    @classmethod
    def of(cls, ideal: IdealScan) -> LocalSurfaces:
        """The surfaces of a scan."""
        rays = rays_of(ideal)
        grid = lattice_of(ideal, rays)
        point_m = rays.origin_m + ideal.distance_m[:, None] * rays.direction
        if isinstance(grid, BeamTree):
            planes = planes_around(ideal, point_m, rays.direction, grid)
            offset = (ideal.distance_m > 0.0).astype(np.float64)
        else:
            planes = planes_of(ideal, rays.direction, grid)
            offset = 1.0 + np.einsum("ij,ij->i", planes.m, rays.origin_m)
        along = np.einsum("ij,ij->i", planes.m, rays.direction)
        return cls(
            ideal=ideal,
            rays=rays,
            grid=grid,
            point_m=point_m,
            m=planes.m,
            offset=offset,
            own_deg=_angle_deg(along, planes.m),
            known=planes.known,
            on_axis=isinstance(grid, BeamTree) or ideal.rays is None or _are_axes(ideal, rays),
        )

    @property
    def velocities_m_s(self) -> Mapping[int, Velocity]:
        """None: an ideal scan does not tell them."""
        return {}

    def cast(self, rays: Rays, *, moving: Mapping[int, Velocity] | None = None, max_range_m: float = 300.0) -> Hits:
        """What each ray meets; see the class. An object that moves is met where its own beams saw it, moved on.

        What it uncovers is the nearest surface beside it in the layer, never nearer than the object was.
        """
        n = len(rays)
        row, distance = np.full(n, -1, dtype=np.int64), np.zeros(n)
        if len(self.grid.order):
            movers = self._movers(moving or {}, rays)
            behind = hidden_behind(self.ideal, self.grid, {m.object_id for m in movers})
            for start in range(0, n, _BLOCK):
                part = slice(start, start + _BLOCK)
                row[part], distance[part] = self._at_rest(rays, part, behind)
                for mover in movers:
                    self._moved(rays, part, mover, row, distance)
        distance[distance > max_range_m] = 0.0
        return self._hits(rays, row, distance)

    def along(self, row: IndexArray, origin: FloatArray, direction: FloatArray) -> FloatArray:
        """Where rays meet those rows' planes, shape (n,); 0: not at all."""
        from lidarcheck.effects.geometry import compiled

        found, own = np.empty(len(row)), (self.rays.origin_m, self.rays.direction)
        origin, direction = np.ascontiguousarray(origin), np.ascontiguousarray(direction)
        planes, met = (self.m, self.offset), self.ideal.distance_m
        compiled.along(row, origin, direction, planes, self.point_m, own, met, _STRETCH, found)
        return found

    def incidence_deg(self, row: IndexArray, direction: FloatArray) -> FloatArray:
        """The stated incidence, changed by as much as a ray's angle to the plane differs from the beam's own; (n,)."""
        from lidarcheck.effects.geometry import compiled

        found, own = np.empty(len(row)), (self.own_deg, self.rays.direction)
        compiled.incidence_deg(row, np.ascontiguousarray(direction), self.m, *own, self.ideal.incidence_deg, found)
        return found

    def follow(
        self, origin: FloatArray, direction: FloatArray, slot: Slots, pick: Pick, start_m: float = _FAR_M
    ) -> tuple[IndexArray, FloatArray]:
        """The row that each ray ends at, and where, by fixed-point iteration from `start_m` along the rays.

        `pick` tells the row in whose direction a position lies.
        """
        if not origin.any():
            row = pick(direction, slot)
            return row, self.along(row, origin, direction)
        row = pick(origin + start_m * direction, slot)
        distance = self.along(row, origin, direction)
        open_ = np.arange(len(row))
        for _ in range(_STEPS - 1):
            reach = np.where(distance[open_] > 0.0, distance[open_], _FAR_M)
            again = pick(origin[open_] + reach[:, None] * direction[open_], slot[open_])
            differs = again != row[open_]
            open_ = open_[differs]
            if len(open_) == 0:
                break
            row[open_] = again[differs]
            distance[open_] = self.along(row[open_], origin[open_], direction[open_])
        return row, distance

    def pick(self, position: FloatArray, slot: Slots) -> IndexArray:
        """The row of that rank in whose direction a position lies."""
        cell = self.grid.cells(position) if self.on_axis else self.grid.nearest_cell(position)
        return self.grid.rows(cell, slot)

    def _at_rest(self, rays: Rays, part: slice, behind: IndexArray | None) -> tuple[IndexArray, FloatArray]:
        """Row and distance of a block of rays among all that does not move."""
        origin, direction, slot = rays.origin_m[part], rays.direction[part], rays.slot[part]
        if behind is None:
            row, distance = self.follow(origin, direction, slot, self.pick)
            return self._own(rays, part, row, distance)

        def pick(position: FloatArray, slot: Slots) -> IndexArray:
            row = self.pick(position, slot)
            return np.where(row >= 0, behind[row], -1)

        row, distance = self.follow(origin, direction, slot, pick)
        reach = np.where(distance > 0.0, distance, _FAR_M)
        hiding = self.pick(origin + reach[:, None] * direction, slot)
        least = np.where(hiding != row, self.ideal.distance_m[hiding], 0.0)
        return row, np.where(distance > 0.0, np.maximum(distance, least), 0.0)

    def _own(self, rays: Rays, part: slice, row: IndexArray, distance: FloatArray) -> tuple[IndexArray, FloatArray]:
        """The same with what the scan's own rays met for themselves, where beams do not begin in the sensor's middle.

        From there, what hides a beam's surface may lie beside it.
        """
        if isinstance(self.grid, BeamGrid) or self.ideal.beams.central:
            return row, distance
        cell = self.grid.own_cell(rays.direction[part], rays.origin_m[part])
        mine = cell >= 0
        own = self.grid.rows(np.maximum(cell, 0), rays.slot[part])
        return np.where(mine, own, row), np.where(mine, self.ideal.distance_m[own], distance)

    def _movers(self, moving: Mapping[int, Velocity], rays: Rays) -> list[Mover]:
        """The scan's objects among those that move, with all that picking them takes."""
        if self.ideal.object_id is None or len(rays) == 0:
            return []
        time_s = float(np.abs(rays.time_s).max())
        start_m = float(np.sqrt(np.square(rays.origin_m).sum(axis=1).max()))
        found = []
        for number, velocity in moving.items():
            mine = np.flatnonzero((self.ideal.object_id == number) & (self.ideal.distance_m > 0.0))
            if len(mine):
                shift_m = time_s * float(np.linalg.norm(velocity)) + start_m
                found.append(mover_of(number, velocity, self.ideal, self.grid, mine, self.point_m, shift_m))
        return found

    def _moved(self, rays: Rays, part: slice, mover: Mover, row: IndexArray, distance: FloatArray) -> None:
        """Replace what a block of rays meets by the moved object, where that is nearer."""
        origin = rays.origin_m[part] - rays.time_s[part, None] * np.asarray(mover.velocity_m_s)
        near = np.flatnonzero(mover.may_meet(origin, rays.direction[part]))
        if len(near) == 0:
            return
        origin, at = origin[near], near + part.start
        direction, slot = rays.direction[at], rays.slot[at]
        start_m = mover.range_m[1]
        mine, met = self.follow(origin, direction, slot, mover.pick, start_m)
        seen = self.pick(origin + met[:, None] * direction, slot)
        numbers = self.ideal.object_id
        assert numbers is not None
        valid = (mine >= 0) & (met > 0.0) & (seen >= 0)
        valid &= (numbers[seen] == mover.object_id) & (self.ideal.distance_m[seen] > 0.0)
        valid &= (distance[at] == 0.0) | (met <= distance[at])
        at = at[valid]
        row[at], distance[at] = mine[valid], met[valid]

    def _hits(self, rays: Rays, row: IndexArray, distance: FloatArray) -> Hits:
        met = distance > 0.0
        n = len(row)
        number = self.ideal.object_id
        return Hits(
            distance_m=distance,
            material_id=np.where(row >= 0, self.ideal.material_id[row], 0).astype(np.int32),
            object_id=np.zeros(n, dtype=np.int32) if number is None else np.where(row >= 0, number[row], 0),
            incidence_deg=np.where(met, self.incidence_deg(row, rays.direction), 0.0),
            normal=np.where(met[:, None], self._normal[row], 0.0),
        )

    @functools.cached_property
    def _normal(self) -> FloatArray:
        """The rows' unit normals, towards the sensor; 0 where neighbours do not tell the slope; (n, 3)."""
        return _unit_normals(self.m, self.known)


class Asked(Protocol):
    """Whoever knows what rays meet."""

    @property
    def caster(self) -> Caster:
        """Who is asked."""


def surfaces_of(ideal: IdealScan, around: Asked) -> LocalSurfaces:
    """The surfaces that an ideal scan shows by itself, found already where they are what effects are asked about."""
    known = around.caster
    return known if isinstance(known, LocalSurfaces) and known.ideal is ideal else LocalSurfaces.of(ideal)


def normals_of(ideal: IdealScan, around: Asked) -> FloatArray:
    """The unit normals, towards the sensor, of the rows of an ideal scan; 0 where a row meets nothing; (n, 3)."""
    return _unit_normals(surfaces_of(ideal, around).m)


def _unit_normals(m: FloatArray, known: npt.NDArray[np.bool_] | bool = True) -> FloatArray:
    """The unit vectors against m, (n, 3); 0 where m is 0 or not known."""
    length = np.sqrt(np.square(m).sum(axis=1))
    inverse = np.divide(-1.0, length, out=np.zeros(len(length)), where=known & (length > 0.0))
    return np.asarray(m * inverse[:, None])


def _are_axes(ideal: IdealScan, rays: Rays) -> bool:
    """Whether rays are those of the beams themselves, as seen from the sensor."""
    axes = ideal.beams.directions(ideal.layer, ideal.point)
    return not rays.origin_m.any() and bool(np.abs(rays.direction - axes).max(initial=0.0) < 1e-9)


def _angle_deg(along: FloatArray, m: FloatArray) -> FloatArray:
    """The angle between rays and planes' normals, of m . u and m, 0 ... 90; 0 for no plane."""
    length = np.sqrt(np.square(m).sum(axis=1))
    cosine = np.divide(np.abs(along), length, out=np.ones(len(length)), where=length > 0.0)
    return np.asarray(np.rad2deg(elementary.arccos(np.minimum(cosine, 1.0))))
