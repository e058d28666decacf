"""What stands beside each ray: where surfaces end, how they are inclined, and where a person stood before them."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.ideals.repeats.groups import Groups, jump_m
from lidarcheck.ideals.repeats.lattice import Rays
from lidarcheck.ideals.repeats.observations import Observations

__all__ = ["at_edges", "hidden_rays", "incidence_deg", "of_surfaces"]

_BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))
_REACH = (1, 2)
"""Rows and columns of the neighbours that a plane is laid through."""
_FEWEST = 4
"""Neighbours, the ray itself among them, that a plane needs."""
_ALIKE = 3
_STEEPEST_DEG = 85.0
_OTHERS = 2
"""Neighbours that must have lost their surface to a nearer echo too, for it to be a person's."""


def at_edges(rays: Rays, range_m: FloatArray) -> BoolArray:
    """Rays next to one without a surface, or to a jump of range, shape (n,). `range_m`: NaN without a surface.

    A jump is more than `jump_m`, both in the ranges themselves and past the straight line that the ray and the one
    behind it make of the inverse ranges: on a plane that is seen at a low angle neighbouring layers lie far apart.
    """
    own = np.asarray(rays.image(range_m, np.nan), dtype=np.float64)
    there, known = rays.there, np.isfinite(own)
    edge = np.zeros_like(there)
    for down, along in _BESIDE:
        beside = np.asarray(rays.moved(own, down, along, np.nan), dtype=np.float64)
        behind = np.asarray(rays.moved(own, -down, -along, np.nan), dtype=np.float64)
        fired = np.asarray(rays.moved(there, down, along, False), dtype=np.bool_)
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.abs(beside - own) > jump_m(np.minimum(beside, own))
            line = 2.0 / own - 1.0 / behind
            onward = np.where(line > 0.0, 1.0 / line, np.inf)
            off = ~(np.abs(beside - onward) <= jump_m(np.minimum(beside, onward)))
            smooth = np.abs(behind - own) <= 0.5 * own
        jump = apart & ~(smooth & ~off)
        edge |= fired & (~np.isfinite(beside) | jump)
    return np.asarray(rays.of_image(edge & known), dtype=np.bool_)


def of_surfaces(rays: Rays, range_m: FloatArray) -> BoolArray:
    """Rays three of whose eight neighbours see about the same range, shape (n,): what false echoes do not."""
    own = np.asarray(rays.image(range_m, np.nan), dtype=np.float64)
    alike = np.zeros(own.shape, dtype=np.int64)
    for down, along in rays.around():
        beside = np.asarray(rays.moved(own, down, along, np.nan), dtype=np.float64)
        with np.errstate(invalid="ignore"):
            alike += np.abs(beside - own) <= jump_m(np.minimum(beside, own))
    return np.asarray(rays.of_image(alike >= _ALIKE), dtype=np.bool_)


def incidence_deg(rays: Rays, range_m: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Angle between each ray and the normal of the plane through its neighbours [deg], and whether there is one; (n,).

    Along a plane the inverse of the range is linear in the direction: a line is laid through it by least squares.
    """
    elevation, azimuth = rays.angles
    inverse = np.asarray(rays.image(1.0 / np.where(np.isfinite(range_m), range_m, np.nan), np.nan), dtype=np.float64)
    up, level = (np.asarray(rays.image(a, np.nan), dtype=np.float64) for a in (elevation, np.cos(elevation)))
    turn = np.asarray(rays.image(azimuth, np.nan), dtype=np.float64)
    sums = np.zeros((3, 3, *inverse.shape))
    right = np.zeros((3, *inverse.shape))
    count = np.zeros(inverse.shape, dtype=np.int64)
    for down, along in ((0, 0), *rays.around(_REACH)):
        value, high, around = (
            np.asarray(rays.moved(a, down, along, np.nan), dtype=np.float64) for a in (inverse, up, turn)
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.abs(1.0 / value - 1.0 / inverse)
            use = np.isfinite(value) & (apart <= 2.0 * jump_m(1.0 / inverse))
        x, y, forward = _tangent(high - up, around - turn, up, level)
        # In the tangent plane 1/R is scaled by how far the neighbour's direction points forward.
        terms = [np.where(use, term, 0.0) for term in (np.ones_like(x), x, y)]
        target = np.where(use, value / forward, 0.0)
        for i in range(3):
            right[i] += terms[i] * target
            for j in range(3):
                sums[i, j] += terms[i] * terms[j]
        count += use
    flat, good = _solved(sums, right, count)
    cosine = flat[0] / np.sqrt(np.maximum(flat[0] ** 2 + flat[1] ** 2 + flat[2] ** 2, 1e-300))
    angle = np.rad2deg(np.arccos(np.clip(cosine, np.cos(np.deg2rad(_STEEPEST_DEG)), 1.0)))
    found = np.where(good & np.isfinite(angle), angle, 0.0)
    return np.asarray(rays.of_image(found)), np.asarray(rays.of_image(good), dtype=np.bool_)


def _tangent(
    rise: FloatArray, turn: FloatArray, up: FloatArray, level: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a neighbour's direction meets the plane at distance 1 ahead: aside, up; and how far forward it points."""
    high = up + rise
    forward = np.cos(high) * np.cos(turn) * level + np.sin(high) * np.sin(up)
    aside = np.cos(high) * np.sin(turn)
    above = np.sin(high) * level - np.cos(high) * np.cos(turn) * np.sin(up)
    return aside / forward, above / forward, forward


def _solved(sums: FloatArray, right: FloatArray, count: IndexArray) -> tuple[FloatArray, BoolArray]:
    """The three numbers of each cell's line, shape (3, rows, columns), and where they are determined."""
    scale = np.sqrt(np.maximum(sums[1, 1] + sums[2, 2], 1e-300) / np.maximum(count, 1))
    unit = np.stack([np.ones_like(scale), scale, scale])
    matrix = np.moveaxis(sums / (unit[:, None] * unit[None, :]), (0, 1), (-2, -1))
    target = np.moveaxis(right / unit, 0, -1)
    good = (count >= _FEWEST) & (np.linalg.det(matrix) > 1e-6 * np.maximum(count, 1) ** 3)
    safe = np.where(good[..., None, None], matrix, np.eye(3))
    found = np.linalg.solve(safe, target[..., None])[..., 0]
    return np.moveaxis(found, -1, 0) / unit, good


def hidden_rays(seen: Observations, groups: Groups, gaps_m: FloatArray) -> BoolArray:
    """Rays that a person stands before, with their neighbours, frame by frame, shape (frames, rays).

    A ray that has lost its surface and shows a nearer echo, with two of its eight neighbours that do so too.
    """
    rays = seen.rays
    frames = seen.frames
    place = np.full(len(rays), np.nan)
    has = groups.row >= 0
    place[has] = groups.median_m[groups.row[has]]
    wide = np.maximum(gaps_m, jump_m(0.0 * gaps_m))
    at = place[seen.ray]
    with np.errstate(invalid="ignore"):
        on = np.abs(seen.spread_m - at) <= wide
        nearer = seen.spread_m < at - wide
    kept, before = (np.zeros((frames, len(rays)), dtype=np.bool_) for _ in range(2))
    kept[seen.frame[on], seen.ray[on]] = True
    before[seen.frame[nearer], seen.ray[nearer]] = True
    lost = before & ~kept & seen.fired & has
    found = np.zeros_like(lost)
    for frame in np.flatnonzero(lost.any(axis=1)):
        image = np.asarray(rays.image(lost[frame], False), dtype=np.bool_)
        others = sum(np.asarray(rays.moved(image, *step, False), dtype=np.int64) for step in rays.around())
        person = image & (others >= _OTHERS)
        grown = person.copy()
        for step in rays.around():
            grown |= np.asarray(rays.moved(person, *step, False), dtype=np.bool_)
        found[frame] = np.asarray(rays.of_image(grown), dtype=np.bool_)
    return found
