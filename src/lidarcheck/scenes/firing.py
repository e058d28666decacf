"""Which rays a sensor's beams send into a scene: from where, where to, and when."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.rays import Rays, Velocity
from lidarcheck.sensor import FWHM_PER_SIGMA, Beams, Sensor

__all__ = ["Fired", "Span", "fired", "fired_beams", "places"]

Span = tuple[int, int] | None
"""The first and the last of layers or points, both included; None for all."""


class Fired(NamedTuple):
    """The beams of a frame, and `rays_each` rays of each beam, those of one beam together.

    `layer`, `point` (n,). `axes`: the rays as the sensor stands at the frame's start; `rays`: as it moves.
    """

    beams: Beams
    layer: IntArray
    point: IntArray
    rays_each: int
    axes: Rays
    rays: Rays


def fired_beams(sensor: Sensor, layers: Span, points: Span, frame: int | None) -> tuple[Beams, IntArray, IntArray]:
    """The sensor's beams as that frame fires them, and layer and point of those asked for, layer by layer.

    `frame`: None: the beams are those of a frame already, as a scan brings them.
    `UsageError` for layers or points that the sensor does not have, and for a sensor without beams of its own.
    """
    beams, columns = (sensor.beams, sensor.beams.points) if frame is None else sensor.beams.of_frame(frame)
    layer, point = beams.every()
    if not len(layer):
        fix = "cast along the rays of a scan: lidarcheck scene --rays SCAN"
        raise UsageError(f"{sensor.name} has no beams of its own: each scan brings them", fix=fix)
    asked = point < columns
    for name, span, count, at in (("layers", layers, beams.layers, layer), ("points", points, beams.points, point)):
        if span is None:
            continue
        if not 0 <= span[0] <= span[1] < count:
            what = f"{name} = [{span[0]}, {span[1]}] is out of range"
            raise UsageError(what, fix=f"use [first, last], both included, from 0 to {count - 1}")
        asked &= (at >= span[0]) & (at <= span[1])
    return (beams, layer, point) if asked.all() else (beams, layer[asked], point[asked])


def fired(
    sensor: Sensor,
    layers: Span,
    points: Span,
    sub_beams: int | None,
    motion: tuple[Velocity, float] | None,
    frame: int | None,
) -> Fired:
    """The rays of those beams; `motion`: the sensor's own velocity and yaw rate [deg/s], None for a sensor at rest."""
    beams, layer, point = fired_beams(sensor, layers, points, frame)
    n, direction = _directions(sensor, beams, layer, point, sub_beams)
    origins = beams.origins_m(layer, point)
    origin = np.zeros((len(layer) * n, 3)) if origins is None else np.repeat(origins, n, axis=0)
    slot = np.tile(np.arange(n, dtype=np.int32), len(layer))
    axes = Rays(origin, direction, np.zeros(len(slot)), slot)
    if motion is None:
        return Fired(beams, layer, point, n, axes, axes)
    time_s = np.repeat(beams.fire_time_s(layer, point), n)
    turn = np.deg2rad(motion[1]) * time_s
    start = time_s[:, None] * np.asarray(motion[0], dtype=np.float64)
    moved = start if origins is None else start + _turned(origin, turn)
    return Fired(beams, layer, point, n, axes, Rays(moved, _turned(direction, turn), time_s, slot))


def places(
    beams: Beams, layer: IntArray, point: IntArray, distance_m: FloatArray, axes: Rays | None = None
) -> dict[str, FloatArray]:
    """The columns by which a file tells where beams look that no number tells: X, Y, Z, and Azimuth0 [deg].

    Shape (n,) each, for rows with those distances; none for beams that look the same way in every frame. `axes`: the
    rows' rays where they are not their beams' own. What meets nothing is at 0, 0, 0; where no number names a direction,
    1 m along its ray, which would else be lost.
    """
    if beams.repeats and beams.lattice:
        return {}
    direction = beams.directions(layer, point) if axes is None else axes.direction
    origin = beams.origins_m(layer, point) if axes is None else axes.origin_m
    met = distance_m > 0.0
    xyz = direction * np.where(met, distance_m, 0.0 if beams.lattice else 1.0)[:, None]
    if origin is not None:
        xyz += np.where(met[:, None], origin, 0.0)
    columns = dict(zip("XYZ", xyz.T, strict=True))
    if not beams.repeats:
        columns["Azimuth0"] = np.full(len(distance_m), beams.first_azimuth_deg)
    return columns


def _directions(
    sensor: Sensor, beams: Beams, layer: IntArray, point: IntArray, sub_beams: int | None
) -> tuple[int, FloatArray]:
    """How many rays each beam has, and their unit vectors, those of one beam together.

    Rays are spread over the sensor's footprint; without one over the cell that reaches half-way to the neighbours.
    """
    wide, high = sensor.sub_rays if sub_beams is None else (sub_beams, sub_beams)
    if wide * high == 1:
        return 1, beams.directions(layer, point)
    footprint = any(sensor.footprint_deg)
    law, (horizontal, vertical) = (sensor.footprint, sensor.footprint_deg) if footprint else ("box", (1.0, 1.0))
    up = np.repeat(_offsets(law, vertical, high), wide)
    left = np.tile(_offsets(law, horizontal, wide), high)
    if beams.grid and not footprint:
        return len(up), beams.directions(np.add.outer(layer, up).ravel(), np.add.outer(point, left).ravel())
    angles = beams.angles_deg(layer, point)
    cells = (np.ones(1), np.ones(1)) if footprint else beams.spacing_deg(layer, point)
    elevation, azimuth = (
        np.deg2rad(angle[:, None] + cell[:, None] * offset).ravel()
        for angle, cell, offset in zip(angles, cells, (up, left), strict=True)
    )
    level = elementary.cos(elevation)
    xyz = (elementary.cos(azimuth) * level, elementary.sin(azimuth) * level, elementary.sin(elevation))
    return len(up), np.stack(xyz, axis=1)


def _offsets(law: str, width: float, count: int) -> FloatArray:
    """`box`: the middles of equal parts of the full width; `gaussian`: of equally probable parts, the width as FWHM."""
    middles = (np.arange(count) + 0.5) / count
    if law == "box":
        return np.asarray((middles - 0.5) * width)
    from scipy.special import ndtri

    return np.asarray(width / FWHM_PER_SIGMA * ndtri(middles))


def _turned(direction: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Directions turned to the left about Z."""
    cosine, sine = elementary.cos(angle_rad), elementary.sin(angle_rad)
    x, y, z = direction[:, 0], direction[:, 1], direction[:, 2]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=1)
