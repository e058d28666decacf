"""Planes seen by beams: fitted without being led by outliers, and told apart where surfaces meet.

A plane n·x = d meets a beam of direction u at 1/r = (n/d)·u, which is linear in the three numbers n/d: these are
fitted, and residuals are lengths along the beams, where the sensor's noise is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray

__all__ = ["FittedPlane", "FloorOrRoof", "fit_plane", "level_of", "planes_of", "spread_of"]

MAD_PER_SIGMA = 1.4826
MOST_FITTED = 4000
TRIPLES, JUDGED = 200, 600
MOST_PLANES = 8
CELL_M = 1.0
LEVEL_STEP_M = 0.05
LEVEL_SHARE = 0.12
LEVEL_BAND_M = 0.3
FEWEST_CELLS = 10
NEAREST_LEVEL_M = 0.3


@dataclass(frozen=True)
class FittedPlane:
    """The plane a·x = 1, x in the sensor frame [m]."""

    a: tuple[float, float, float]

    def range_m(self, direction: FloatArray) -> FloatArray:
        """Where beams meet it, shape (...,) for directions (..., 3); inf for those that never do."""
        slope = direction @ np.array(self.a)
        with np.errstate(divide="ignore"):
            return np.where(slope > 0.0, 1.0 / slope, np.inf)

    @property
    def normal(self) -> FloatArray:
        """Unit normal, away from the sensor, shape (3,)."""
        a = np.array(self.a)
        return np.asarray(a / np.linalg.norm(a))

    def incidence_deg(self, direction: FloatArray) -> float:
        """Angle between one beam and the normal."""
        return float(np.rad2deg(np.arccos(np.clip(abs(float(self.normal @ direction)), 0.0, 1.0))))


@dataclass(frozen=True)
class FloorOrRoof:
    """A floor or a roof: height z = z_m + slope_x x + slope_y y over the sensor's position."""

    z_m: float
    slope_x: float = 0.0
    slope_y: float = 0.0

    def height_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Its height at positions, same shape."""
        return self.z_m + self.slope_x * x_m + self.slope_y * y_m


def fit_plane(direction: FloatArray, range_m: FloatArray, *, rounds: int = 5) -> FittedPlane:
    """The plane of beams (n, 3) and their ranges (n,), n at least 3, by reweighted least squares (Tukey's biweight)."""
    if len(range_m) > MOST_FITTED:
        pick = np.linspace(0, len(range_m) - 1, MOST_FITTED).astype(np.int64)
        direction, range_m = direction[pick], range_m[pick]
    # Inverse ranges first: a few beams that see a far wall would else rule.
    inverse = 1.0 / range_m
    a = np.linalg.lstsq(direction, inverse)[0]
    for _ in range(rounds):
        slope = np.maximum(direction @ a, 1e-6)
        residual = range_m - 1.0 / slope
        reach = 4.685 * max(spread_of(residual), 1e-4)
        weight = np.clip(1.0 - (residual / reach) ** 2, 0.0, None) / slope**2
        if np.count_nonzero(weight) < 3:
            break
        a = np.linalg.lstsq(direction * weight[:, None], inverse * weight)[0]
    return FittedPlane((float(a[0]), float(a[1]), float(a[2])))


def spread_of(values: FloatArray) -> float:
    """Standard deviation around the median as the median magnitude tells it; 0 for nothing."""
    return MAD_PER_SIGMA * float(np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def planes_of(
    direction: FloatArray, range_m: FloatArray, tolerance_m: float, fewest: int
) -> Iterator[tuple[FittedPlane, IndexArray]]:
    """The planes that beams of one connected surface show, each with the rows on it; rows of none are left out.

    They are taken one after another, the one with most rows first, and each row goes to the plane it is closest to.
    """
    planes = _one_after_another(direction, range_m, tolerance_m, fewest)
    if not planes:
        return
    off = np.abs(range_m[:, None] - np.stack([plane.range_m(direction) for plane in planes], axis=1))
    best = np.argmin(off, axis=1)
    near = off[np.arange(len(best)), best] <= tolerance_m
    for i, plane in enumerate(planes):
        rows = np.flatnonzero(near & (best == i))
        if len(rows) >= fewest:
            yield plane, rows


def _one_after_another(
    direction: FloatArray, range_m: FloatArray, tolerance_m: float, fewest: int
) -> list[FittedPlane]:
    rng = np.random.default_rng(0)
    left = np.arange(len(range_m))
    planes: list[FittedPlane] = []
    while len(left) >= max(fewest, 0.02 * len(range_m)) and len(planes) < MOST_PLANES:
        guess = _best_triple(direction[left], range_m[left], tolerance_m, rng)
        if guess is None:
            break
        near = left[np.abs(range_m[left] - guess.range_m(direction[left])) <= tolerance_m]
        if len(near) < max(fewest, 3):
            break
        plane = fit_plane(direction[near], range_m[near])
        on = np.abs(range_m[left] - plane.range_m(direction[left])) <= tolerance_m
        if np.count_nonzero(on) < fewest:
            break
        planes.append(plane)
        left = left[~on]
    return planes


def _best_triple(
    direction: FloatArray, range_m: FloatArray, tolerance_m: float, rng: np.random.Generator
) -> FittedPlane | None:
    """Of the planes through random triples the one with most rows (RANSAC)."""
    triples = rng.integers(len(range_m), size=(TRIPLES, 3))
    corners = direction[triples]
    sound = np.abs(np.linalg.det(corners)) > 1e-12
    if not sound.any():
        return None
    a = np.linalg.solve(corners[sound], (1.0 / range_m[triples[sound]])[..., None])[..., 0]
    judged = rng.integers(len(range_m), size=min(JUDGED, len(range_m)))
    slope = direction[judged] @ a.T
    with np.errstate(divide="ignore"):
        off = np.abs(1.0 / slope - range_m[judged, None])
    best = a[int(np.argmax(np.count_nonzero((off <= tolerance_m) & (slope > 0.0), axis=0)))]
    return FittedPlane((float(best[0]), float(best[1]), float(best[2])))


def level_of(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, *, roof: bool = False) -> FloorOrRoof | None:
    """The floor 0.3 m and more below the sensor, or the roof above, from positions (n,); None where there is none.

    Each square metre counts once, with its lowest point, where all its points lie within 0.3 m: so walls and panels do
    not count. The floor is the lowest height that at least an eighth of all share, straightened by least squares.
    """
    z = -z_m if roof else z_m
    some = z < -NEAREST_LEVEL_M
    x, y, z = x_m[some], y_m[some], z[some]
    if not z.size:
        return None
    cell = np.floor(x / CELL_M).astype(np.int64) << 32 | (np.floor(y / CELL_M).astype(np.int64) + (1 << 31))
    order = np.lexsort((z, cell))
    start = np.flatnonzero(np.append(True, cell[order][1:] != cell[order][:-1]))
    highest = order[np.append(start[1:], len(order)) - 1]
    lowest = order[start]
    lowest = lowest[z[highest] - z[lowest] <= LEVEL_BAND_M]
    x, y, z = x[lowest], y[lowest], z[lowest]
    if not z.size:
        return None
    count = np.bincount(np.floor((z - z.min()) / LEVEL_STEP_M).astype(np.int64))
    # Three neighbouring bins, since a height may lie on a border between two.
    held = np.convolve(count, np.ones(3, dtype=np.int64), "same")
    many = np.flatnonzero(held >= max(LEVEL_SHARE * len(start), FEWEST_CELLS))
    if not many.size:
        return None
    first = many[0]
    top = first + int(np.argmax(held[first : first + 4]))
    level = FloorOrRoof(float(z.min() + (top + 0.5) * LEVEL_STEP_M))
    for _ in range(3):
        near = np.abs(z - level.height_m(x, y)) <= LEVEL_BAND_M
        rows = np.stack([np.ones(near.sum()), x[near], y[near]], axis=1)
        if len(rows) < 20 or np.ptp(x[near]) < 5.0 or np.ptp(y[near]) < 5.0:
            break
        fitted = np.linalg.lstsq(rows, z[near])[0]
        level = FloorOrRoof(*(float(v) for v in fitted))
    return FloorOrRoof(-level.z_m, -level.slope_x, -level.slope_y) if roof else level
