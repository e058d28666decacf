"""Kinds of vehicles: how large they are, and so which cluster of points may be one and how far apart two stand."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.config.words import nearest
from lidarcheck.errors import UsageError
from lidarcheck.scenes.vehicles import CAR_M, TRUCK_M, VAN_M

__all__ = ["VEHICLES", "Extent", "VehicleKind", "distance_in_name", "extent_of", "suggested_offset", "vehicle_named"]

OUTER = 0.5
"""Percentage of points on either side that an extent leaves out: single echoes far off are no part of a vehicle."""
TOLERANCE_M, HEIGHT_TOLERANCE_M = 0.3, 0.1
SEEN_WIDTH = 0.85
"""Of the smallest width, how much must be seen: a part may be hidden or dark."""
LEAST_DEPTH_M = 0.3
_IN_NAME = re.compile(r"(?<![\d.])(\d{1,3}(?:\.\d+)?)\s?m(?![a-z0-9])", re.IGNORECASE)
BESIDE, GAP_M, STEP_M = 1.25, 0.5, 0.5


@dataclass(frozen=True)
class VehicleKind:
    """A kind of vehicle: usual length, width and height [m], and the smallest and largest there are."""

    name: str
    usual_m: tuple[float, float, float]
    least_m: tuple[float, float, float]
    most_m: tuple[float, float, float]

    def fits(self, extent: Extent, *, whole: bool = False) -> bool:
        """Whether what is seen may be such a vehicle: from behind only its width shows, from the side its length.

        `whole`: the points are known to be one thing, whose lower or upper part may be missing.
        """
        lowest = 0.5 * self.least_m[2] if whole else self.least_m[2] - HEIGHT_TOLERANCE_M
        return (
            SEEN_WIDTH * self.least_m[1] <= extent.long_m <= self.most_m[0] + TOLERANCE_M
            and extent.short_m <= self.most_m[1] + TOLERANCE_M
            and lowest <= extent.height_m <= self.most_m[2] + HEIGHT_TOLERANCE_M
        )

    def is_flat(self, extent: Extent) -> bool:
        """Whether it is longer than a vehicle is wide, and flat: a side seen square on, but more often a wall."""
        return extent.long_m > self.most_m[1] + TOLERANCE_M and extent.short_m < LEAST_DEPTH_M

    def words(self) -> str:
        """The sizes in words."""
        sizes = (f"{a:g} to {b:g} m {word}" for a, b, word in zip(self.least_m, self.most_m, _SIDES, strict=True))
        return ", ".join(sizes)


_SIDES = ("long", "wide", "high")
VEHICLES = {
    vehicle.name: vehicle
    for vehicle in (
        VehicleKind("car", CAR_M, (3.0, 1.5, 1.1), (5.4, 2.1, 1.8)),
        VehicleKind("van", VAN_M, (4.3, 1.7, 1.8), (7.5, 2.5, 3.0)),
        VehicleKind("truck", TRUCK_M, (5.5, 2.0, 2.4), (19.0, 2.7, 4.2)),
    )
}
"""The kinds by name."""


@dataclass(frozen=True)
class Extent:
    """Size of points [m]: the footprint's longer and shorter side, as it is turned, and the height."""

    long_m: float
    short_m: float
    height_m: float

    def words(self) -> str:
        """As a size."""
        return f"{self.long_m:.1f} x {self.short_m:.1f} x {self.height_m:.1f} m"


def distance_in_name(path: Path) -> float | None:
    """The distance [m] that a file's name says, a number before an m as in car_25m.pcd; None where there is not one."""
    found = _IN_NAME.findall(path.stem)
    return float(found[0]) if len(found) == 1 and float(found[0]) > 0.0 else None


def vehicle_named(name: str) -> VehicleKind:
    """The kind of that name; `UsageError` with the nearest one otherwise."""
    if name not in VEHICLES:
        near = nearest(name, VEHICLES)
        fix = f"did you mean {near}?" if near else f"use one of {', '.join(VEHICLES)}"
        raise UsageError(f"there is no vehicle {name!r}", fix=fix)
    return VEHICLES[name]


def extent_of(xyz_m: FloatArray) -> Extent:
    """Size of points, shape (n, 3), not empty: of the narrowest upright box that holds 99 % along each side."""
    x, y, z = xyz_m.T
    angle = np.deg2rad(np.arange(0.0, 90.0, 3.0))[:, None]
    sides = [_span(along) for along in (np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x)]
    best = int(np.argmin(sides[0] * sides[1] + 0.1 * (sides[0] + sides[1])))
    pair = sorted((float(sides[0][best]), float(sides[1][best])))
    return Extent(pair[1], pair[0], float(_span(z[None])[0]))


def _span(along: FloatArray) -> FloatArray:
    low, high = np.percentile(along, [OUTER, 100.0 - OUTER], axis=1)
    return np.asarray(high - low)


def suggested_offset(vehicle: VehicleKind | None, real_m: FloatArray, simulated_m: FloatArray) -> tuple[float, float]:
    """By how much to move the simulated vehicle along X and Y [m], once the centroids of both, shapes (n, 3), agree.

    To the right, so -Y, by 1.25 times the width and half a metre, rounded up to half a metre; the width is that of the
    kind, or of the points where they span more across the view. Never so little that the two touch.
    """
    real_y, simulated_y = real_m[:, 1] - real_m[:, 1].mean(), simulated_m[:, 1] - simulated_m[:, 1].mean()
    width = max(float(np.ptp(real_y)), float(np.ptp(simulated_y)), 0.0 if vehicle is None else vehicle.usual_m[1])
    apart = max(BESIDE * width + GAP_M, float(simulated_y.max() - real_y.min()) + GAP_M)
    return 0.0, -math.ceil(apart / STEP_M - 1e-9) * STEP_M
