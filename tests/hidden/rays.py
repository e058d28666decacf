"""Beams, rectangles in space and what the beams meet (numba)."""

# Compiled functions take their types from the call.
# mypy: allow-untyped-defs, allow-untyped-calls

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from .sensor import POINTS, SWEEP_S

F = NDArray[np.float64]
N = NDArray[np.int64]
FARTHEST_M = 300.0
GRAZING_COS = 1e-6


def directions(azimuth_deg: F, elevation_deg: F) -> F:
    """Unit vectors (n, 3) of angles in the sensor's frame."""
    azimuth, elevation = np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg)
    level = np.cos(elevation)
    return np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)], axis=-1)


@dataclass(frozen=True)
class Beams:
    """The fired beams, (n,) each."""

    layer: N
    point: N

    @classmethod
    def block(cls, layers: range, points: range) -> "Beams":
        layer, point = np.meshgrid(np.array(layers), np.array(points), indexing="ij")
        return cls(layer.ravel().astype(np.int64), point.ravel().astype(np.int64))

    def __len__(self) -> int:
        return len(self.layer)

    @property
    def azimuth_deg(self) -> F:
        return np.asarray((self.point - (POINTS - 1) / 2) * 0.125, np.float64)

    @property
    def elevation_deg(self) -> F:
        return np.asarray((self.layer - 259.5) * 0.05, np.float64)

    @property
    def time_s(self) -> F:
        return np.asarray(SWEEP_S * self.point / (POINTS - 1), np.float64)


@dataclass(frozen=True)
class Rectangle:
    """A flat surface: centre, unit vectors along its sides, half lengths [m], material and object."""

    centre: tuple[float, float, float]
    along: tuple[float, float, float]
    across: tuple[float, float, float]
    half_m: tuple[float, float]
    material: int
    object_id: int


@dataclass(frozen=True)
class Scene:
    """Rectangles and, per object, its velocity [m/s]."""

    rectangles: tuple[Rectangle, ...]
    kind: str

    def raised(self, up_m: float) -> "Scene":
        """The scene seen from a sensor that stands lower by so much."""
        moved = [
            Rectangle(
                (r.centre[0], r.centre[1], r.centre[2] + up_m), r.along, r.across, r.half_m, r.material, r.object_id
            )
            for r in self.rectangles
        ]
        return Scene(tuple(moved), self.kind)

    def materials(self) -> set[int]:
        return {r.material for r in self.rectangles}


@dataclass(frozen=True)
class Hits:
    """What rays meet, (n,) each; range 0 where nothing, rectangle -1."""

    range_m: F
    incidence_deg: F
    material: N
    object_id: N
    rectangle: N


@nb.njit(cache=True, nogil=True)
def _cast(origin, direction, time_s, centre, along, across, normal, half, velocity):
    rays, rectangles = len(direction), len(centre)
    met = np.full(rays, -1, np.int64)
    range_m = np.zeros(rays)
    cosine = np.ones(rays)
    for i in range(rays):
        nearest = 300.0
        for q in range(rectangles):
            slope = 0.0
            height = 0.0
            for a in range(3):
                slope += direction[i, a] * normal[q, a]
                height += (centre[q, a] + velocity[q, a] * time_s[i] - origin[i, a]) * normal[q, a]
            if abs(slope) < 1e-9:
                continue
            reach = height / slope
            if reach < 0.05 or reach >= nearest:
                continue
            u = 0.0
            v = 0.0
            for a in range(3):
                p = origin[i, a] + reach * direction[i, a] - centre[q, a] - velocity[q, a] * time_s[i]
                u += p * along[q, a]
                v += p * across[q, a]
            if abs(u) <= half[q, 0] and abs(v) <= half[q, 1]:
                nearest = reach
                met[i] = q
                range_m[i] = reach
                cosine[i] = abs(slope)
    return met, range_m, cosine


def cast(scene: Scene, origin_m: F, direction: F, time_s: F, velocity: dict[int, F] | None = None) -> Hits:
    """What rays (n, 3) fired at their times meet first; objects move by their velocity times time."""
    parts = scene.rectangles
    along, across = np.array([r.along for r in parts]), np.array([r.across for r in parts])
    moving = np.zeros((len(parts), 3))
    for q, r in enumerate(parts):
        moving[q] = (velocity or {}).get(r.object_id, np.zeros(3))
    met, range_m, cosine = _cast(
        np.ascontiguousarray(origin_m), np.ascontiguousarray(direction), np.ascontiguousarray(time_s, dtype=np.float64),
        np.array([r.centre for r in parts]), along, across, np.cross(along, across),
        np.array([r.half_m for r in parts]), moving,
    )  # fmt: skip
    material = np.array([r.material for r in parts] + [0])[met]
    objects = np.array([r.object_id for r in parts] + [-1])[met]
    incidence = np.where(met >= 0, np.rad2deg(np.arccos(np.clip(cosine, GRAZING_COS, 1.0))), 0.0)
    return Hits(range_m, incidence, material, objects, met)


def normals(scene: Scene, rectangle: N) -> F:
    """Unit normals (n, 3) of rectangles by their row."""
    parts = scene.rectangles
    return np.cross(np.array([r.along for r in parts]), np.array([r.across for r in parts]))[rectangle]


def facing(
    range_m: float, azimuth_deg: float, elevation_deg: float, turn_deg: float
) -> tuple[tuple[float, float, float], ...]:
    """Centre, level side and upright side of a plate at a place, turned from facing the sensor."""
    a, e, t = math.radians(azimuth_deg), math.radians(elevation_deg), math.radians(azimuth_deg + turn_deg)
    centre = (range_m * math.cos(a) * math.cos(e), range_m * math.sin(a) * math.cos(e), range_m * math.sin(e))
    return centre, (-math.sin(t), math.cos(t), 0.0), (0.0, 0.0, 1.0)
