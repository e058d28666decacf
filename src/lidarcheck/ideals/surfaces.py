"""Targets of a known form: a plane, a cylinder or a mesh, standing somewhere in the sensor's frame.

A target has a frame of its own, which its pose takes into the sensor's: p = R p_own + t. A plane is the own plane
x = 0, as a panel across the sensor's view; a cylinder stands about the own Z axis.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.formats.geometry.placement import Pose, rotation
from lidarcheck.scenes.bvh import Bvh

__all__ = ["Cylinder", "Mesh", "Met", "Plane", "Surface", "posed"]

_GRAZING = 1e-6
"""A ray whose cosine to the surface is smaller does not meet it."""


class Met(NamedTuple):
    """What rays meet, a row each: `distance_m` (n,) from the ray's origin, NaN where it meets nothing; `normal` (n, 3),
    unit, towards the side that a cylinder's radius grows to; `own_m` (n, 3): where, in the target's own frame."""

    distance_m: FloatArray
    normal: FloatArray
    own_m: FloatArray


@dataclass(frozen=True)
class Surface(abc.ABC):
    """A target where it stands: `turn` (3, 3) and `place_m` (3,) take its own frame into the sensor's."""

    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    place_m: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def grows(self) -> bool:
        """Whether it has a radius that a fit may change."""
        return False

    @abc.abstractmethod
    def _first(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance (n,), NaN for none, and normal (n, 3) of what rays of the own frame meet."""

    def met(self, origin_m: FloatArray, direction: FloatArray) -> Met:
        """What rays of the sensor's frame, shapes (n, 3), meet ahead of them."""
        origin = (origin_m - self.place_m) @ self.turn
        along = direction @ self.turn
        distance, normal = self._first(origin, along)
        return Met(distance, normal @ self.turn.T, origin + distance[:, None] * along)

    def outline(self, own_m: FloatArray) -> FloatArray:
        """Places of the target's own frame, shape (n, 3), laid out flat, shape (n, 2) [m]."""
        return own_m[:, 1:]

    def moved(self, shift_m: FloatArray, turn_rad: FloatArray, about_m: FloatArray, grown_m: float = 0.0) -> Self:
        """The same turned by a rotation vector (3,) about a point and then shifted; its radius grown."""
        extra = _turned_by(turn_rad)
        place = extra @ (self.place_m - about_m) + about_m + shift_m
        return replace(self, turn=extra @ self.turn, place_m=place)


@dataclass(frozen=True)
class Plane(Surface):
    """A plane; `size_m`: its width along the own Y and its height along Z, None where its outline is not known."""

    size_m: tuple[float, float] | None = None

    def _first(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -origin[:, 0] / direction[:, 0]
        ahead = (np.abs(direction[:, 0]) > _GRAZING) & (distance > 0.0)
        if self.size_m is not None:
            flat = np.abs(origin[:, 1:] + np.nan_to_num(distance)[:, None] * direction[:, 1:])
            ahead &= (flat <= 0.5 * np.array(self.size_m)).all(axis=1)
        return np.where(ahead, distance, np.nan), np.tile([1.0, 0.0, 0.0], (len(distance), 1))


@dataclass(frozen=True)
class Cylinder(Surface):
    """A round pole about the own Z axis; `height_m`: from the own z = 0 up, None where its ends are not known."""

    radius_m: float = 0.1
    height_m: float | None = None
    fixed: bool = False

    @property
    def grows(self) -> bool:
        """Whether a fit may change the radius: not where it is given."""
        return not self.fixed

    def _first(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        level = direction[:, :2]
        a = np.maximum((level * level).sum(axis=1), _GRAZING**2)
        b = (origin[:, :2] * level).sum(axis=1)
        c = (origin[:, :2] ** 2).sum(axis=1) - self.radius_m**2
        with np.errstate(invalid="ignore"):
            distance = (-b - np.sqrt(b * b - a * c)) / a
        place = origin + np.nan_to_num(distance)[:, None] * direction
        ahead = distance > 0.0
        if self.height_m is not None:
            ahead &= (place[:, 2] >= 0.0) & (place[:, 2] <= self.height_m)
        normal = np.zeros_like(place)
        normal[:, :2] = place[:, :2] / self.radius_m
        return np.where(ahead, distance, np.nan), normal

    def outline(self, own_m: FloatArray) -> FloatArray:
        """The mantle unrolled: along the circumference and up."""
        around = np.arctan2(own_m[:, 1], own_m[:, 0]) * self.radius_m
        return np.stack([around, own_m[:, 2]], axis=1)

    def moved(self, shift_m: FloatArray, turn_rad: FloatArray, about_m: FloatArray, grown_m: float = 0.0) -> Self:
        """As of any target; the radius stays above a millimetre."""
        return replace(super().moved(shift_m, turn_rad, about_m), radius_m=max(self.radius_m + grown_m, 1e-3))


@dataclass(frozen=True, eq=False)
class Mesh(Surface):
    """A body of triangles; see `scenes.meshes.load_mesh`."""

    bvh: Bvh | None = None

    def _first(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        assert self.bvh is not None, "a mesh has triangles"
        face, distance, _ = self.bvh.first(origin, direction)
        return np.where(np.isfinite(distance), distance, np.nan), self.bvh.normal[face]


def posed(pose: Pose) -> tuple[FloatArray, FloatArray]:
    """`turn` and `place_m` of a pose: x, y, z [m], roll, pitch, yaw [deg]."""
    return rotation(*pose[3:]), np.array(pose[:3])


def along(normal: FloatArray) -> FloatArray:
    """A rotation, shape (3, 3), that turns the X axis to a unit vector, Z staying as upright as it can."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    left = np.cross(up, normal)
    left /= np.linalg.norm(left)
    return np.stack([normal, left, np.cross(normal, left)], axis=1)


def inside(of: FloatArray, corners: FloatArray) -> BoolArray:
    """Which places, shape (n, 2), lie within the convex hull of others, shape (m, 2); none where these make a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(corners)
    except (QhullError, ValueError):
        return np.zeros(len(of), dtype=np.bool_)
    # Chunk by chunk of the hull's sides: a frame has half a million beams, and only few are left after the first.
    found: BoolArray = np.asarray(np.isfinite(of).all(axis=1))
    for a, b, c in hull.equations:
        found[found] = of[found, 0] * a + of[found, 1] * b + c <= 1e-9
    return found


def _turned_by(vector: FloatArray) -> FloatArray:
    """The rotation by a rotation vector [rad], shape (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))
