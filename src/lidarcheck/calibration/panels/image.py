"""A scene as the beams see it: one range a beam, from an ideal scan or from merged frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.calibration.echoes import amplitude, place_of, ways
from lidarcheck.errors import InputError
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams, Sensor

__all__ = ["BeamImage", "StrongestEchoes", "echoes_of", "image_of_frames", "image_of_ideal", "strongest"]

MOST_BEAMS = 8_000_000
OF_BEAM_DEG = 0.03
SEEN_SHARE = 0.1
SPLIT_M = 2.0
"""A saturated echo may split into two, a dead time apart: 12 ns are 1.8 m."""


@dataclass(frozen=True)
class BeamImage:
    """What each beam meets, in rows and columns as the beams stand.

    `range_m` (rows, columns): NaN where nothing was met. `beam`: which beam stands there, layer times `points` plus
    point. `key`: what the ideal scan says the surface is, object and
    material; all 0 where there is none. `material`: its number, -1 where not known. `log_area`: logarithm of the
    amplitude, NaN where not known. `fired`: the beams that there are. `direction` (rows, columns, 3): unit vectors.
    `layer_step_rad`, `point_step_rad`: the angles between neighbours. `ideal`: free of noise.
    """

    range_m: FloatArray
    key: IndexArray
    material: IndexArray
    log_area: FloatArray
    fired: BoolArray
    direction: FloatArray
    layer_step_rad: float
    point_step_rad: float
    ideal: bool
    beam: IndexArray
    points: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.range_m.shape[0], self.range_m.shape[1]


@dataclass(frozen=True)
class StrongestEchoes:
    """The strongest echo of each beam of a frame, shapes (n,); `direction` (n, 3) as measured, of `beams`."""

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    range_m: npt.NDArray[np.float32]
    amplitude: npt.NDArray[np.float32]
    direction: npt.NDArray[np.float32]
    beams: Beams

    @property
    def at(self) -> tuple[IntArray, IntArray]:
        """Row and column of each in the image, shapes (n,)."""
        return place_of(self.beams, self.layer, self.point)


def strongest(scan: Scan, range_m: FloatArray | None = None, sensor: Sensor | None = None) -> IndexArray:
    """Rows of the strongest echo of each known beam, ascending in (layer, point); the first where none is stronger."""
    _, strength = amplitude(scan, sensor)
    range_m = ways(scan) if range_m is None else range_m
    known = np.flatnonzero((scan.layer >= 0) & (scan.point >= 0) & (range_m > 0.0))
    key = scan.layer[known].astype(np.int64) << 32 | scan.point[known]
    order = known[np.lexsort((np.nan_to_num(-strength[known]), key))]
    beam = scan.layer[order].astype(np.int64) << 32 | scan.point[order]
    first: BoolArray = np.append(True, beam[1:] != beam[:-1])[: len(order)]
    return np.asarray(order[first], dtype=np.int64)


def echoes_of(scan: Scan, sensor: Sensor | None = None) -> StrongestEchoes:
    """The strongest echo of each beam, in single precision: so frames are held while panels are looked for.

    Its range is the mean, weighted by amplitude, of the beam's echoes within 2 m of it: a saturated echo may split.
    """
    range_m, strength = ways(scan), amplitude(scan, sensor)[1]
    rows = strongest(scan, range_m, sensor)
    layer, point, beams = scan.layer[rows], scan.point[rows], scan.beams
    xyz = np.stack([scan.x_m[rows], scan.y_m[rows], scan.z_m[rows]], axis=-1)
    origins = beams.origins_m(layer, point) if beams.has(layer, point).all() else None
    xyz = xyz if origins is None else xyz - origins
    return StrongestEchoes(
        layer,
        point,
        _rejoined(scan, rows, range_m, strength).astype(np.float32),
        strength[rows].astype(np.float32),
        (xyz / range_m[rows, None]).astype(np.float32),
        beams,
    )


def _rejoined(scan: Scan, rows: IndexArray, range_m: FloatArray, strength: FloatArray) -> FloatArray:
    """Ranges of the beams whose strongest echoes are `rows`, with their echoes close by; shape of `rows`."""
    key = scan.layer.astype(np.int64) << 32 | scan.point
    if not len(rows):
        return np.zeros(0)
    beam = np.minimum(np.searchsorted(key[rows], key), len(rows) - 1)
    close = np.abs(range_m - range_m[rows][beam]) <= SPLIT_M
    near = (key[rows][beam] == key) & close
    weight = np.where(np.isfinite(strength) & (strength > 0.0), strength, 1.0)[near]
    total = np.bincount(beam[near], weights=weight, minlength=len(rows))
    return np.bincount(beam[near], weights=weight * range_m[near], minlength=len(rows)) / np.maximum(total, 1e-300)


def image_of_ideal(ideal: IdealScan) -> BeamImage:
    """The nearest surface of each beam; sub-beams that meet something farther do not count."""
    hit = np.flatnonzero(ideal.distance_m > 0.0)
    # Descending distance: the last written, and so kept, is the nearest.
    order = hit[np.argsort(-ideal.distance_m[hit], kind="stable")]
    at = place_of(ideal.beams, ideal.layer[order], ideal.point[order])
    shape = (ideal.beams.layers, ideal.beams.points)
    range_m, fired = np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_)
    key, material = np.zeros(shape, dtype=np.int64), np.full(shape, -1, dtype=np.int64)
    fired[place_of(ideal.beams, ideal.layer, ideal.point)] = True
    range_m[at], material[at] = ideal.distance_m[order], ideal.material_id[order]
    key[at] = ideal.material_id[order]
    if ideal.object_id is not None:
        key[at] |= ideal.object_id[order].astype(np.int64) << 32
    nothing = np.full(shape, np.nan)
    beam, direction, steps = _of_beams(ideal.beams)
    return BeamImage(range_m, key, material, nothing, fired, direction, *steps, ideal=True, beam=beam, points=shape[1])


def image_of_frames(frames: Sequence[StrongestEchoes], file: str | None = None) -> BeamImage:
    """Frames of one scene merged: the median range and amplitude of each beam's strongest echoes.

    A beam that echoes in fewer than a tenth of the frames shows nothing. `InputError` names `file` where layers and
    points are no grid that can be held.
    """
    shape = _shape(frames, file)
    ranges, areas = (np.full((len(frames), *shape), np.nan, dtype=np.float32) for _ in range(2))
    for i, frame in enumerate(frames):
        rows, columns = frame.at
        ranges[i, rows, columns] = frame.range_m
        areas[i, rows, columns] = frame.amplitude
    seen = np.count_nonzero(np.isfinite(ranges), axis=0)
    enough = seen >= max(1, int(np.ceil(SEEN_SHARE * len(frames))))
    range_m = np.where(enough, _median(ranges), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        log_area = np.log(np.where(enough, _median(areas), np.nan))
    fired = np.zeros(shape, dtype=np.bool_)
    low, high = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    fired[low[0] : low[-1] + 1, high[0] : high[-1] + 1] = True
    beam, direction, steps = _directions(frames[0], shape)
    nothing: IndexArray = np.zeros(shape, dtype=np.int64)
    log_area[~np.isfinite(log_area)] = np.nan
    return BeamImage(
        range_m, nothing, nothing - 1, log_area, fired, direction, *steps, ideal=False, beam=beam, points=shape[1]
    )


def _of_beams(beams: Beams) -> tuple[IndexArray, FloatArray, tuple[float, float]]:
    """Which beam stands at each row and column, where it looks, and the angles between neighbours."""
    layer, point = beams.every()
    shape = (beams.layers, beams.points)
    beam: IndexArray = np.zeros(shape, dtype=np.int64)
    beam[place_of(beams, layer, point)] = beams.index(layer, point)
    there = [index.ravel().astype(np.int32) for index in np.divmod(beam, beams.points)]
    steps = (float(np.median(np.deg2rad(step))) for step in beams.spacing_deg(*there))
    direction = beams.directions(*there).reshape(*shape, 3)
    return beam, direction, (next(steps), next(steps))


def _shape(frames: Sequence[StrongestEchoes], file: str | None) -> tuple[int, int]:
    layers = 1 + max(int(f.layer.max(initial=-1)) for f in frames)
    points = 1 + max(int(f.point.max(initial=-1)) for f in frames)
    if layers < 2 or points < 2:
        raise InputError("no echo lies on a known beam", file=file, fix="Layer and Point say which beam an echo is of")
    beams = frames[0].beams
    if layers <= beams.layers and points <= beams.points:
        return beams.layers, beams.points
    if layers * points > MOST_BEAMS:
        raise InputError(
            f"Layer up to {layers - 1} and Point up to {points - 1} are no grid of beams",
            file=file,
            fix=f"number layers and points without gaps, {MOST_BEAMS} beams at most",
        )
    return layers, points


def _median(stack: npt.NDArray[np.float32]) -> FloatArray:
    """Median over the first axis without NaN, of an even number the lower; never between two surfaces."""
    if len(stack) == 1:
        return np.asarray(stack[0], dtype=np.float64)
    ordered = np.sort(stack, axis=0)
    middle = np.maximum(np.count_nonzero(np.isfinite(stack), axis=0) - 1, 0) // 2
    return np.asarray(np.take_along_axis(ordered, middle[None], axis=0)[0], dtype=np.float64)


def _directions(frame: StrongestEchoes, shape: tuple[int, int]) -> tuple[IndexArray, FloatArray, tuple[float, float]]:
    """As `_of_beams`, where the echoes lie on the sensor's beams.

    Else of the form azimuth(column) + offset(row), elevation(row), from the measured positions.
    """
    beams, beam = frame.beams, np.arange(shape[0] * shape[1]).reshape(shape)
    if shape == (beams.layers, beams.points):
        found = _of_beams(beams)
        off = np.linalg.norm(beams.directions(frame.layer, frame.point) - frame.direction, axis=1)
        if np.quantile(off, 0.95) <= np.deg2rad(OF_BEAM_DEG):
            return found
        beam = found[0]
    row, column = frame.at
    azimuth = np.arctan2(frame.direction[:, 1], frame.direction[:, 0]).astype(np.float64)
    elevation = np.arcsin(np.clip(frame.direction[:, 2], -1.0, 1.0)).astype(np.float64)
    offset = np.zeros(shape[0])
    for _ in range(2):
        of_column = _circular(azimuth - offset[row], column, shape[1])
        offset = _circular(azimuth - of_column[column], row, shape[0])
    count = np.bincount(row, minlength=shape[0])
    some = np.flatnonzero(count)
    mean = np.bincount(row, weights=elevation, minlength=shape[0])[some] / count[some]
    of_row = np.interp(np.arange(shape[0]), some, mean)
    a, e = of_column[None, :] + offset[:, None], np.broadcast_to(of_row[:, None], shape)
    steps = tuple(max(float(np.median(np.abs(np.diff(x)))), 1e-5) for x in (of_row, of_column))
    direction = np.stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)], axis=-1)
    return beam, direction, (steps[0], steps[1])


def _circular(angle_rad: FloatArray, index: IntArray, length: int) -> FloatArray:
    """Mean angle of each index, interpolated where there is none; shape (length,)."""
    east = np.bincount(index, weights=np.cos(angle_rad), minlength=length)
    north = np.bincount(index, weights=np.sin(angle_rad), minlength=length)
    some = np.flatnonzero(np.hypot(east, north) > 1e-9)
    return np.interp(np.arange(length), some, np.unwrap(np.arctan2(north[some], east[some])))
