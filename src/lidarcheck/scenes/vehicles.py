"""Road users and street furniture put together of boxes, panes, plates and lamps; sizes as they are on the road.

Each stands on Z = 0 about its middle and drives towards +X: at yaw 0 the sensor sees its rear, at 180 its front.

| | length | width | height |
|---|---|---|---|
| car | 4.50 | 1.80 | 1.46 |
| van | 5.30 | 2.00 | 1.99 |
| truck | 10.00 | 2.50 | 3.80 |
| person | 0.30 | 0.50 | 1.75 |

Retro-reflecting parts: number plates of 0.52 by 0.11 m in front and at the back, a reflector in each lamp, and on a
truck's box the contour marking of 5 cm that European rules ask for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lidarcheck.scenes.facets import (
    Facets,
    box,
    cylinder,
    ellipsoid,
    extruded,
    fan,
    joined,
    lying_cylinder,
    placed,
    wall,
)

__all__ = ["BUILDERS", "CAR_M", "TRUCK_M", "VAN_M", "Paint", "car", "person", "tree", "truck", "van"]

CAR_M, VAN_M, TRUCK_M = (4.5, 1.8, 1.46), (5.3, 2.0, 1.99), (10.0, 2.5, 3.8)
"""Length, width and height."""

_PLATE_M = (0.52, 0.11)
_PROUD_M = 0.01
"""Plates and lamps stand out from the body by this, so that they and not the body are met."""


@dataclass(frozen=True, slots=True)
class Paint:
    """The material of each part of a vehicle, by number."""

    body: int
    glass: int
    plate: int
    lamp: int
    tyre: int
    interior: int
    marking: int


def car(paint: Paint) -> Facets:
    """A saloon: sloped bonnet, panes all around over seats, four wheels."""
    length, width, _ = CAR_M
    x, y = length / 2.0, width / 2.0
    lower = [(-x, 0.22), (x, 0.22), (x, 0.62), (x - 0.15, 0.74), (0.95, 0.95), (-1.75, 0.98), (-x, 0.92)]
    panes = _panes([(-1.75, 0.98), (0.95, 0.95), (0.15, 1.40), (-1.15, 1.40)], 0.80, 0.68, paint.glass)
    return joined(
        extruded(lower, -y, y, paint.body),
        box((-1.20, -0.70, 1.40), (0.20, 0.70, 1.46), paint.body),
        panes,
        *(box((-0.45, side - 0.01, 0.96), (-0.35, side + 0.01, 1.40), paint.body) for side in (-0.76, 0.76)),
        *(box((-0.55, side - 0.25, 0.96), (-0.40, side + 0.25, 1.36), paint.interior) for side in (-0.38, 0.38)),
        box((-1.45, -0.65, 0.97), (-1.32, 0.65, 1.22), paint.interior),
        *_wheels((-1.35, 1.35), y - 0.10, 0.64, 0.20, paint.tyre),
        *_plates(x, 0.45, 0.52, paint.plate),
        *_lamps(x, 0.66, (0.42, 0.14), (0.46, 0.80), y, paint.lamp),
    )


def van(paint: Paint) -> Facets:
    """A delivery van: short bonnet, windscreen, cab windows, closed load space."""
    length, width, height = VAN_M
    x, y = length / 2.0, width / 2.0
    cab = [(1.25, 1.10), (x - 0.55, 1.10), (1.45, height - 0.14), (1.25, height - 0.14)]
    return joined(
        extruded([(-x, 0.30), (x, 0.30), (x, 0.85), (x - 0.55, 1.10), (-x, 1.10)], -y, y, paint.body),
        box((-x, -y, 1.10), (1.25, y, height), paint.body),
        box((1.25, -y + 0.12, height - 0.14), (1.50, y - 0.12, height), paint.body),
        _panes(cab, y - 0.03, y - 0.12, paint.glass),
        *(box((1.26, side - 0.28, 1.10), (1.40, side + 0.28, 1.70), paint.interior) for side in (-0.5, 0.5)),
        *(wall(0.7, 0.6, paint.glass, centre_m=(-x - _PROUD_M, side, 1.5)) for side in (-0.45, 0.45)),
        *_wheels((-1.60, 1.70), y - 0.12, 0.68, 0.22, paint.tyre),
        *_plates(x, 0.50, 0.60, paint.plate),
        *_lamps(x, 0.72, (0.40, 0.20), (0.20, 0.95), y, paint.lamp),
    )


def truck(paint: Paint) -> Facets:
    """A box truck: cab with windows, box with contour marking, underrun bar."""
    length, width, height = TRUCK_M
    x, y = length / 2.0, width / 2.0
    front = x - 2.2
    cab = [(front, 1.75), (x, 1.75), (x - 0.12, 2.75), (front, 2.75)]
    return joined(
        box((-x, -y, 1.10), (front - 0.3, y, height), paint.body),
        box((-x + 0.3, -0.45, 0.75), (front, 0.45, 1.10), paint.interior),
        box((-x + 0.15, -1.10, 0.45), (-x + 0.25, 1.10, 0.60), paint.interior),
        box((front, -y + 0.05, 0.55), (x, y - 0.05, 1.75), paint.body),
        box((front, -y + 0.10, 2.75), (x - 0.12, y - 0.10, 2.95), paint.body),
        fan(
            [(front, -y + 0.1, 1.75), (front, y - 0.1, 1.75), (front, y - 0.1, 2.75), (front, -y + 0.1, 2.75)],
            paint.body,
        ),
        _panes(cab, y - 0.06, y - 0.10, paint.glass),
        *(box((front + 0.35, s - 0.3, 1.75), (front + 0.5, s + 0.3, 2.5), paint.interior) for s in (-0.6, 0.6)),
        _frame(-x - _PROUD_M, 1.15, height - 0.05, y - 0.03, 0.05, paint.marking),
        *_wheels((-3.0, -1.7, 3.9), y - 0.16, 1.0, 0.30, paint.tyre),
        *_plates(x, 0.80, 0.70, paint.plate, rear_x_m=-x + 0.15),
        *_lamps(x, 0.85, (0.35, 0.18), (0.35, 0.15), y, paint.lamp, rear_x_m=-x + 0.14, rear_z_m=0.53),
    )


def person(skin: int, clothing: int) -> Facets:
    """Somebody who stands: two legs, a body, two arms, a head."""
    legs = [box((-0.08, side - 0.07, 0.0), (0.08, side + 0.07, 0.85), clothing) for side in (-0.1, 0.1)]
    arms = [box((-0.06, side - 0.05, 0.80), (0.06, side + 0.05, 1.42), clothing) for side in (-0.27, 0.27)]
    trunk = box((-0.12, -0.20, 0.85), (0.12, 0.20, 1.47), clothing)
    head = ellipsoid((0.20, 0.17, 0.26), skin, sides=10)
    return joined(*legs, *arms, trunk, placed(head, (0.0, 0.0, 1.62)))


def tree(height_m: float, crown_m: float, bark: int, foliage: int) -> Facets:
    """A trunk below a crown of `crown_m` across, in three overlapping balls over the upper two thirds."""
    trunk = cylinder(0.05 * height_m**0.8, 0.5 * height_m, bark, sides=10, top_diameter_m=0.03 * height_m**0.8)
    balls = ((0.0, 0.0, 0.66, 1.0), (0.18, 0.22, 0.55, 0.7), (-0.2, -0.16, 0.8, 0.6))
    crown = []
    for x, y, z, size in balls:
        ball = ellipsoid((crown_m * size, crown_m * size, 0.66 * height_m * size), foliage, sides=12)
        centre = (x * crown_m, y * crown_m, min(z, 1.0 - 0.33 * size) * height_m)
        crown.append(placed(ball, centre))
    return joined(trunk, *crown)


def _panes(profile_xz: Sequence[tuple[float, float]], low_y: float, high_y: float, glass: int) -> Facets:
    """The four panes of a cabin: rear, front and sides of a profile (rear low, front low, front high, rear high)."""
    (rx, rz), (fx, fz), (gx, gz), (hx, hz) = profile_xz
    front = fan([(fx, -low_y, fz), (fx, low_y, fz), (gx, high_y, gz), (gx, -high_y, gz)], glass)
    rear = fan([(rx, -low_y, rz), (rx, low_y, rz), (hx, high_y, hz), (hx, -high_y, hz)], glass)
    sides = [
        fan([(rx, s * low_y, rz), (fx, s * low_y, fz), (gx, s * high_y, gz), (hx, s * high_y, hz)], glass)
        for s in (-1.0, 1.0)
    ]
    return joined(front, rear, *sides)


def _wheels(axles_x: Sequence[float], side_y: float, diameter: float, width: float, tyre: int) -> list[Facets]:
    return [
        lying_cylinder((x, side, diameter / 2.0), diameter, width, tyre, sides=16)
        for x in axles_x
        for side in (-side_y, side_y)
    ]


def _plates(x: float, front_z: float, rear_z: float, plate: int, *, rear_x_m: float | None = None) -> list[Facets]:
    rear = -x if rear_x_m is None else rear_x_m
    return [
        wall(*_PLATE_M, plate, centre_m=(x + _PROUD_M, 0.0, front_z)),
        wall(*_PLATE_M, plate, centre_m=(rear - _PROUD_M, 0.0, rear_z)),
    ]


def _lamps(
    x: float,
    front_z: float,
    front_size: tuple[float, float],
    rear: tuple[float, float],
    y: float,
    lamp: int,
    *,
    rear_x_m: float | None = None,
    rear_z_m: float | None = None,
) -> list[Facets]:
    """Two in front and two at the back; `rear`: width, and centre height unless `rear_z_m` says otherwise."""
    width, rear_z = rear[0], rear[1] if rear_z_m is None else rear_z_m
    back = (-x if rear_x_m is None else rear_x_m) - _PROUD_M
    return [
        part
        for side in (-1.0, 1.0)
        for part in (
            wall(*front_size, lamp, centre_m=(x + _PROUD_M, side * (y - front_size[0] / 2.0 - 0.08), front_z)),
            wall(width, 0.14, lamp, centre_m=(back, side * (y - width / 2.0 - 0.06), rear_z)),
        )
    ]


def _frame(x: float, low_z: float, high_z: float, half_y: float, tape: float, material: int) -> Facets:
    """Tape along the four edges of a rectangle across X."""
    middle, height = (low_z + high_z) / 2.0, high_z - low_z
    level = [wall(2.0 * half_y, tape, material, centre_m=(x, 0.0, z)) for z in (low_z + tape, high_z - tape)]
    upright = [
        wall(tape, height - 4.0 * tape, material, centre_m=(x, side * (half_y - tape / 2.0), middle))
        for side in (-1.0, 1.0)
    ]
    return joined(*level, *upright)


BUILDERS = {"car": car, "truck": truck, "van": van}
"""The vehicles by name."""
