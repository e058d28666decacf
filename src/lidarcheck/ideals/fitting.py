"""A target fitted to measured ranges: a robust start, then Gauss-Newton on range residuals with Tukey's weights.

The residual is taken along the ray, where the noise is. A target that turns by w about c and shifts by t changes the
range of a ray that meets it at p, with the normal n and the direction u, by n.(t + w x (p - c))/(n.u), and one whose
radius grows by g by g/(n.u): one derivative for every form. What no ray can show, as a plane that slides in itself, has
singular value 0 and stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.ideals.surfaces import Cylinder, Met, Plane, Surface, along

__all__ = ["FEWEST_ECHOES", "Fit", "Rays", "cylinder_start", "fitted", "plane_start", "standing"]

FEWEST_ECHOES = 12
"""Fewer echoes on a target say too little of where it stands."""
_TUKEY = 4.685
"""Tukey's constant: 95 % as efficient as least squares where the noise is Gaussian."""
_MAD = 1.4826
_STEPS, _ENOUGH_M = 30, 1e-7
_TRIES = 300
"""Random starts: with half of the echoes off the target, one of them is clean with a probability beyond 1 - 1e-17."""
_SINGULAR = 1e-9
_LEAST_M = 1e-6


@dataclass(frozen=True)
class Rays:
    """Rays with an echo, a row each: `origin_m`, `direction` (n, 3); `range_m` (n,) from the ray's origin."""

    origin_m: FloatArray
    direction: FloatArray
    range_m: FloatArray

    @property
    def place_m(self) -> FloatArray:
        """Where the echoes lie, shape (n, 3)."""
        return self.origin_m + self.range_m[:, None] * self.direction

    def take(self, rows: IndexArray | BoolArray) -> Rays:
        """The rays picked by a mask or by indices."""
        return Rays(self.origin_m[rows], self.direction[rows], self.range_m[rows])


@dataclass(frozen=True)
class Fit:
    """A target where it stands. `scatter_m`: robust standard deviation of the ranges about it; `used`: the echoes that
    counted, (n,); `about_m`, `covariance`: of turns about that point, shifts and the radius; None of a known pose.
    """

    surface: Surface
    scatter_m: float
    used: BoolArray
    about_m: FloatArray
    covariance: FloatArray | None

    def error_m(self, direction: FloatArray, met: Met) -> FloatArray:
        """Standard error of the distance of rays that meet it so, shape (n,); 0 where the pose is known."""
        if self.covariance is None:
            return np.where(np.isfinite(met.distance_m), 0.0, np.nan)
        slope = _slopes(self.surface, direction, met, self.about_m)
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slope, self.covariance, slope)))


def standing(surface: Surface, rays: Rays) -> Fit:
    """A target whose pose is known: what scatters about it, and which echoes lie on it."""
    residual = rays.range_m - surface.met(rays.origin_m, rays.direction).distance_m
    near = np.isfinite(residual)
    scatter = _scatter(residual[near]) if near.any() else 0.0
    middle = float(np.median(residual[near])) if near.any() else 0.0
    used = near & (np.abs(np.nan_to_num(residual, nan=np.inf) - middle) <= _TUKEY * scatter + _LEAST_M)
    return Fit(surface, scatter, used, np.zeros(3), None)


def fitted(start: Surface, rays: Rays) -> Fit:
    """The target nearest to the echoes from that start; `UsageError` where too few lie on it."""
    surface, about = start, np.median(rays.place_m, axis=0)
    scatter, used, covariance = 0.0, np.zeros(len(rays.range_m), dtype=np.bool_), None
    for _ in range(_STEPS):
        met = surface.met(rays.origin_m, rays.direction)
        residual = rays.range_m - met.distance_m
        there = np.isfinite(residual)
        if np.count_nonzero(there) < FEWEST_ECHOES:
            what = f"{np.count_nonzero(there)} echoes lie on the target, {FEWEST_ECHOES} are needed"
            raise UsageError(what, fix="choose a larger region, or a pose nearer to where it stands")
        scatter = max(_MAD * float(np.median(np.abs(residual[there]))), _LEAST_M)
        weight = np.where(there, (1.0 - np.minimum(np.abs(residual / (_TUKEY * scatter)), 1.0) ** 2) ** 2, 0.0)
        weight = np.nan_to_num(weight)
        used = weight > 0.0
        slope = _slopes(surface, rays.direction, met, about)
        step, inverse = _solved(slope[used], residual[used], weight[used])
        # Tukey's weights leave echoes out: their scatter stands for the noise of those that are left.
        covariance = inverse * float(np.sum(weight[used] * residual[used] ** 2) / max(np.sum(weight) - len(step), 1.0))
        surface = surface.moved(step[:3], step[3:6], about, step[6] if len(step) > 6 else 0.0)
        if float(np.max(np.abs(slope[used] @ step))) < _ENOUGH_M:
            break
    return Fit(surface, scatter, used, about, covariance)


def _slopes(surface: Surface, direction: FloatArray, met: Met, about_m: FloatArray) -> FloatArray:
    """Change of each ray's distance with shift, turn and radius, shape (n, 6 or 7); 0 where it meets nothing."""
    facing = np.einsum("ij,ij->i", met.normal, direction)
    there = np.isfinite(met.distance_m) & (np.abs(facing) > 1e-3)
    facing = np.where(there, facing, 1.0)
    place = met.own_m @ surface.turn.T + surface.place_m
    columns = [met.normal, np.cross(place - about_m, met.normal)]
    if surface.grows:
        columns.append(np.ones((len(facing), 1)))
    return np.where(there[:, None], np.concatenate(columns, axis=1) / facing[:, None], 0.0)


def _solved(slope: FloatArray, residual: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The step that takes most of the weighted residual away, and the inverse of the normal matrix."""
    root = np.sqrt(weight)[:, None]
    left, size, right = np.linalg.svd(slope * root, full_matrices=False)
    kept = size > _SINGULAR * size[0]
    inverse = np.where(kept, 1.0 / np.where(kept, size, 1.0), 0.0)
    step = right.T @ (inverse * (left.T @ (residual * root[:, 0])))
    return step, (right.T * inverse**2) @ right


def _scatter(residual: FloatArray) -> float:
    """Robust standard deviation about the median."""
    return float(_MAD * np.median(np.abs(residual - np.median(residual))))


def plane_start(rays: Rays, size_m: tuple[float, float] | None = None) -> Plane:
    """The plane through three of the echoes from which the others have the least median distance along their rays."""
    place = rays.place_m

    def planes() -> Iterator[Surface]:
        for a, b, c in _draws(place, 3):
            normal = np.cross(b - a, c - a)
            length = float(np.linalg.norm(normal))
            if length > 1e-9:
                normal = normal / length
                yield Plane(along(normal if normal @ a < 0.0 else -normal), a)

    best = _least_median(planes, rays)
    assert isinstance(best, Plane)
    middle = np.median(best.outline((place - best.place_m) @ best.turn), axis=0)
    return Plane(best.turn, best.place_m + best.turn[:, 1:] @ middle, size_m)


def cylinder_start(rays: Rays, radius_m: float | None = None) -> Cylinder:
    """An upright cylinder, or one along the echoes' longest direction, by circles through three of the echoes."""
    place = rays.place_m
    centred = place - np.median(place, axis=0)
    longest = np.linalg.svd(centred, full_matrices=False)[2][0]
    upright = np.array([0.0, 0.0, 1.0])

    def cylinders() -> Iterator[Surface]:
        for axis in (upright, longest if longest[2] >= 0.0 else -longest):
            turn = along(axis)[:, [1, 2, 0]]
            for a, b, c in _draws(place @ turn, 3):
                circle = _circle(a[:2], b[:2], c[:2])
                if circle is not None:
                    centre, radius = circle
                    own = radius if radius_m is None else radius_m
                    yield Cylinder(turn, turn @ np.array([*centre, 0.0]), own, None, radius_m is not None)

    best = _least_median(cylinders, rays)
    assert isinstance(best, Cylinder)
    return best


def _draws(place: FloatArray, count: int) -> Iterator[FloatArray]:
    """Random echoes, always the same ones, shape (count, 3) a draw."""
    draw = np.random.Generator(np.random.PCG64(0))
    for _ in range(_TRIES):
        yield place[draw.choice(len(place), count, replace=False)]


def _least_median(starts: Callable[[], Iterator[Surface]], rays: Rays) -> Surface:
    some = rays.take(np.linspace(0, len(rays.range_m) - 1, min(len(rays.range_m), 500)).astype(np.int64))
    best: tuple[float, Surface | None] = (np.inf, None)
    for surface in starts():
        off = np.abs(some.range_m - surface.met(some.origin_m, some.direction).distance_m)
        median = float(np.median(np.nan_to_num(off, nan=np.inf)))
        if median < best[0]:
            best = median, surface
    if best[1] is None:
        raise UsageError(
            "the echoes in the region show no such target", fix="choose a region that holds the target alone"
        )
    return best[1]


def _circle(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, float] | None:
    """Centre and radius of the circle through three points of a plane; None of such in a line."""
    p, q = b - a, c - a
    area = 2.0 * (p[0] * q[1] - p[1] * q[0])
    if abs(area) < 1e-9:
        return None
    pp, qq = p @ p, q @ q
    centre = np.array([q[1] * pp - p[1] * qq, p[0] * qq - q[0] * pp]) / area
    radius = float(np.linalg.norm(centre))
    return (a + centre, radius) if radius < 100.0 else None
