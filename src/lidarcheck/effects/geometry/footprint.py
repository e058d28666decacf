"""The rays of a beam's footprint, and where it may span more than one surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.rays import Rays, handed_over
from lidarcheck.sensor import FWHM_PER_SIGMA

__all__ = ["Spans", "offsets_rad", "spans_of", "spread_rays"]


def offsets_rad(fwhm_deg: float, count: int) -> FloatArray:
    """The middles of `count` equally probable parts of a Gaussian of that width (FWHM), shape (count,)."""
    from scipy.special import ndtri

    middles = np.asarray(ndtri((np.arange(count) + 0.5) / count))
    return np.asarray(np.deg2rad(fwhm_deg) / FWHM_PER_SIGMA * middles)


def spread_rays(rays: Rays, up_rad: FloatArray, left_rad: FloatArray) -> Rays:
    """Each ray (n,) as `len(up_rad)` times `len(left_rad)` rays around it, those of one ray together."""
    up, left = np.repeat(up_rad, len(left_rad)), np.tile(left_rad, len(up_rad))
    x, y, z = rays.direction.T
    flat = np.maximum(np.sqrt(x * x + y * y), 1e-12)
    east, north = x / flat, y / flat
    up, left = elementary.tan(up), elementary.tan(left)
    scale = 1.0 / np.sqrt(1.0 + up**2 + left**2)
    columns = (
        np.multiply.outer(x, scale) - np.multiply.outer(z * east, up * scale) - np.multiply.outer(north, left * scale),
        np.multiply.outer(y, scale) - np.multiply.outer(z * north, up * scale) + np.multiply.outer(east, left * scale),
        np.multiply.outer(z, scale) + np.multiply.outer(flat, up * scale),
    )
    direction = np.stack([column.ravel() for column in columns], axis=1)
    m = len(up)
    return handed_over(
        np.repeat(rays.origin_m, m, axis=0), direction, np.repeat(rays.time_s, m), np.repeat(rays.slot, m)
    )


class Spans(NamedTuple):
    """Rows whose footprint must be looked at along elevation, and along azimuth; shape (n,) each."""

    up: BoolArray
    left: BoolArray


def spans_of(surfaces: LocalSurfaces, rays: Rays, reach_rad: tuple[float, float], least_m: float) -> Spans:
    """Rays (n,) whose footprint may meet different surfaces, or ranges that spread by more than `least_m`.

    `reach_rad`: how far the footprint reaches up and aside. It is judged from the rows that lie that near, and from the
    slopes of the ray's own surface.
    """
    if len(surfaces.grid.order) == 0:
        nowhere = np.zeros(len(rays), dtype=bool)
        return Spans(nowhere, nowhere)
    grid = surfaces.grid
    broken = grid.spread(_breaks(surfaces, least_m), reach_rad)
    marks = [broken | grid.on_cells(slope) for slope in _slopes(surfaces, reach_rad, least_m)]
    seen = rays.direction
    if rays.origin_m.any():
        distance = surfaces.follow(rays.origin_m, rays.direction, rays.slot, surfaces.pick)[1]
        seen = rays.origin_m + np.where(distance > 0.0, distance, 1e4)[:, None] * rays.direction
    cell = grid.fired(grid.nearest_cell(seen))
    return Spans(*(mark[cell] for mark in marks))


def _breaks(surfaces: LocalSurfaces, least_m: float) -> BoolArray:
    """Rows beside which another object, material or plane begins, shape (n,)."""
    ideal = surfaces.ideal
    found = np.zeros(len(ideal), dtype=bool)
    hit = ideal.distance_m > 0.0
    for row in surfaces.grid.neighbours(ideal):
        other = hit[row] != hit
        both = hit[row] & hit
        differs = ideal.material_id[row] != ideal.material_id
        if ideal.object_id is not None:
            differs |= ideal.object_id[row] != ideal.object_id
        # From where the row's plane stands: its own ray's origin, or the sensor's middle.
        along = np.einsum("ij,ij->i", surfaces.m, surfaces.rays.direction[row])
        reach = surfaces.offset - np.einsum("ij,ij->i", surfaces.m, surfaces.rays.origin_m[row])
        continued = np.divide(reach, along, out=np.full(len(row), np.inf), where=along > 1e-9)
        apart = np.abs(continued - ideal.distance_m[row]) > least_m
        found |= (row >= 0) & (other | (both & (differs | apart)))
    return found


def _slopes(surfaces: LocalSurfaces, reach_rad: tuple[float, float], least_m: float) -> tuple[BoolArray, BoolArray]:
    """Rows whose own plane spreads the footprint's ranges by more than `least_m`, up and aside; shape (n,) each.

    Either axis has half of it, so that two that spread less do so together.
    """
    x, y, z = surfaces.rays.direction.T
    flat = np.maximum(np.sqrt(x * x + y * y), 1e-12)
    m_x, m_y, m_z = surfaces.m.T
    up = m_z * flat - z * (m_x * x + m_y * y) / flat
    left = (m_y * x - m_x * y) / flat
    per_rad = 2.0 * surfaces.ideal.distance_m**2
    up, left = (per_rad * np.abs(slope) * reach for slope, reach in zip((up, left), reach_rad, strict=True))
    both = up + left > least_m
    return both & (up > 0.5 * least_m), both & (left > 0.5 * least_m)
