"""Ideal scans of a registered map: a sensor's rays cast into it from each pose, or along the way during the sweep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.poses import Poses
from lidarcheck.rays import Hits, Rays, Velocity
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.scenes.bvh import Bvh
from lidarcheck.scenes.facets import Facets
from lidarcheck.scenes.optics import Optics
from lidarcheck.scenes.sampling import Sampling, sampled
from lidarcheck.sensor import Sensor

__all__ = ["MapSurfaces", "frame_starts", "ideal_at", "map_of_mesh"]

_BLOCK = 65_536
"""Rays that are cast at a time."""


@dataclass(frozen=True, eq=False)
class MapSurfaces:
    """A map as triangles, and what is known of each, shapes (n,): material, standard error of its place across itself
    [m], whether it is too rough to say where a ray meets it, and whether something is there of which no more is known.

    `triangles_m` (n, 3, 3): less `origin_m` (3,), so that a map in a country's grid keeps its millimetres. `closed`:
    what is not met is empty; else, as between the points of a cloud, nobody knows.
    """

    triangles_m: FloatArray
    origin_m: FloatArray
    material_id: IntArray
    error_m: FloatArray
    rough: BoolArray
    unknown: BoolArray
    closed: bool
    bvh: Bvh = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bvh", Bvh(self.triangles_m))


def map_of_mesh(facets: Facets, origin_m: FloatArray, error_m: float = 0.0) -> MapSurfaces:
    """A map that is a mesh; `error_m`: standard error of its surfaces across themselves."""
    one, other = (facets.triangles_m[:, i] - facets.triangles_m[:, 0] for i in (1, 2))
    solid = np.linalg.norm(np.cross(one, other), axis=1) > 1e-12
    triangles = facets.triangles_m[solid] - origin_m
    if not len(triangles):
        raise UsageError("the map has no triangle with an area", fix="export it again")
    nothing = np.zeros(len(triangles), dtype=np.bool_)
    error = np.full(len(triangles), error_m)
    return MapSurfaces(triangles, origin_m, facets.material_id[solid], error, nothing, nothing, closed=True)


def frame_starts(poses: Poses, sensor: Sensor) -> FloatArray:
    """When the frames of a run begin that a trajectory covers whole, shape (n,): at its named poses, else one after
    another from its first. `UsageError` where it covers none."""
    sweep_s = sensor.sweep.duration_s or 0.0
    first, last = float(poses.time_s[0]), float(poses.time_s[-1])
    named = np.array([bool(name) for name in poses.names])
    if named.any():
        starts = poses.time_s[named]
        late = starts[starts + sweep_s > last + 1e-9]
        if len(late):
            what = f"the poses end before the sweep of the frame at {late[0]:g} s does ({sweep_s:g} s)"
            raise UsageError(what, fix="give poses up to the end of the last sweep")
        return np.asarray(starts)
    count = int((last - first - sweep_s) * sensor.frame_rate_hz + 1e-6) + 1
    if last - first < sweep_s or count < 1:
        what = f"the poses cover {last - first:g} s, a sweep takes {sweep_s:g} s"
        raise UsageError(what, fix="give poses over whole sweeps, or leave out --swept")
    return np.asarray(first + np.arange(count) / sensor.frame_rate_hz)


def ideal_at(
    surfaces: MapSurfaces,
    sensor: Sensor,
    poses: Poses,
    number: int,
    start_s: float | None = None,
    scan: Scan | None = None,
) -> IdealScan:
    """What the sensor's beams meet of a map in frame `number` of a run.

    At the pose of that number; with `start_s` each beam at the moment of its firing in a sweep that begins then, the
    sensor on its way between the poses. `scan`: what was measured in the frame, whose beams are cast where the sensor's
    do not look the same way in every frame. Distances have `DistanceError` where the map has errors, rows on what is
    too rough `Edge` 1; what lies behind something of which no more is known than that it is there is unknown as well.
    """
    where = _From(surfaces, poses, number, start_s)
    motion = None if start_s is None else ((0.0, 0.0, 0.0), 0.0)
    how = Sampling(sensor, second_hits=False, motion=motion, frame=number)
    if scan is not None and len(scan):
        own = replace(sensor, beams=scan.beams)
        how = replace(how, sensor=own, points=(0, int(scan.point.max())), frame=None)
    ideal = sampled(where, how)
    assert ideal.object_id is not None, "a cast tells which triangle it met"
    face, met = ideal.object_id, ideal.distance_m > 0.0
    lost = met & surfaces.unknown[face]
    if not surfaces.closed:
        lost |= ~met
    extra: dict[str, npt.NDArray[Any]] = dict(ideal.extra)
    if surfaces.error_m.any():
        cosine = np.maximum(np.cos(np.deg2rad(ideal.incidence_deg)), 0.05)
        extra["DistanceError"] = np.where(met & ~lost, surfaces.error_m[face] / cosine, np.nan)
    if surfaces.rough.any():
        extra["Edge"] = (met & surfaces.rough[face]).astype(np.int32)
    distance = np.where(lost, np.nan, ideal.distance_m)
    return replace(ideal, distance_m=distance, object_id=None, extra=extra)


@dataclass(frozen=True, eq=False)
class _From:
    """A map as a sensor sees it: rays of the sensor's frame, each from where the sensor is at the ray's time."""

    surfaces: MapSurfaces
    poses: Poses
    number: int
    start_s: float | None
    velocities_m_s: Mapping[int, Velocity] = field(default_factory=dict)
    optics: Mapping[int, Optics] = field(default_factory=dict)

    def cast(self, rays: Rays, *, moving: Mapping[int, Velocity] | None = None, max_range_m: float = 300.0) -> Hits:
        """What each ray meets first; the number of the triangle stands as its object."""
        n = len(rays)
        distance, face, incidence, normal = np.zeros(n), np.zeros(n, dtype=np.int32), np.zeros(n), np.zeros((n, 3))
        for rows in _blocks(n):
            turn, place = self._pose(rays.time_s[rows])
            origin = np.einsum("nij,nj->ni", turn, rays.origin_m[rows]) + place - self.surfaces.origin_m
            direction = np.einsum("nij,nj->ni", turn, rays.direction[rows])
            found, near, cosine = self.surfaces.bvh.first(origin, direction)
            met = (found >= 0) & (near <= max_range_m)
            distance[rows], face[rows] = np.where(met, near, 0.0), np.where(met, found, 0)
            angle = np.rad2deg(np.arccos(np.minimum(np.abs(cosine), 1.0)))
            incidence[rows] = np.where(met, angle, 0.0)
            towards = self.surfaces.bvh.normal[found] * np.where(cosine > 0.0, -1.0, 1.0)[:, None]
            normal[rows] = np.where(met[:, None], np.einsum("nji,nj->ni", turn, towards), 0.0)
        material = np.where(distance > 0.0, self.surfaces.material_id[face], 0).astype(np.int32)
        return Hits(distance, material, face, incidence, normal)

    def _pose(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self.start_s is not None:
            return self.poses.at(self.start_s + time_s)
        n = len(time_s)
        turn, place = self.poses.turn[self.number], self.poses.place_m[self.number]
        return np.broadcast_to(turn, (n, 3, 3)), np.broadcast_to(place, (n, 3))


def _blocks(n: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, n)) for start in range(0, n, _BLOCK))
