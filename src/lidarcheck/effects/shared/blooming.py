"""What vertical and horizontal blooming share: a linear operator that spreads bright light along lines of beams."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.base import Curve, Surroundings
from lidarcheck.scan import Light
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["HORIZONTAL", "VERTICAL", "Direction", "Side", "bloom", "curve_profile", "profile"]

Profile = Callable[[FloatArray], FloatArray]

CLUSTER_M = 0.15
"""Sources nearer to each other than a bin of 1 ns bloom as one pulse."""
CLUSTERS_PER_LINE = 24
"""A line with more distinct ranges merges over 0.3 m, 0.6 m ... until so few are left: time and memory stay bounded."""
NEGLIGIBLE = 0.1
"""Bloom of fewer avalanches, expected over all detectors of a beam, is left out: an echo needs ten."""
_CHUNK = 1024


@dataclass(frozen=True, slots=True)
class Direction:
    """Lines along which light spreads, the places on them, and the offset between neighbours in table units."""

    lines: int
    places: int
    step: float
    vertical: bool


VERTICAL = Direction(lines=POINTS, places=LAYERS, step=3.0, vertical=True)
"""Along the layers of a point column, in SPAD rows, three a layer, positive upward."""
HORIZONTAL = Direction(lines=LAYERS, places=POINTS, step=2.5, vertical=False)
"""Along the points of a layer, in columns of 0.05 deg, 2.5 a point, positive to the left."""


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
    part = y(along.step * np.arange(1.0 - along.places, along.places))
    part[along.places - 1] = 0.0  # a beam does not bloom onto itself
    if not part.any():
        return light
    beams = np.full((along.lines, along.places), -1, dtype=np.int64)
    line, place, inside = _grid(light.layer, light.point, along)
    beams[line[inside], place[inside]] = np.flatnonzero(inside)
    added = _scatter(sources, cluster, part, beams, around.sensor.signal_of(NEGLIGIBLE))
    return light.with_pulses(*added)


def _grid(
    layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32], along: Direction
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.bool_]]:
    """Line and place of beams, and whether they lie in the field of view."""
    line, place = (point, layer) if along.vertical else (layer, point)
    inside = (line >= 0) & (line < along.lines) & (place >= 0) & (place < along.places)
    return line, place, inside


def _sources(light: Light, around: Surroundings, along: Direction, bright_signal: float) -> _Sources:
    """The bright pulses of the beams' own surfaces, ordered by line and range."""
    row = light.rows()
    bright = np.flatnonzero((light.pulse_signal > 0.0) & (light.pulse_signal >= bright_signal) & (row >= 0))
    beam = np.searchsorted(light.first_pulse, bright, side="right") - 1
    of = row[bright]
    own = (around.ideal.layer[of] == light.layer[beam]) & (around.ideal.point[of] == light.point[beam])
    line, place, inside = _grid(light.layer[beam], light.point[beam], along)
    keep = np.flatnonzero(own & inside)
    range_m = light.pulse_range_m[bright]
    keep = keep[np.lexsort((range_m[keep], line[keep]))]
    return _Sources(
        line[keep].astype(np.int64),
        place[keep].astype(np.int64),
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
