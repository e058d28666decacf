"""What the beams of several frames meet, in one table: the covariates over which residuals are looked at."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.inference.observed.echo_view import EchoView
from lidarcheck.kpi.fired import at_marked_edges
from lidarcheck.model.estimates import is_estimate, row_keys
from lidarcheck.model.light import surface_signal
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams

__all__ = ["SIDES", "BeamTable", "beams_of", "bright_offsets"]


_BEAM = ("layer", "point")
SIDES = ("above", "below", "left", "right")
"""The neighbours of a beam, in the order of `BeamTable.neighbour_m`."""

_CREASE_DEG = 3.0
_SMOOTH = 0.06
"""Neighbours whose ranges differ by less than this part of the range lie on one surface, and give its slope."""
_STEEP = 0.15
"""A surface seen at a grazing angle may lie farther by such a part of its range one beam on."""
_MANY_ROWS = 5
"""From so many rows on a beam is sampled by them; fewer are the two or three surfaces that it meets."""
_APART_M, _APART = 1.0, 0.06
"""Surfaces this much apart, or by this part of the range, are not one."""


@dataclass(frozen=True)
class BeamTable:
    """The beams of all frames, ordered by (frame, layer, point); columns of shape (n,) unless said otherwise.

    `key`: ascending, one number a beam. `distance_m`: the nearest surface, 0 where the beam meets nothing.
    `signal`: S of that surface without effects. `neighbour_m` (n, 4): what the fired beams beside it meet, in the
    order of `SIDES`, 0 for nothing and -1 where none was fired. `step_m` (n,): the largest difference to a neighbour's
    range on what may be one surface, and `neighbour_step_m` (n, 4) that of each neighbour. `slope_m_per_deg` (n, 2):
    change of the range with elevation and azimuth on the beam's own surface, 0 at edges. `crease`: a neighbour at
    nearly the same range meets another material or a surface of another slope, so that a pose a little off changes
    which one the beam meets.
    `bright` (n, 4): beams to the next bright surface on each side, 0 where there is none, and `bright_m` (n, 4) its
    range. `estimate` (n,): beams of one number were estimated together, in several frames, and are off alike.
    `hit_beam`, `hit_m` (m,): all surfaces, ascending in (beam, range): a beam's several rows each, or what many of them
    sample as one.
    `range_offset_m` (n,): what a reported range is longer than the way; `view`: what is looked at of the echoes;
    `sensor`: the sensor's beams, of the first frame; `whole`: whether no beam of the ideal scans is left out.
    """

    key: IndexArray
    frame: IndexArray
    layer: IndexArray
    point: IndexArray
    distance_m: FloatArray
    material_id: IndexArray
    incidence_deg: FloatArray
    object_id: IndexArray
    signal: FloatArray
    retro: npt.NDArray[np.bool_]
    neighbour_m: FloatArray
    step_m: FloatArray
    neighbour_step_m: FloatArray
    slope_m_per_deg: FloatArray
    crease: npt.NDArray[np.bool_]
    bright: IndexArray
    bright_m: FloatArray
    estimate: IndexArray
    hit_beam: IndexArray
    hit_m: FloatArray
    range_offset_m: FloatArray
    view: EchoView
    sensor: Beams
    whole: bool = True

    def __len__(self) -> int:
        return len(self.key)

    def without(self, left_out: BoolArray) -> BeamTable:
        """The other beams, (n,); what stands beside a beam stays known where that is left out."""
        keep = ~left_out
        place, hits = np.cumsum(keep) - 1, keep[self.hit_beam]
        others = ("hit_beam", "hit_m", "view", "sensor", "whole")
        columns = {f.name: getattr(self, f.name)[keep] for f in fields(self) if f.name not in others}
        return BeamTable(
            **columns,
            hit_beam=place[self.hit_beam[hits]],
            hit_m=self.hit_m[hits],
            view=self.view,
            sensor=self.sensor,
            whole=False,
        )

    def echoes_of(self, scans: Sequence[Scan]) -> tuple[Sequence[Scan], IndexArray]:
        """The echoes of the table's beams in the scans of its frames, and the beam of each, one scan after the other;
        every echo's beam must be in the table, or have been left out."""
        frame = np.repeat(np.arange(len(scans)), [len(scan) for scan in scans])
        layer, point = (np.concatenate([np.asarray(getattr(scan, name)) for scan in scans]) for name in _BEAM)
        key = key_of(frame, layer, point)
        beam = np.searchsorted(self.key, key)
        if self.whole:
            return scans, beam
        there = self.key[np.minimum(beam, len(self) - 1)] == key
        return [scan.take(there[frame == i]) for i, scan in enumerate(scans)], beam[there]

    def apart_m(self, distance_m: FloatArray) -> FloatArray:
        """From which distance [m] on another surface lies apart from those at these, same shape."""
        return np.maximum(_APART_M * self.view.length_scale, _APART * distance_m)

    @functools.cached_property
    def column(self) -> IndexArray:
        """The point column of each beam, counted through all frames from 0, shape (n,): what is swept at one moment."""
        most = int(self.point.max(initial=0)) + 1
        return np.asarray(np.unique(self.frame * most + self.point, return_inverse=True)[1])


def key_of(frame: npt.ArrayLike, layer: npt.ArrayLike, point: npt.ArrayLike) -> IndexArray:
    """One number for each (frame, layer, point), ascending in that order."""
    f, a, b = (np.asarray(x, dtype=np.int64) for x in (frame, layer, point))
    return np.asarray((f << 40) + (a << 20) + b)


def beams_of(ideals: Sequence[IdealScan], model: Model) -> BeamTable:
    """The beams of some frames, numbered as they stand in `ideals`; without those that are marked there as beams that
    meet, or may meet, two surfaces."""
    frames = np.concatenate([np.full(len(ideal), i) for i, ideal in enumerate(ideals)])
    layer, point, distance, material, incidence = (
        np.concatenate([np.asarray(getattr(ideal, name)) for ideal in ideals])
        for name in ("layer", "point", "distance_m", "material_id", "incidence_deg")
    )
    objects = np.concatenate(
        [np.zeros(len(i), np.int64) - 1 if i.object_id is None else i.object_id.astype(np.int64) for i in ideals]
    )
    signal = np.concatenate([surface_signal(ideal, model) for ideal in ideals])
    rows_key = key_of(frames, layer, point)
    # Misses sort behind the surfaces of their beam, so that a beam's first row is its nearest surface.
    order = np.lexsort((np.where(distance > 0.0, distance, np.inf), rows_key))
    key, first, beam = np.unique(rows_key[order], return_index=True, return_inverse=True)
    row = order[first]
    hit = distance[order] > 0.0
    retros = [i for i, entry in model.materials.items() if entry.kind == "retro"]
    shape = _shape(frames[row], layer[row].astype(np.int64), point[row].astype(np.int64), ideals[0].beams)
    at_edges = _at_edges(ideals, key, rows_key)
    neighbour, step, slope, crease = _neighbours(shape, distance[row], incidence[row], material[row])
    bright, bright_m = bright_offsets(shape, signal[row], distance[row], model.sensor.bright_signal)
    view = EchoView.of(model.sensor)
    hit_beam, hit_m = _surfaces(beam[hit], distance[order][hit], signal[order][hit], view.reach_m)
    found = BeamTable(
        key=key,
        frame=frames[row],
        layer=layer[row].astype(np.int64),
        point=point[row].astype(np.int64),
        distance_m=distance[row],
        material_id=np.where(distance[row] > 0.0, material[row], -1).astype(np.int64),
        incidence_deg=incidence[row],
        object_id=objects[row],
        signal=signal[row],
        retro=np.isin(material[row], retros) & (distance[row] > 0.0),
        neighbour_m=neighbour,
        step_m=step[0],
        neighbour_step_m=step[1],
        slope_m_per_deg=slope,
        crease=crease,
        bright=bright,
        bright_m=bright_m,
        estimate=_together(ideals, row),
        hit_beam=hit_beam,
        hit_m=hit_m,
        range_offset_m=np.zeros(len(row)) + ideals[0].beams.range_offset_m(layer[row]),
        view=view,
        sensor=ideals[0].beams,
    )
    return found.without(at_edges) if at_edges.any() else found


def _surfaces(
    beam: IndexArray, range_m: FloatArray, signal: FloatArray, reach_m: float
) -> tuple[IndexArray, FloatArray]:
    """The surfaces of rows that ascend in (beam, range), shapes (m,): beam and range of each.

    Of a wide beam that many rays sample, those that lie nearer to the next than a pulse tells apart are one surface, in
    the middle of their light: an echo that is off would else lie on the surface of another of its rays.
    """
    many = np.bincount(beam)[beam] >= _MANY_ROWS if len(beam) else np.zeros(0, dtype=bool)
    starts = np.append(True, (np.diff(beam) != 0) | (np.diff(range_m) > reach_m) | ~many[1:])[: len(beam)]
    if starts.all():
        return beam, range_m
    number = np.cumsum(starts) - 1
    weight = np.maximum(signal, 1e-12 * max(float(signal.max()), 1e-300))
    middle = np.bincount(number, weight * range_m) / np.bincount(number, weight)
    return beam[starts], np.asarray(middle)


def _at_edges(ideals: Sequence[IdealScan], key: IndexArray, rows_key: IndexArray) -> BoolArray:
    """The beams `key` (n,) of which a row is marked as one that meets two surfaces; `rows_key`: of all rows."""
    marked = [at_marked_edges(ideal) for ideal in ideals]
    rows = [np.zeros(len(ideal), dtype=bool) if one is None else one for ideal, one in zip(ideals, marked, strict=True)]
    return np.isin(key, rows_key[np.concatenate(rows)])


def _together(ideals: Sequence[IdealScan], row: IndexArray) -> IndexArray:
    """A number for each beam, by its first row (n,): the same for beams whose errors are drawn together."""
    if not any(is_estimate(ideal) for ideal in ideals):
        return np.arange(len(row))
    key = np.concatenate([row_keys(ideal) for ideal in ideals])[row]
    return np.asarray(np.unique(key, return_inverse=True)[1]).ravel()


@dataclass(frozen=True)
class _Shape:
    """The image of fired beams: the beam at each place, -1 for none, and the place of each beam.

    Rows go up by elevation, columns to the left by azimuth: `layers`, `points` count them as the sensor has them, and
    `elevation_deg`, `azimuth_deg` are the angles from each row, or column, to the one beside it.
    """

    grid: IndexArray
    place: tuple[IndexArray, IndexArray, IndexArray]
    layers: IndexArray
    points: IndexArray
    elevation_deg: FloatArray
    azimuth_deg: FloatArray


def _shape(frame: IndexArray, layer: IndexArray, point: IndexArray, beams: Beams) -> _Shape:
    """The image in which what stands together lies together; without a lattice each beam is alone in its row."""
    first = np.zeros(beams.layers, dtype=np.int64)
    rank = np.empty(beams.layers, dtype=np.int64)
    rank[np.argsort(beams.angles_deg(np.arange(beams.layers), first)[0], kind="stable")] = np.arange(beams.layers)
    image = beams.image_column(layer, point).astype(np.int64)
    image = image if _leftward(beams) else beams.points - 1 - image
    if not beams.lattice:
        image = image * 2  # nobody stands beside anybody
    layers, of_row, row = np.unique(rank[layer], return_index=True, return_inverse=True)
    points, of_column, column = np.unique(image, return_index=True, return_inverse=True)
    grid = np.full((int(frame.max()) + 1, len(layers), len(points)), -1, dtype=np.int64)
    grid[frame, row, column] = np.arange(len(frame))
    up, aside = beams.spacing_deg(layer, point)
    steps = _step(layers) * up[of_row], _step(points) * aside[of_column]
    return _Shape(grid, (frame, row, column), layers, points, *steps)


def _leftward(beams: Beams) -> bool:
    """Whether azimuth goes up with the point."""
    if beams.points < 2:
        return True
    azimuth = beams.angles_deg(np.zeros(2, dtype=np.int64), np.arange(2))[1]
    return bool(np.mod(azimuth[1] - azimuth[0], 360.0) < 180.0)


def _neighbours(
    shape: _Shape, distance: FloatArray, incidence: FloatArray, material: IndexArray
) -> tuple[FloatArray, tuple[FloatArray, FloatArray], FloatArray, npt.NDArray[np.bool_]]:
    """The ranges beside each beam (n, 4), the steps of range on its own surface (n,) and on those beside it (n, 4), the
    slope of its surface (n, 2), and whether it is at a crease (n,)."""
    n = len(distance)
    ranges = np.full((n, 4), -1.0)
    beside = np.full((n, 4), -1, dtype=np.int64)
    creases = np.zeros((n, 4), dtype=bool)
    padded = np.pad(shape.grid, ((0, 0), (1, 1), (1, 1)), constant_values=-1)
    f, r, c = shape.place
    for side, (dr, dc) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        index = padded[f, r + 1 + dr, c + 1 + dc]
        beside[:, side] = index
        ranges[:, side] = np.where(index >= 0, distance[index], -1.0)
        close = (ranges[:, side] > 0.0) & (np.abs(ranges[:, side] - distance) < _SMOOTH * distance)
        other = (np.abs(incidence[index] - incidence) > _CREASE_DEG) | (material[index] != material)
        creases[:, side] = close & other
    crease = np.asarray(creases.any(axis=1))
    apart = np.abs(ranges - distance[:, None])
    own_step = np.where((ranges > 0.0) & (apart < _STEEP * distance[:, None]), apart, 0.0).max(axis=1, initial=0.0)
    slope = np.zeros((n, 2))
    steps = shape.elevation_deg[r], shape.azimuth_deg[c]
    for axis, (plus, minus) in enumerate(((0, 1), (2, 3))):
        near = (np.abs(ranges[:, [plus, minus]] - distance[:, None]) < _SMOOTH * distance[:, None]).all(axis=1)
        smooth = near & (distance > 0.0) & ~crease
        slope[smooth, axis] = (ranges[smooth, plus] - ranges[smooth, minus]) / (2.0 * steps[axis][smooth])
    return ranges, (own_step, np.where(beside >= 0, own_step[beside], 0.0)), slope, crease


def _step(lines: IndexArray) -> FloatArray:
    """Mean distance of each line from the two beside it, in lines of the sensor; shape (n,)."""
    if len(lines) < 2:
        return np.ones(len(lines))
    gap = np.diff(lines).astype(np.float64)
    return np.asarray(0.5 * (np.append(gap, gap[-1]) + np.insert(gap, 0, gap[0])))


def bright_offsets(
    shape: _Shape, signal: FloatArray, distance: FloatArray, bright_signal: float
) -> tuple[IndexArray, FloatArray]:
    """Lines to the next bright beam on each of the four `SIDES` (0: none) and that beam's range, shapes (n, 4)."""
    grid = shape.grid
    there = grid >= 0
    bright = np.zeros(grid.shape, dtype=bool)
    bright[there] = signal[grid[there]] >= bright_signal
    range_m = np.zeros(grid.shape)
    range_m[there] = distance[grid[there]]
    lines = (shape.layers, shape.layers, shape.points, shape.points)
    offsets, ranges = np.zeros((len(signal), 4), dtype=np.int64), np.zeros((len(signal), 4))
    for side, (axis, forward) in enumerate(((1, True), (1, False), (2, True), (2, False))):
        offset, away = _next_bright(bright, range_m, lines[side], axis, forward=forward)
        offsets[:, side], ranges[:, side] = offset[shape.place], away[shape.place]
    return offsets, ranges


def _next_bright(
    bright: npt.NDArray[np.bool_], range_m: FloatArray, lines: IndexArray, axis: int, *, forward: bool
) -> tuple[IndexArray, FloatArray]:
    """For each cell the next bright cell strictly beyond it along an axis: lines to it and its range; 0 for none."""
    mark, away = np.moveaxis(bright, axis, -1), np.moveaxis(range_m, axis, -1)
    if forward:
        mark, away, place = mark[..., ::-1], away[..., ::-1], lines[::-1]
    else:
        place = lines
    index = np.where(mark, np.arange(mark.shape[-1]), -1)
    last = np.maximum.accumulate(index, axis=-1)
    last = np.concatenate([np.full_like(last[..., :1], -1), last[..., :-1]], axis=-1)
    safe = np.maximum(last, 0)
    offset = np.where(last >= 0, np.abs(place[safe] - place), 0)
    ranges = np.where(last >= 0, np.take_along_axis(away, safe, axis=-1), 0.0)
    if forward:
        offset, ranges = offset[..., ::-1], ranges[..., ::-1]
    return np.moveaxis(offset, -1, axis), np.moveaxis(ranges, -1, axis)
