"""Zones of a histogram chip: the rays that lie in each, and what they meet where a zone is wider."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.effects.geometry.aiming import directions_of, rays_of, recast, redirected
from lidarcheck.effects.shared.reflectance import reflectance_of, with_reflectance
from lidarcheck.errors import UsageError
from lidarcheck.scan import IdealScan

__all__ = ["widened"]


def widened(ideal: IdealScan, up: float, aside: float, around: Surroundings) -> IdealScan:
    """What the rays of zones meet that are so many times as high and as wide; `UsageError` where nobody knows the rays.

    Without a scene a ray meets what the nearest ray of the scan met.
    """
    rays = rays_of(ideal)
    seen = _directions(ideal)
    axis = ideal.beams.directions(ideal.layer, ideal.point)
    (elevation, azimuth), (elevation_0, azimuth_0) = _angles(seen), _angles(axis)
    turn = np.mod(azimuth - azimuth_0 + np.pi, 2.0 * np.pi) - np.pi
    direction = directions_of(azimuth_0 + aside * turn, elevation_0 + up * (elevation - elevation_0))
    if around.scene is not None:
        return recast(ideal, redirected(rays, direction), around)
    from scipy.spatial import cKDTree

    row = cKDTree(seen).query(direction)[1]
    columns = {name: getattr(ideal, name)[row] for name in ("distance_m", "material_id", "incidence_deg")}
    if ideal.object_id is not None:
        columns["object_id"] = ideal.object_id[row]
    new = replace(ideal, rays=redirected(rays, direction), **columns)
    own = reflectance_of(ideal)
    return new if own is None else with_reflectance(new, own[row])


def _directions(ideal: IdealScan) -> FloatArray:
    """The rows' own directions, by X, Y, Z of what they meet or by their rays, shape (n, 3)."""
    if ideal.rays is not None:
        return ideal.rays.direction
    if not all(name in ideal.extra for name in ("X", "Y", "Z")):
        what = "the ideal scan does not say where the rays of its zones point"
        raise UsageError(what, fix="give it the columns X, Y, Z of what they meet, also of rays that meet nothing")
    xyz = np.stack([np.asarray(ideal.extra[name], dtype=np.float64) for name in ("X", "Y", "Z")], axis=1)
    origins = ideal.beams.origins_m(ideal.layer, ideal.point)
    away = xyz if origins is None else xyz - origins
    length = np.sqrt(np.square(away).sum(axis=1, keepdims=True))
    known = np.isfinite(length) & (length > 0.0)
    axis = ideal.beams.directions(ideal.layer, ideal.point)
    return np.where(known, away / np.where(known, length, 1.0), axis)


def _angles(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Elevation and azimuth of unit vectors [rad], shapes (n,)."""
    x, y, z = direction.T
    return elementary.arctan2(z, elementary.hypot(x, y)), elementary.arctan2(y, x)
