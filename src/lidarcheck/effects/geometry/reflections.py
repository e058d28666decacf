"""Where mirrors lie in a scan, and what rays that they reflect meet in an ideal scan alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.rays import Hits, Rays

__all__ = ["GROUND_M", "GroundPlane", "ground_of", "march", "reflected"]

GROUND_M = 0.1
"""A road is flat to about this, over the distances at which it mirrors."""

_FIRST_M, _STEPS = 0.25, 72
"""The march begins so far from the mirror and takes so many steps, each longer than the last by one factor."""
_BLOCK = 1 << 14
_AGREE_M = 0.05
_THICK_M = 1.0
"""So thick, away from the sensor, may be what it sees; a way that enters there is not followed further."""


class GroundPlane(NamedTuple):
    """The plane normal . x = -height_m, `normal` upward (3,), the origin `height_m` above it."""

    normal: FloatArray
    height_m: float


def reflected(direction: FloatArray, normal: FloatArray) -> FloatArray:
    """Directions (n, 3) after a mirror with those unit normals, (n, 3) or (3,)."""
    across = np.einsum("ij,ij->i", direction, np.broadcast_to(normal, direction.shape))
    return np.asarray(direction - 2.0 * across[:, None] * normal)


def ground_of(point_m: FloatArray, level: BoolArray) -> GroundPlane | None:
    """The plane of the ground through points (n, 3) of which `level` ones lie on level surfaces; None if there is none.

    Least squares for z over x and y, from the level points' median height on, again and again over those within a
    distance that shrinks to `GROUND_M`: walls, cars and kerbs lose their say.
    """
    points = point_m[level]
    if len(points) < 12:
        return None
    gradient, height = np.zeros(2), float(np.median(points[:, 2]))
    for reach in (1.0, 0.5, 0.25, 2.0 * GROUND_M, GROUND_M, GROUND_M, GROUND_M):
        near = np.abs(points[:, 2] - elementary.product(points[:, :2], gradient) - height) < reach
        middle = points[near].mean(axis=0) if near.sum() >= 12 else None
        if middle is None:
            return None
        apart = points[near] - middle
        x, y, z = apart.T
        more = 1e-9 * (1.0 + (x * x).sum() + (y * y).sum())
        # A narrow strip of ground does not tell its slope across: the smaller it is, the more it counts as level.
        xx, xy, yy = (x * x).sum() + more, (x * y).sum(), (y * y).sum() + more
        xz, yz = (x * z).sum(), (y * z).sum()
        gradient = np.array([xz * yy - yz * xy, yz * xx - xz * xy]) / (xx * yy - xy * xy)
        height = float(middle[2] - elementary.product(middle[:2], gradient))
    scale = 1.0 / float(np.sqrt(1.0 + elementary.product(gradient, gradient)))
    ground = GroundPlane(np.array([-gradient[0], -gradient[1], 1.0]) * scale, -height * scale)
    return ground if ground.height_m > 0.0 and ground.normal[2] > 0.9 else None


def march(surfaces: LocalSurfaces, rays: Rays, mirror: BoolArray, max_range_m: float) -> Hits:
    """What reflected rays meet among the surfaces of an ideal scan, those of `mirror` rows (n_rows,) left out.

    A ray is followed in growing steps. Where it comes near the surface that the sensor sees in that direction, it is
    intersected with that surface's plane; the hit counts if it lies within the step, on the side that the sensor sees,
    and in the direction of the surface. So what the sensor does not see cannot be reflected, nor backs of things; ways
    that enter what it sees from an unseen side end there.
    """
    n = len(rays)
    row, distance = np.full(n, -1, dtype=np.int64), np.zeros(n)
    depth = _depths(surfaces, mirror)
    for start in range(0, n, _BLOCK):
        part = np.arange(start, min(start + _BLOCK, n))
        _march_block(surfaces, rays, part, depth, max_range_m, row, distance)
    met = distance > 0.0
    ideal = surfaces.ideal
    found = row[met]
    material, number, incidence = np.zeros(n, dtype=np.int32), np.zeros(n, dtype=np.int32), np.zeros(n)
    material[met] = ideal.material_id[found]
    if ideal.object_id is not None:
        number[met] = ideal.object_id[found]
    incidence[met] = surfaces.incidence_deg(found, rays.direction[met])
    return Hits(distance, material, number, incidence, np.zeros((n, 3)))


def _depths(surfaces: LocalSurfaces, mirror: BoolArray) -> npt.NDArray[np.float32]:
    """How far the sensor sees in each cell, shape (cells,), in the first sub-beam; infinite for nothing and mirrors."""
    ideal, grid = surfaces.ideal, surfaces.grid
    depth = np.full(len(grid.count), np.inf, dtype=np.float32)
    first = grid.order[grid.first[grid.count > 0]]
    seen = (ideal.distance_m[first] > 0.0) & ~mirror[first]
    depth[np.flatnonzero(grid.count > 0)[seen]] = ideal.distance_m[first[seen]]
    return depth


def _march_block(
    surfaces: LocalSurfaces,
    rays: Rays,
    open_: IndexArray,
    depth: npt.NDArray[np.float32],
    max_range_m: float,
    row: IndexArray,
    distance: FloatArray,
) -> None:
    """Follow the rays `open_`; write what they meet."""
    edges = _FIRST_M * elementary.power(max(max_range_m, 1.0) / _FIRST_M, np.arange(-1, _STEPS + 1) / _STEPS)
    start, along = (np.ascontiguousarray(c[open_].T, dtype=np.float32) for c in (rays.origin_m, rays.direction))
    for before, reach, after in zip(edges[:-2], edges[1:-1], edges[2:], strict=True):
        x, y, z = start + np.float32(reach) * along
        cell, inside, gone = surfaces.grid.seen(x, y, z)
        flat = np.sqrt(x * x + y * y)
        behind = np.sqrt(flat * flat + z * z) - depth[cell]
        near = np.flatnonzero(inside & (np.abs(behind) < after - before))
        # Just behind what the sensor sees it may be full or empty: such a way is given up.
        done = inside & (behind > 0.0) & (behind < max(_THICK_M, after - reach))
        if len(near):
            ray = open_[near]
            found, met = _refined(surfaces, rays, ray, cell[near].astype(np.int64), depth, (before, after))
            hit = found >= 0
            row[ray[hit]], distance[ray[hit]] = found[hit], met[hit]
            done[near[hit]] = True
        # A straight way leaves the field of view once; a margin keeps those that begin at its border.
        keep = ~(done | gone)
        if not keep.all():
            open_, start, along = open_[keep], start[:, keep], along[:, keep]
            if len(open_) == 0:
                return


def _refined(
    surfaces: LocalSurfaces,
    rays: Rays,
    ray: IndexArray,
    cell: IndexArray,
    depth: npt.NDArray[np.float32],
    within: tuple[float, float],
) -> tuple[IndexArray, FloatArray]:
    """Rows that those rays meet within that stretch of their way, beginning with the cells' rows; -1 for none."""
    origin, direction = rays.origin_m[ray], rays.direction[ray]
    first = np.zeros(len(ray), dtype=np.int32)
    row = surfaces.grid.rows(cell, first)
    met = _to_plane(surfaces, row, origin, direction)
    for _ in range(3):
        cell = surfaces.grid.nearest_cell(origin + met[:, None] * direction)
        row = surfaces.grid.rows(cell, first)
        last, met = met, _to_plane(surfaces, row, origin, direction)
    agrees = (np.abs(met - last) < _AGREE_M + 0.01 * met) & np.isfinite(depth[cell])
    agrees &= (met >= within[0]) & (met <= within[1])
    # The last plane must still be the one in whose direction the hit lies.
    again = surfaces.grid.rows(surfaces.grid.nearest_cell(origin + met[:, None] * direction), first)
    ideal = surfaces.ideal
    agrees &= ideal.material_id[again] == ideal.material_id[row]
    if ideal.object_id is not None:
        agrees &= ideal.object_id[again] == ideal.object_id[row]
    agrees &= np.abs(_to_plane(surfaces, again, origin, direction) - met) < _AGREE_M + 0.01 * met
    return np.where(agrees, row, -1), met


def _to_plane(surfaces: LocalSurfaces, row: IndexArray, origin: FloatArray, direction: FloatArray) -> FloatArray:
    """How far those rows' planes are along the rays, 0 where they are behind, or met from their back."""
    m = surfaces.m[row]
    toward = np.einsum("ij,ij->i", m, direction)
    ahead = surfaces.offset[row] - np.einsum("ij,ij->i", m, origin)
    met = np.divide(ahead, toward, out=np.zeros(len(row)), where=toward > 1e-9)
    return np.asarray(np.clip(met, 0.0, 2e3))
