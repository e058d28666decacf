"""The demonstration's scene: flat panels on which every kind of effect has something to act on.

From right to left: panels of 10, 50 and 80 % at 5 to 80 m; a retro-reflector with nothing around it; panels turned
away from the sensor; a far wall with dark panels before it, whose edges cross the beams. Asphalt below, sky above.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.rays import Hits, Rays, Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, reference_beams

__all__ = ["ABOVE", "BESIDE", "MATERIALS", "RETRO", "Rectangles", "ideal_scan", "scene"]


HALF, ASPHALT, DARK, RETRO, BRIGHT = 1, 2, 3, 4, 5
MATERIALS: Mapping[int, Material] = {
    HALF: Material("panel 50 %", 0.5),
    ASPHALT: Material("asphalt", 0.2),
    DARK: Material("panel 10 %", 0.1),
    RETRO: Material("retro-reflector", 0.5, "retro", 1000.0),
    BRIGHT: Material("panel 80 %", 0.8),
}
_RETRO_RANGE_M = 25.0
ABOVE, BESIDE = 90, 40
"""Layers above and below the retro-reflector, points to either side of it, in which every beam is fired."""
_RETRO_AT = (8.0, 0.25)
_GROUND_M = -1.8
_MOVING = 100
"""Object ID of the near panels before the far wall, which drive towards the sensor."""
_NEAREST_M = 1e-6


@dataclass(frozen=True)
class Rectangles:
    """Rectangles: centre, half sides `u` and `v` (at right angles), material and object; shapes (m, 3) and (m,)."""

    centre: FloatArray
    u: FloatArray
    v: FloatArray
    material_id: npt.NDArray[np.int32]
    object_id: npt.NDArray[np.int32]

    @property
    def velocities_m_s(self) -> Mapping[int, Velocity]:
        """The near panels before the far wall come closer; all else rests."""
        return {_MOVING: (-10.0, 0.0, 0.0)}

    def cast(self, rays: Rays, *, moving: Mapping[int, Velocity] | None = None, max_range_m: float = 300.0) -> Hits:
        """The nearest panel that each ray meets; see `lidarcheck.rays.Caster`."""
        n = len(rays)
        best, panel = np.full(n, np.inf), np.full(n, -1)
        normals = np.cross(self.u, self.v)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        for i, normal in enumerate(normals):
            velocity = (moving or {}).get(int(self.object_id[i]))
            distance = self._distance(rays, i, normal, velocity)
            nearer = distance < best
            best[nearer], panel[nearer] = distance[nearer], i
        met = (panel >= 0) & (best <= max_range_m)
        normal = np.where(met[:, None], normals[panel], 0.0)
        cosine = np.einsum("ij,ij->i", normal, rays.direction)
        normal = np.where((cosine > 0.0)[:, None], -normal, normal)
        return Hits(
            distance_m=np.where(met, best, 0.0),
            material_id=np.where(met, self.material_id[panel], 0).astype(np.int32),
            object_id=np.where(met, self.object_id[panel], 0).astype(np.int32),
            incidence_deg=np.where(met, np.rad2deg(elementary.arccos(np.clip(np.abs(cosine), 0.0, 1.0))), 0.0),
            normal=normal,
        )

    def _distance(self, rays: Rays, i: int, normal: FloatArray, velocity: Velocity | None) -> FloatArray:
        """Along each ray to panel i, infinite where it does not meet it; shape (n,)."""
        start = rays.origin_m - self.centre[i]
        if velocity is not None:
            start = start - rays.time_s[:, None] * np.asarray(velocity)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            distance = -elementary.product(start, normal) / elementary.product(rays.direction, normal)
            at = start + distance[:, None] * rays.direction
            along = np.abs(elementary.product(at, self.u[i])) <= elementary.product(self.u[i], self.u[i])
            across = np.abs(elementary.product(at, self.v[i])) <= elementary.product(self.v[i], self.v[i])
        return np.where(along & across & (distance > _NEAREST_M), distance, np.inf)


@dataclass(frozen=True)
class _Panel:
    """A panel as the sensor sees it: its middle, its size, how it is turned about the vertical, and rolled."""

    azimuth_deg: float
    elevation_deg: float
    range_m: float
    wide_deg: float
    high_deg: float
    material_id: int
    turned_deg: float = 0.0
    rolled_deg: float = 0.0
    object_id: int = 0

    def sides(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Centre, u and v, shape (3,) each."""
        a, e = np.deg2rad([self.azimuth_deg, self.elevation_deg])
        forward = np.array(
            [elementary.cos(a) * elementary.cos(e), elementary.sin(a) * elementary.cos(e), elementary.sin(e)]
        )
        left = np.array([-elementary.sin(a), elementary.cos(a), 0.0])
        up = np.cross(forward, left)
        turn, roll = np.deg2rad([self.turned_deg, self.rolled_deg])
        side = elementary.cos(turn) * left + elementary.sin(turn) * forward
        half = self.range_m * elementary.tan(np.deg2rad([self.wide_deg / 2, self.high_deg / 2]))
        u = elementary.cos(roll) * side + elementary.sin(roll) * up
        v = elementary.cos(roll) * up - elementary.sin(roll) * side
        return forward * self.range_m, u * half[0] / elementary.cos(turn), v * half[1]


def _panels() -> list[_Panel]:
    swept = [
        _Panel(-57.0 + 6.0 * slot + 1.8 * rank, 0.3, range_m, 1.6, 4.6, material, object_id=1 + slot)
        for slot, range_m in enumerate((5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0))
        for rank, material in enumerate((DARK, HALF, BRIGHT))
    ]
    turned = [
        _Panel(17.0 + 4.0 * rank, 0.3, 40.0, 3.6, 4.6, BRIGHT, turned_deg=angle, object_id=20 + rank)
        for rank, angle in enumerate((0.0, 30.0, 50.0, 65.0, 75.0))
    ]
    wall = [
        _Panel(azimuth_deg, 0.3, 60.0, 11.5, 4.6, material, object_id=30)
        for azimuth_deg, material in ((41.75, HALF), (53.25, BRIGHT))
    ]
    before = [
        _Panel(39.0 + 3.5 * rank, 0.3, 30.0, 1.7, 4.2, DARK, rolled_deg=8.0, object_id=_MOVING) for rank in range(6)
    ]
    retro = _Panel(*_RETRO_AT, _RETRO_RANGE_M, 0.5, 0.4, RETRO, object_id=40)
    return [*swept, *turned, *wall, *before, retro]


@functools.cache
def scene() -> Rectangles:
    """The scene in the sensor frame."""
    panels = _panels()
    sides = [panel.sides() for panel in panels]
    ground = (np.array([17.5, 0.0, _GROUND_M]), np.array([17.5, 0.0, 0.0]), np.array([0.0, 100.0, 0.0]))
    centre, u, v = (np.array(part) for part in zip(*sides, ground, strict=True))
    materials = [panel.material_id for panel in panels] + [ASPHALT]
    objects = [panel.object_id for panel in panels] + [50]
    return Rectangles(centre, u, v, np.array(materials, dtype=np.int32), np.array(objects, dtype=np.int32))


def _beams() -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """The beams that look at it: a wide grid, finer where the panels stand, and a full cross on the retro-reflector."""
    beams = reference_beams()
    layer, point = int(beams.elevation.nearest(_RETRO_AT[1])), int(beams.azimuth.nearest(_RETRO_AT[0]))
    blocks = (
        (np.concatenate([np.arange(100, 220, 10), np.arange(220, 330, 4)]), np.arange(2, beams.points, 5)),
        (np.arange(layer - ABOVE, layer + ABOVE + 1), np.arange(point - 3, point + 4)),
        (np.arange(layer - 5, layer + 6), np.arange(point - BESIDE, point + BESIDE + 1)),
    )
    looking = np.concatenate([np.stack(np.meshgrid(*b, indexing="ij"), axis=-1).reshape(-1, 2) for b in blocks])
    looking = np.unique(looking, axis=0).astype(np.int32)
    return looking[:, 0], looking[:, 1]


@functools.cache
def ideal_scan() -> IdealScan:
    """What the demonstration's beams meet, in order of (layer, point)."""
    layer, point = _beams()
    n, beams = len(layer), reference_beams()
    directions, fired_s = beams.directions(layer, point), beams.fire_time_s(layer, point)
    rays = Rays(np.zeros((n, 3)), directions, fired_s, np.zeros(n, dtype=np.int32))
    hits = scene().cast(rays)
    return IdealScan(
        layer, point, hits.distance_m, hits.material_id, hits.incidence_deg, hits.object_id, file="the demonstration"
    )
