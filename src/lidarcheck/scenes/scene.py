"""A scene: objects made of triangles, and what rays meet among them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.rays import Hits, Rays, Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.scenes.bvh import Bvh
from lidarcheck.scenes.optics import Optics
from lidarcheck.scenes.sampling import Sampling, sampled
from lidarcheck.sensor import VARIANTS, Sensor, shipped
from lidarcheck.workers.cores import usable_cores

__all__ = ["Scene", "SceneObject"]

Groups = tuple["_Group", ...]

_BLOCK = 65_536
"""Rays a thread takes at a time: their intermediate results stay in the processor's cache."""

_AT_REST: Velocity = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One object: its triangles where they stand at the frame's start, shape (n, 3, 3) in metres, sensor frame.

    `material_id`, shape (n,), 0 or more. `velocity_m_s`: its own motion over ground, straight. Several objects with the
    same `object_id` move and are reported as one. `UsageError` for triangles that are not finite, or without area.
    """

    triangles_m: FloatArray
    material_id: IntArray
    object_id: int
    velocity_m_s: Velocity = _AT_REST
    name: str = ""

    def __post_init__(self) -> None:
        triangles = np.array(self.triangles_m, dtype=np.float64)
        material = np.array(self.material_id, dtype=np.int32)
        label = self.name or f"object {self.object_id}"
        if triangles.ndim != 3 or triangles.shape[1:] != (3, 3) or material.shape != triangles.shape[:1]:
            raise UsageError(f"{label}: triangles of shape {triangles.shape} with materials of {material.shape}")
        if not np.all(np.isfinite(triangles)) or not np.all(np.isfinite(self.velocity_m_s)):
            raise UsageError(f"{label} has a corner or a velocity that is not finite", fix="use finite numbers")
        edges = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        # What has no area is no surface: exporters leave such slivers behind.
        solid = np.linalg.norm(np.cross(*edges), axis=1) > 1e-12
        if not solid.any():
            raise UsageError(f"{label} has no triangle with an area", fix="check its size or its file")
        if material.min() < 0:
            raise UsageError(f"{label} has the material {material.min()}", fix="use numbers from 0")
        for name, column in (("triangles_m", triangles[solid]), ("material_id", material[solid])):
            column.flags.writeable = False
            object.__setattr__(self, name, column)


class _Group(NamedTuple):
    """Objects that move alike, in one hierarchy."""

    velocity_m_s: Velocity
    bvh: Bvh
    material_id: IntArray
    object_id: IntArray


_Columns = tuple[npt.NDArray[Any], ...]
"""What rays meet: the columns of `Hits`, in their order."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects, and by number the materials that mirror or let light through; a `lidarcheck.rays.Caster`.

    The sensor stands at the origin. The hierarchies for casting are built on first use and stay out of pickles.
    """

    objects: tuple[SceneObject, ...]
    optics: Mapping[int, Optics] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "objects", tuple(self.objects))
        object.__setattr__(self, "optics", dict(self.optics))
        if not self.objects:
            raise UsageError("a scene has no objects", fix="add one")
        velocity: dict[int, Velocity] = {}
        for thing in self.objects:
            if velocity.setdefault(thing.object_id, thing.velocity_m_s) != thing.velocity_m_s:
                what = f"object {thing.object_id} has two velocities"
                raise UsageError(what, fix="give its parts one velocity, or other IDs")
        object.__setattr__(self, "_built", {})

    def __getstate__(self) -> dict[str, Any]:
        return {"objects": self.objects, "optics": self.optics, "_built": {}}

    @property
    def velocities_m_s(self) -> Mapping[int, Velocity]:
        """Velocities of the objects that move on their own, by object ID."""
        return {thing.object_id: thing.velocity_m_s for thing in self.objects if any(thing.velocity_m_s)}

    @property
    def names(self) -> Mapping[int, str]:
        """The names of the objects, by object ID; of several with one ID the first's."""
        return {thing.object_id: thing.name for thing in reversed(self.objects)}

    @property
    def triangles(self) -> int:
        """How many triangles the scene has."""
        return sum(len(thing.triangles_m) for thing in self.objects)

    def digest(self) -> str:
        """SHA-256 over all that decides what rays meet, to a nanometre; names are left out.

        Which of two surfaces a beam on an edge meets may differ between processors; the scene itself does not.
        """
        sha = hashlib.sha256()
        for thing in self.objects:
            sha.update(np.round(thing.triangles_m, 9).tobytes() + thing.material_id.tobytes())
            sha.update(repr((thing.object_id, tuple(map(float, thing.velocity_m_s)))).encode())
        for number, optics in sorted(self.optics.items()):
            sha.update(repr((number, float(optics.mirror), float(optics.transmission))).encode())
        return sha.hexdigest()

    def cast(self, rays: Rays, *, moving: Mapping[int, Velocity] | None = None, max_range_m: float = 300.0) -> Hits:
        """What each ray meets first within `max_range_m`, the objects in `moving` where they are at the ray's time.

        Both sides of a surface are met. One within a micrometre of the ray's origin is passed over; farther from the
        sensor than 1 m, where single precision is coarser, begin a ray that leaves a surface a millimetre off it.
        """
        groups = self._groups({} if moving is None or not np.any(rays.time_s) else moving)
        n = len(rays)
        found: _Columns = (np.zeros(n), *(np.zeros(n, dtype=np.int32) for _ in range(2)), np.zeros(n), np.zeros((n, 3)))

        def run(rows: slice) -> None:
            for column, values in zip(found, _first(groups, rays, rows, max_range_m), strict=True):
                column[rows] = values

        blocks = list(_blocks(n))
        if len(blocks) < 2:
            for rows in blocks:
                run(rows)
        else:
            with ThreadPoolExecutor(usable_cores()) as pool:
                list(pool.map(run, blocks))
        return Hits(*found)

    def ideal(
        self,
        sensor: Sensor | None = None,
        *,
        layers: tuple[int, int] | None = None,
        points: tuple[int, int] | None = None,
        sub_beams: int | None = None,
        second_hits: bool = True,
        swept: bool = False,
        velocity_m_s: Velocity = _AT_REST,
        yaw_deg_s: float = 0.0,
        max_range_m: float | None = None,
        frame: int = 0,
    ) -> IdealScan:
        """What every beam of a sensor (None: of SMART and SLIM) meets: a row each, or several of a beam's footprint.

        `layers`, `points`: first and last, both included; None: all. `sub_beams`: its square of rows a beam, spread
        over the footprint of the sensor or, where it has none, over the beam's cell, half-way to its neighbours; None:
        as many as the sensor's footprint asks for, else one. `second_hits`: what mirrors and panes show besides
        themselves gets rows of its own, at the length of its light's way, with its `share` of the light. `swept`: each
        beam is cast when the sensor fires it, the objects moving with their velocities and the sensor with
        `velocity_m_s` and `yaw_deg_s` (to the left); else everything stands as at the frame's start. Rows in order of
        (layer, point, distance); a row that meets nothing within `max_range_m` (None: the sensor's) has the distance 0.
        `frame`: of a sensor whose columns do not repeat, which frame of a run from 0; it has columns X, Y, Z and
        Azimuth0 in `extra`. `UsageError` for beams that there are not, or numbers out of range.
        """
        motion = (velocity_m_s, yaw_deg_s) if swept else None
        sensor = shipped(VARIANTS[0]) if sensor is None else sensor
        how = Sampling(sensor, layers, points, sub_beams, second_hits, motion, max_range_m, frame)
        return sampled(self, how)

    def _groups(self, moving: Mapping[int, Velocity]) -> Groups:
        """The objects by velocity, those at rest first, each group in a hierarchy of its own."""
        of_object = [tuple(map(float, moving.get(thing.object_id, _AT_REST))) for thing in self.objects]
        key = tuple(of_object)
        built: dict[Any, Groups] = self.__dict__["_built"]
        if key not in built:
            distinct = dict.fromkeys(sorted(set(of_object), key=lambda velocity: any(velocity)))
            groups = tuple(
                _group(velocity, [o for o, v in zip(self.objects, of_object, strict=True) if v == velocity])  # type: ignore[arg-type]
                for velocity in distinct
            )
            if len(built) >= 4:  # a search over velocities must not keep a hierarchy for each
                built.clear()
            built[key] = groups
        return built[key]


def _group(velocity_m_s: Velocity, things: list[SceneObject]) -> _Group:
    triangles = np.concatenate([thing.triangles_m for thing in things])
    material = np.concatenate([thing.material_id for thing in things])
    number = np.repeat([thing.object_id for thing in things], [len(thing.triangles_m) for thing in things])
    return _Group(velocity_m_s, Bvh(triangles), material, number.astype(np.int32))


def _blocks(n: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, n)) for start in range(0, n, _BLOCK))


def _first(groups: Groups, rays: Rays, rows: slice, max_range_m: float) -> _Columns:
    """The nearest hit of those rays over all groups."""
    origin, direction = rays.origin_m[rows], rays.direction[rows]
    best: _Columns | None = None
    for group in groups:
        start = origin
        if any(group.velocity_m_s):
            # The object has moved on; seen from it, the ray begins further back.
            start = origin - rays.time_s[rows][:, None] * np.asarray(group.velocity_m_s)
        seen = _met(group, start, direction, max_range_m)
        best = seen if best is None else _nearer(best, seen)
    assert best is not None, "a scene has objects"
    return best


def _met(group: _Group, origin: FloatArray, direction: FloatArray, max_range_m: float) -> _Columns:
    face, distance, cosine = group.bvh.first(origin, direction)
    miss = distance > max_range_m
    distance[miss] = 0.0
    material, number = group.material_id[face], group.object_id[face]
    material[miss] = number[miss] = 0
    incidence = np.rad2deg(elementary.arccos(np.minimum(np.abs(cosine), 1.0)))
    incidence[miss] = 0.0
    normal = group.bvh.normal[face] * np.where(miss, 0.0, np.where(cosine > 0.0, -1.0, 1.0))[:, None]
    return distance, material, number, incidence, normal


def _nearer(one: _Columns, other: _Columns) -> _Columns:
    """Row by row the nearer of the two."""
    second = (other[0] > 0.0) & ((one[0] == 0.0) | (other[0] < one[0]))
    pairs = zip(one, other, strict=True)
    return tuple(np.where(second if a.ndim == 1 else second[:, None], b, a) for a, b in pairs)
