"""What vertical and horizontal blooming share: a linear operator that spreads bright light along lines of beams."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.effects.base import Curve, Surroundings
from lidarcheck.scan import Light
from lidarcheck.sensor import Beams, Sensor, SpadArray
from lidarcheck.sensor.channels import ChannelBeams
from lidarcheck.sensor.grid import GridBeams

__all__ = ["Direction", "Side", "bloom", "curve_profile", "profile"]

Profile = Callable[[FloatArray], FloatArray]

CLUSTER_M = 0.15
"""Sources nearer to each other than a bin of 1 ns bloom as one pulse."""
CLUSTERS_PER_LINE = 24
"""A line with more distinct ranges merges over 0.3 m, 0.6 m ... until so few are left: time and memory stay bounded."""
NEGLIGIBLE = 0.1
"""Bloom of fewer avalanches, expected over all detectors of a beam, is left out: an echo needs ten."""
_LEAST = 1e-300
_COLUMN_DEG = 0.05
_CHUNK = 1024


@dataclass(frozen=True)
class Direction:
    """Lines along which light spreads: layers, or columns of the image, and the places on them, upward or to the left.

    `step`: the offset between neighbours in the table's unit: SPAD rows and columns of 0.05 deg of a SPAD array, layers
    and points of any other detector. `up` (layers,): the layers' places on a column, by elevation. `leftward`: whether
    points lead to the left. `around`: whether the last place lies beside the first.
    """

    beams: Beams
    vertical: bool
    step: float
    up: IndexArray
    leftward: bool
    around: bool

    @classmethod
    def of(cls, sensor: Sensor, beams: Beams, *, vertical: bool) -> Direction:
        """Along the layers of an image column, or along the points of a layer."""
        step = 1.0
        counted = sensor.nominal
        if isinstance(counted, SpadArray):
            step = float(counted.rows) if vertical else float(beams.spacing_deg(0, 0)[1]) / _COLUMN_DEG
        up = np.empty(beams.layers, dtype=np.int64)
        up[np.argsort(beams.angles_deg(np.arange(beams.layers), 0)[0], kind="stable")] = np.arange(beams.layers)
        azimuth = np.atleast_1d(beams.angles_deg(0, np.arange(min(beams.points, 2)))[1])
        leftward = not np.mod(azimuth[-1] - azimuth[0], 360.0) > 180.0
        return cls(beams, vertical, step, up, leftward, not vertical and _goes_round(beams))

    @property
    def lines(self) -> int:
        """Number of lines."""
        return self.beams.points if self.vertical else self.beams.layers

    @property
    def places(self) -> int:
        """Number of places on a line."""
        return self.beams.layers if self.vertical else self.beams.points

    def parts(self, y: Profile) -> FloatArray:
        """What a beam gets that lies 1 - places ... places - 1 further on, shape (2 places - 1,); 0 for itself."""
        apart = np.arange(1.0 - self.places, self.places)
        part = y(self.step * apart)
        if self.around:
            part = part + y(self.step * (apart - self.places)) + y(self.step * (apart + self.places))
        part[self.places - 1] = 0.0  # a beam does not bloom onto itself
        return part

    def place(self, layer: IntArray, point: IntArray) -> tuple[IndexArray, IndexArray, BoolArray]:
        """Line and place of beams, and which of them the sensor has; shape (n,) each."""
        inside = self.beams.has(layer, point)
        layer, point = np.where(inside, layer, 0), np.where(inside, point, 0)
        if self.vertical:
            return self.beams.image_column(layer, point).astype(np.int64), self.up[layer], inside
        place = point if self.leftward else self.beams.points - 1 - point
        return layer.astype(np.int64), place.astype(np.int64), inside


def _goes_round(beams: Beams) -> bool:
    """Whether the points of a layer go once around and come back every frame."""
    if isinstance(beams, GridBeams):
        return beams.azimuth.turns
    whole = 360.0 - 0.5 * abs(beams.step_deg) if isinstance(beams, ChannelBeams) else 0.0
    return isinstance(beams, ChannelBeams) and beams.repeats and abs(beams.span_deg) > whole


class Side(NamedTuple):
    """The profile on one side of a bright beam: heights of core and skirt, and the width of the skirt."""

    core: float
    skirt: float
    skirt_width: float


class _Sources(NamedTuple):
    """Bright pulses, ordered by (line, range), and the cluster of each; shape (n,)."""

    line: IndexArray
    place: IndexArray
    range_m: FloatArray
    signal: FloatArray
    row: npt.NDArray[np.int32]


def profile(plus: Side, minus: Side, core_width: float, skirt_power: float, reach: float) -> Profile:
    """y(x) = core exp(-|x| / core_width) + skirt exp(-|x / skirt_width|^skirt_power) up to |x| = reach, 0 beyond.

    `plus` holds for positive x, `minus` for negative x.
    """

    def one(side: Side, x: FloatArray) -> FloatArray:
        off = np.abs(x)
        skirt = elementary.exp(-np.minimum(elementary.power(off / side.skirt_width, skirt_power), 700.0))
        return np.asarray(side.core * elementary.exp(-off / core_width) + side.skirt * skirt)

    def y(x: FloatArray) -> FloatArray:
        return np.where(np.abs(x) <= reach, np.where(x > 0.0, one(plus, x), one(minus, x)), 0.0)

    return y


def curve_profile(curve: Curve, *, mirrored: bool = False) -> Profile:
    """A table's y(x): linear between its rows, 0 outside; where X is repeated, the last of its rows holds at X.

    `mirrored`: a table without negative X holds for both sides.
    """
    both = mirrored and curve.x[0] >= 0.0

    def y(x: FloatArray) -> FloatArray:
        return np.asarray(np.interp(np.abs(x) if both else x, curve.x, curve.y, left=0.0, right=0.0))

    return y


def bloom(light: Light, around: Surroundings, along: Direction, y: Profile, bright_signal: float) -> Light:
    """The light and what its bright pulses scatter along their lines; the same object where nothing is added.

    A pulse of S >= `bright_signal` from the beam's own surface adds S y(x) at its own range to the beam x table units
    further on. Light that came from another beam does not scatter again: a table is measured with that in it, and the
    vertical and the horizontal one are two cuts through one operator, not two that act one after the other.
    """
    sources = _sources(light, around, along, bright_signal)
    if not len(sources.line):
        return light
    cluster = _clusters(sources.line, sources.range_m)
    part = along.parts(y)
    if not part.any():
        return light
    beams = np.full((along.lines, along.places), -1, dtype=np.int64)
    line, place, inside = along.place(light.layer, light.point)
    beams[line[inside], place[inside]] = np.flatnonzero(inside)
    least = max(around.sensor.signal_of(NEGLIGIBLE), _LEAST)
    return light.with_pulses(*_scatter(sources, cluster, part, beams, least))


def _sources(light: Light, around: Surroundings, along: Direction, bright_signal: float) -> _Sources:
    """The bright pulses of the beams' own surfaces, ordered by line and range."""
    row = light.rows()
    bright = np.flatnonzero((light.pulse_signal > 0.0) & (light.pulse_signal >= bright_signal) & (row >= 0))
    beam = np.searchsorted(light.first_pulse, bright, side="right") - 1
    of = row[bright]
    own = (around.ideal.layer[of] == light.layer[beam]) & (around.ideal.point[of] == light.point[beam])
    line, place, inside = along.place(light.layer[beam], light.point[beam])
    keep = np.flatnonzero(own & inside)
    range_m = light.pulse_range_m[bright]
    keep = keep[np.lexsort((range_m[keep], line[keep]))]
    return _Sources(
        line[keep],
        place[keep],
        range_m[keep],
        light.pulse_signal[bright[keep]],
        of[keep],
    )


def _clusters(line: IndexArray, range_m: FloatArray) -> IndexArray:
    """The cluster of each source, from 0, in order; sources are ordered by (line, range).

    A run of sources without a gap wider than the merging distance is cut into pieces of that length.
    """
    first_of_line = np.concatenate([[True], line[1:] != line[:-1]])
    which = np.cumsum(first_of_line) - 1
    width = np.full(int(which[-1]) + 1, CLUSTER_M)
    step = np.diff(range_m, prepend=range_m[0])
    while True:
        wide = width[which]
        run = first_of_line | (step > wide)
        start = range_m[np.flatnonzero(run)][np.cumsum(run) - 1]
        piece = np.floor((range_m - start) / wide)
        new = run | (np.diff(piece, prepend=piece[0]) != 0.0)
        crowded = np.bincount(which, weights=new) > CLUSTERS_PER_LINE
        if not crowded.any():
            return np.asarray(np.cumsum(new) - 1, dtype=np.int64)
        width = np.where(crowded, 2.0 * width, width)


def _scatter(
    sources: _Sources, cluster: IndexArray, part: FloatArray, beams: IndexArray, least: float
) -> tuple[IndexArray, FloatArray, FloatArray, npt.NDArray[np.int32]]:
    """Beam, range, S and row of each pulse that the clusters add, those of S < `least` left out.

    `part` (2 places - 1,): of a source's S, what a beam gets that lies 1 - places ... places - 1 further on.
    """
    first = np.flatnonzero(np.diff(cluster, prepend=-1))
    line, near_m = sources.line[first], sources.range_m[first]
    row = sources.row[np.lexsort((-sources.signal, cluster))[first]]
    # Clusters of like rank, and so often of like places, go together: then most of the operator's columns are empty.
    rank = np.arange(len(first)) - np.searchsorted(line, line)
    order = np.argsort(rank, kind="stable")
    turn = np.empty_like(order)
    turn[order] = np.arange(len(order))
    by_turn = np.argsort(turn[cluster], kind="stable")
    bounds = np.searchsorted(turn[cluster][by_turn], np.arange(0, len(order) + _CHUNK, _CHUNK))
    parts = []
    for chunk, (start, stop) in enumerate(itertools.pairwise(bounds)):
        members, ones = order[chunk * _CHUNK : (chunk + 1) * _CHUNK], by_turn[start:stop]
        signal, excess = _spread(sources, near_m[cluster[ones]], ones, turn[cluster[ones]] - chunk * _CHUNK, part)
        which, place = np.nonzero((signal[: len(members)] >= least) & (beams[line[members]] >= 0))
        of, s = members[which], signal[which, place]
        parts.append((beams[line[of], place], near_m[of] + excess[which, place] / s, s, row[of]))
    beam, range_m, total, rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    return beam, range_m, total, rows


def _spread(
    sources: _Sources, near_m: FloatArray, ones: IndexArray, slot: IndexArray, part: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """For each cluster of a chunk the sums, at every place, of y S and of y S (R - the cluster's nearest R)."""
    used, column = np.unique(sources.place[ones], return_inverse=True)
    shape = (int(slot.max()) + 1, len(used))
    at = slot * len(used) + column
    signal = sources.signal[ones]
    grids = [
        np.bincount(at, weights=weights, minlength=shape[0] * shape[1]).reshape(shape)
        for weights in (signal, signal * (sources.range_m[ones] - near_m))
    ]
    places = (len(part) + 1) // 2
    across = part[places - 1 - used[:, None] + np.arange(places)]
    return elementary.product(grids[0], across), elementary.product(grids[1], across)
