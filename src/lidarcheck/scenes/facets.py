"""Surfaces made of triangles, each with a material: what every shape of a scene comes down to.

Metres; a shape is described in its own frame (X forward, Y left, Z up) and then placed in the sensor's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray

__all__ = [
    "Facets",
    "box",
    "cylinder",
    "ellipsoid",
    "extruded",
    "fan",
    "floor",
    "joined",
    "lying_cylinder",
    "placed",
    "rotation",
    "wall",
]

Point3 = tuple[float, float, float]


class Facets(NamedTuple):
    """Triangles by their corners, shape (n, 3, 3) in metres, and the material of each, shape (n,)."""

    triangles_m: FloatArray
    material_id: IntArray


def joined(*parts: Facets) -> Facets:
    """All parts as one."""
    return Facets(np.concatenate([part.triangles_m for part in parts]), np.concatenate([p.material_id for p in parts]))


def rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    """The rotation matrix Rz(yaw) Ry(-pitch) Rx(roll), shape (3, 3).

    Yaw turns to the left, pitch lifts what lies ahead (+X), roll lifts what lies to the left (+Y).
    """
    (cy, sy), (cp, sp), (cr, sr) = (_cos_sin(angle) for angle in (yaw_deg, pitch_deg, roll_deg))
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return np.asarray(elementary.product(elementary.product(yaw, pitch), roll))


def _cos_sin(angle_deg: float) -> tuple[float, float]:
    """Exact at quarter turns, so that a wall turned by 90 degrees stays straight."""
    quarters = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    angle = angle_deg % 360.0
    return quarters.get(angle) or (float(elementary.cos(np.deg2rad(angle))), float(elementary.sin(np.deg2rad(angle))))


def placed(
    facets: Facets, position_m: Point3, *, yaw_deg: float = 0.0, pitch_deg: float = 0.0, roll_deg: float = 0.0
) -> Facets:
    """Turned about the shape's origin, which then comes to stand at `position_m`."""
    turned = elementary.product(facets.triangles_m, rotation(yaw_deg, pitch_deg, roll_deg).T)
    return Facets(turned + np.asarray(position_m, dtype=np.float64), facets.material_id)


def fan(corners: Sequence[Point3] | FloatArray, material: int) -> Facets:
    """A flat polygon of at least three corners in order, all of which its first one sees."""
    points = np.asarray(corners, dtype=np.float64)
    first = np.broadcast_to(points[0], (len(points) - 2, 3))
    return _of(np.stack([first, points[1:-1], points[2:]], axis=1), material)


def wall(width_m: float, height_m: float, material: int, *, centre_m: Point3 = (0.0, 0.0, 0.0)) -> Facets:
    """An upright rectangle across X: `width_m` along Y, `height_m` along Z, about its centre."""
    x, y, z = centre_m
    w, h = width_m / 2.0, height_m / 2.0
    return fan([(x, y - w, z - h), (x, y + w, z - h), (x, y + w, z + h), (x, y - w, z + h)], material)


def floor(length_m: float, width_m: float, material: int) -> Facets:
    """A level rectangle: `length_m` along X, `width_m` along Y, about its centre."""
    a, b = length_m / 2.0, width_m / 2.0
    return fan([(-a, -b, 0.0), (a, -b, 0.0), (a, b, 0.0), (-a, b, 0.0)], material)


def box(low_m: Point3, high_m: Point3, material: int) -> Facets:
    """A closed box between two opposite corners: 12 triangles."""
    (x0, y0, z0), (x1, y1, z1) = low_m, high_m
    return extruded([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], y0, y1, material)


def extruded(profile_xz: Sequence[tuple[float, float]], right_m: float, left_m: float, material: int) -> Facets:
    """A closed body with a profile in X and Z, whose first corner sees all others, from y = right to y = left."""
    n = len(profile_xz)
    right, left = ([(x, y, z) for x, z in profile_xz] for y in (right_m, left_m))
    skirt = [fan([right[i], right[(i + 1) % n], left[(i + 1) % n], left[i]], material) for i in range(n)]
    return joined(fan(right, material), fan(left, material), *skirt)


def cylinder(diameter_m: float, height_m: float, material: int, *, sides: int, top_diameter_m: float = -1.0) -> Facets:
    """An upright prism or, with another diameter on top, a cone's stump, on Z = 0; its edges lie on the true surface.

    With `sides` facets a surface is at most r (1 - cos(pi / sides)) further in than the round one, and its normal is
    turned by at most 180 / sides degrees.
    """
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    round_ = np.stack([elementary.cos(angle), elementary.sin(angle), np.zeros(sides)], axis=1)
    top = diameter_m if top_diameter_m < 0.0 else top_diameter_m
    low, high = round_ * (diameter_m / 2.0), round_ * (top / 2.0) + [0.0, 0.0, height_m]
    mantle = _mantle(low, high)
    caps = [fan(low, material), *([fan(high, material)] if top > 0.0 else [])]
    return joined(_of(mantle, material), *caps)


def lying_cylinder(centre_m: Point3, diameter_m: float, width_m: float, material: int, *, sides: int) -> Facets:
    """A wheel: a cylinder along Y about its centre."""
    upright = cylinder(diameter_m, width_m, material, sides=sides).triangles_m - [0.0, 0.0, width_m / 2.0]
    return Facets(upright[..., [0, 2, 1]] + np.asarray(centre_m), np.full(len(upright), material, dtype=np.int32))


def ellipsoid(size_m: Point3, material: int, *, sides: int) -> Facets:
    """An ellipsoid about its centre, by `sides` meridians and half as many belts; its corners lie on the surface."""
    belts = max(sides // 2, 2)
    polar, turn = np.arange(belts + 1) * (np.pi / belts), np.arange(sides) * (2.0 * np.pi / sides)
    rings = np.stack(
        [
            np.multiply.outer(elementary.sin(polar), elementary.cos(turn)),
            np.multiply.outer(elementary.sin(polar), elementary.sin(turn)),
            np.broadcast_to(elementary.cos(polar)[:, None], (belts + 1, sides)),
        ],
        axis=-1,
    )
    triangles = np.concatenate([_mantle(rings[i], rings[i + 1]) for i in range(belts)])
    first, second, third = (triangles[:, i] for i in range(3))
    area = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    return _of(triangles[area > 1e-12] * (np.asarray(size_m) / 2.0), material)


def _mantle(low: FloatArray, high: FloatArray) -> FloatArray:
    """The triangles between two closed rings of equally many corners."""
    next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    lower, upper = np.stack([low, next_low, next_high], axis=1), np.stack([low, next_high, high], axis=1)
    flat = np.linalg.norm(np.cross(upper[:, 1] - upper[:, 0], upper[:, 2] - upper[:, 0]), axis=1) <= 1e-15
    return np.concatenate([lower, upper[~flat]])


def _of(triangles: FloatArray, material: int) -> Facets:
    return Facets(np.asarray(triangles, dtype=np.float64), np.full(len(triangles), material, dtype=np.int32))
