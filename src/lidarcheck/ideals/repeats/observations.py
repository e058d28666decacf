"""What the repeats saw of each ray: one table of echoes, ordered by ray and range, and which rays were fired."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.ideals.repeats.amplitude import Amplitudes, amplitudes_of, values_of
from lidarcheck.ideals.repeats.lattice import Rays
from lidarcheck.kpi.fired import fired_beams
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams, Feature, Sensor
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["Observations", "observed", "turned"]

_DITHER_SEED = 0x1D0
"""Ranges on a lattice are spread over their step by the same numbers each time."""


@dataclass(frozen=True)
class Observations:
    """Echoes, a row each, in order of (ray, range); columns of shape (n,).

    `path_m`: the reported range less the range offsets; `spread_m`: the same, spread evenly over its step. `frame`: of
    the frames given, from 0. `value`: of the feature that tells amplitudes, NaN where the sensor has none. `fired`
    (frames, rays); `fired_known`: whether the scans tell it. `aside`: by how many columns the rays of each frame look
    past those of the same number here, shape (frames,). `outside`: echoes on no beam of the sensor.
    """

    rays: Rays
    frames: int
    ray: IndexArray
    frame: IndexArray
    path_m: FloatArray
    spread_m: FloatArray
    value: FloatArray
    fired: BoolArray
    fired_known: bool
    aside: FloatArray
    outside: int = 0

    def amplitudes(self, feature: Feature | None, sensor: Sensor) -> Amplitudes:
        """What the values say of the amplitudes."""
        if feature is None:
            nothing = np.full(len(self.ray), np.nan)
            return Amplitudes(nothing, nothing, nothing, np.zeros(len(self.ray), dtype=np.bool_))
        return amplitudes_of(feature, self.value, self.path_m, sensor)


def observed(
    scans: Sequence[Scan], sensor: Sensor, feature: Feature | None, *, of: Beams | None = None
) -> Observations:
    """The echoes of scans of one sensor by the rays of `of`, the beams of one frame; the sensor's own where None.

    Where columns repeat, a beam's numbers are its direction: X, Y, Z have been held against it. Where they do not, the
    columns of each frame are taken for those of `of` that look the same way, within half a footprint, else half a step.
    """
    beams = sensor.beams if of is None else of
    known = [scan.beams.has(scan.layer, scan.point) for scan in scans]
    shifts = [_shift(beams, scan) for scan in scans]
    points = [
        _points_as(beams, scan, there, shift, sensor) for scan, there, shift in zip(scans, known, shifts, strict=True)
    ]
    rays = _rays(beams, [scan.layer[there] for scan, there in zip(scans, known, strict=True)], points)
    parts = []
    for number, (scan, there, point) in enumerate(zip(scans, known, points, strict=True)):
        ray = rays.index(scan.layer[there], point)
        offset = scan.beams.range_offset_m(scan.layer[there])
        path = scan.range_m[there] - offset - sensor.range_offset_m
        value = np.full(len(path), np.nan) if feature is None else values_of(feature, scan, sensor)[there]
        parts.append((ray, np.full(len(path), number, dtype=np.int64), path, np.asarray(value, dtype=np.float64)))
    ray, frame, path, value = (np.concatenate(column) for column in zip(*parts, strict=True))
    spread = path + sensor.range_resolution_m * (np.random.default_rng(_DITHER_SEED).random(len(path)) - 0.5)
    order = np.lexsort((spread, ray))
    order = order[ray[order] >= 0]
    fired, told = _fired(rays, scans, points, known, beams)
    aside = np.array([shift - round(shift) for shift in shifts])
    return Observations(
        rays, len(scans), ray[order], frame[order], path[order], spread[order], value[order], fired, told, aside,
        sum(int(np.count_nonzero(~there)) for there in known),
    )  # fmt: skip


def _shift(beams: Beams, scan: Scan) -> float:
    """By how many columns a scan's Point 0 looks past that of `beams`; 0 where columns repeat."""
    if beams.repeats or not isinstance(beams, ChannelBeams) or not isinstance(scan.beams, ChannelBeams):
        return 0.0
    return (scan.beams.phase_deg - beams.phase_deg) / beams.step_deg


def _points_as(beams: Beams, scan: Scan, there: BoolArray, shift: float, sensor: Sensor) -> IndexArray:
    """The point of each echo in the numbers of `beams`; -1 where no ray looks the same way."""
    point = scan.point[there].astype(np.int64)
    if shift == 0.0 or not isinstance(beams, ChannelBeams):
        return point
    aside_deg = abs(shift - round(shift)) * abs(beams.step_deg)
    reach_deg = 0.5 * (sensor.footprint_deg[0] or abs(beams.step_deg))
    return point + round(shift) if aside_deg <= reach_deg + 1e-9 else np.full(len(point), -1)


def _rays(beams: Beams, layers: Sequence[IntArray], points: Sequence[IndexArray]) -> Rays:
    """The block of beams in which any frame has an echo."""
    layer = np.concatenate(layers)
    point = np.concatenate(points)
    there = (point >= 0) & (point < beams.points)
    if not there.any():
        raise UsageError("the frames hold no echo on a beam of the sensor", fix="name the sensor that measured")
    low, high = layer[there].min(), layer[there].max()
    first, last = point[there].min(), point[there].max()
    return Rays(beams, int(low), int(first), int(high - low) + 1, int(last - first) + 1)


def _fired(
    rays: Rays, scans: Sequence[Scan], points: Sequence[IndexArray], known: Sequence[BoolArray], beams: Beams
) -> tuple[BoolArray, bool]:
    """Which rays were fired in which frame, shape (frames, rays), and whether the scans tell it.

    A firing column without any echo in a frame was not fired in it; one of which the file says so neither.
    """
    fired = np.zeros((len(scans), len(rays)), dtype=np.bool_)
    order = beams.sweep.order
    has = beams.has(rays.layer, rays.point)
    for number, (scan, point, there) in enumerate(zip(scans, points, known, strict=True)):
        if order == "flash":
            fired[number] = True
        elif order == "layers":
            fired[number] = np.isin(rays.layer, scan.layer[there])
        else:
            fired[number] = np.isin(rays.point, point)
        if scan.fired is not None and beams.repeats:
            fired[number] &= scan.fired.has(rays.layer, rays.point)
        fired[number] &= has
    return fired, all(fired_beams(scan) is not None for scan in scans)


def turned(seen: Observations, range_m: FloatArray) -> Observations:
    """The echoes of rays that look aside, moved to where the ray itself would meet the same surface.

    `range_m` (rays,): about what the rays meet, NaN where nobody knows; along a plane its inverse is linear.
    """
    if not seen.aside.any():
        return seen
    slope = _slope(seen.rays, range_m)[seen.ray] * seen.aside[seen.frame]
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = 1.0 / (1.0 / seen.path_m - slope) - seen.path_m
    moved = np.where(np.isfinite(moved) & (np.abs(moved) < 0.1 * seen.path_m), moved, 0.0)
    spread = seen.spread_m + moved
    order = np.lexsort((spread, seen.ray))
    return replace(
        seen, ray=seen.ray[order], frame=seen.frame[order], path_m=(seen.path_m + moved)[order],
        spread_m=spread[order], value=seen.value[order],
    )  # fmt: skip


def _slope(rays: Rays, range_m: FloatArray) -> FloatArray:
    """How the inverse range of each ray changes from column to column, (rays,); 0 where nothing is beside it."""
    own = 1.0 / np.asarray(rays.image(range_m, np.nan), dtype=np.float64)
    total, weight = np.zeros(own.shape), np.zeros(own.shape)
    for along in (-2, -1, 1, 2):
        beside = np.asarray(rays.moved(own, 0, along, np.nan), dtype=np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.abs(1.0 / beside - 1.0 / own) <= 0.1 + 0.1 / own
        total += np.where(near, along * (beside - own), 0.0)
        weight += np.where(near, along * along, 0.0)
    found = np.asarray(rays.of_image(total / np.maximum(weight, 1.0)))
    return np.nan_to_num(found)
