"""From a frame's comparison to its tallies: which rows a KPI rests on, and in which unit each lies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.kpi.blooming import Axis
from lidarcheck.kpi.chance.tallies import Histogram, Sums, blocks_of
from lidarcheck.kpi.compare import RANGE_RESIDUAL, Compared
from lidarcheck.kpi.detection import Detection
from lidarcheck.kpi.features import Decades
from lidarcheck.kpi.pairing import Pairing, paths
from lidarcheck.kpi.target import Bright
from lidarcheck.scan import Scan

__all__ = ["Tallies"]

_OFFSETS = 1024
"""More layers or points than any target's bloom spans, to either side."""
Blocks = tuple[IndexArray, IndexArray]


@dataclass
class Tallies:
    """All that the frames so far hold, by what it is of; `units`: of each frame."""

    units: list[int] = field(default_factory=list)
    features: dict[str, Histogram] = field(default_factory=dict)
    counts: dict[tuple[str, str], Sums] = field(default_factory=dict)
    decades: dict[str, Histogram] = field(default_factory=dict)
    paired: Histogram = field(default_factory=Histogram)
    blooming: dict[Axis, Sums] = field(default_factory=dict)
    ghost: dict[str, Sums] = field(default_factory=dict)
    directions: dict[str, Sums] = field(default_factory=dict)
    positions: dict[str, Sums] = field(default_factory=dict)
    numbers: dict[int, Sums] = field(default_factory=dict)
    numbered: Sums = field(default_factory=Sums)
    ghost_range: Histogram = field(default_factory=Histogram)
    ghost_names: tuple[str, ...] = ()
    lattice: bool = True
    histogram: str = ""

    def add(self, found: Compared) -> None:
        """Take in a frame."""
        frame, beams = len(self.units), found.measured.beams
        numbers = [(scan.layer, scan.point) for scan in (found.measured, found.simulated)]
        if found.m is not None:
            numbers.append((found.m.layer, found.m.point))
        self.lattice = beams.lattice
        of_m, of_s, *of_beams = blocks_of(beams, *numbers)
        blocks = of_m, of_s
        units = 1 + max(int(block.max(initial=0)) for block in (*blocks, *of_beams))
        self.units.append(units)
        self._features(frame, units, blocks, found)
        if found.comparison.histogram is not None:
            self.histogram = found.comparison.histogram.of
        _sums(self.counts, ("echoes", "")).frames[frame] = _counts([*blocks], units)
        self._written(frame, units, blocks, found)
        difference = found.pairs.difference_m
        at = blocks[0][found.pairs.measured]
        self.paired.add(frame, units, (at, at), (difference, -difference))
        if found.m is not None and found.s is not None:
            self._surfaces(frame, units, blocks, of_beams[0], found, found.m, found.s)
            if found.bright is not None:
                self._target(frame, units, blocks, found, found.bright)

    def merge(self) -> None:
        """Make each frame one unit."""
        of_features = (self.features, self.counts, self.decades, self.blooming, self.ghost)
        tables = (*of_features, self.directions, self.positions, self.numbers)
        for sums in (
            *(one for table in tables for one in table.values()),
            self.paired,
            self.ghost_range,
            self.numbered,
        ):
            sums.merge()
        self.units = [1] * len(self.units)

    def echoes(self) -> FloatArray:
        """Number of echoes of both sides in each unit, shape (2, units)."""
        return self.counts["echoes", ""].all(self.units)[:, :, 0]

    def _features(self, frame: int, units: int, blocks: Blocks, found: Compared) -> None:
        for one in found.features:
            at = blocks
            if any(np.isnan(side).any() for side in one.values):
                m, s = one.values
                at = blocks[0][~np.isnan(m)], blocks[1][~np.isnan(s)]
            _histogram(self.features, one.name).add(frame, units, at, one.known)

    def _surfaces(
        self, frame: int, units: int, blocks: Blocks, beam: IndexArray, found: Compared, m: Pairing, s: Pairing
    ) -> None:
        own = [side.of_one_surface for side in (m, s)]
        residual = [side.residual_m[rows] for side, rows in zip((m, s), own, strict=True)]
        at = [block[rows] for block, rows in zip(blocks, own, strict=True)]
        _histogram(self.features, RANGE_RESIDUAL).add(frame, units, (at[0], at[1]), (residual[0], residual[1]))
        surfaces = found.comparison.surfaces
        assert surfaces is not None
        for of, counted in _range_bins(m.distance_m, surfaces.detection_measured):
            table = [_share(beam, counted & side.judged, side.detected, units) for side in (m, s)]
            _sums(self.counts, ("detection_probability", of)).frames[frame] = np.stack(table)
        table = []
        for block, side in zip(blocks, (m, s), strict=True):
            away = np.bincount(block[~side.on_surface & side.judged[side.echo_beam]], minlength=units)
            table.append(np.stack([away, np.bincount(beam[side.judged], minlength=units)], axis=1).astype(np.float64))
        _sums(self.counts, ("false_alarms", "per beam")).frames[frame] = np.stack(table)
        if surfaces.walk is not None and found.strength is not None and found.decades is not None:
            strength = [side[rows] for side, rows in zip(found.strength, own, strict=True)]
            self._walk(frame, units, at, residual, strength, found.decades)

    def _written(self, frame: int, units: int, blocks: Blocks, found: Compared) -> None:
        """Sums of directions, of their squares, and of places; counts of echo numbers."""
        m, s = found.written
        if m.directions is not None and s.directions is not None:
            for angle, of in (("azimuth", 0), ("elevation", 1)):
                both = (m.directions[of], s.directions[of])
                table = [_powers(block, off, units, 2) for block, off in zip(blocks, both, strict=True)]
                self.directions.setdefault(angle, Sums()).frames[frame] = np.stack(table)
        if found.m is not None and found.s is not None and m.off_surface_m is not None and s.off_surface_m is not None:
            at = [block[side.of_one_surface] for block, side in zip(blocks, (found.m, found.s), strict=True)]
            for axis, column in zip("xyz", range(3), strict=True):
                both = (m.off_surface_m[:, column], s.off_surface_m[:, column])
                table = [_powers(block, off, units, 1) for block, off in zip(at, both, strict=True)]
                self.positions.setdefault(axis, Sums()).frames[frame] = np.stack(table)
        numbered = [
            block if side.number_rows is None else block[side.number_rows]
            for block, side in zip(blocks, found.written, strict=True)
        ]
        for number in found.comparison.numbers or ():
            hits = [block[side.numbers == number] for block, side in zip(numbered, found.written, strict=True)]
            self.numbers.setdefault(number, Sums()).frames[frame] = _counts(hits, units)
        if found.comparison.numbers is not None:
            self.numbered.frames[frame] = _counts(numbered, units)

    def _walk(
        self, frame: int, units: int, at: list[IndexArray], residual: list[FloatArray], strength: list[FloatArray],
        decades: Decades,
    ) -> None:  # fmt: skip
        decade = [decades.of(side) for side in strength]
        for d in np.unique(np.concatenate(decade)[np.isfinite(np.concatenate(decade))]).tolist():
            rows = [side == d for side in decade]
            _histogram(self.decades, decades.words(d)).add(
                frame, units, (at[0][rows[0]], at[1][rows[1]]), (residual[0][rows[0]], residual[1][rows[1]])
            )

    def _target(self, frame: int, units: int, blocks: Blocks, found: Compared, bright: Bright) -> None:
        scans = (found.measured, found.simulated)
        self.ghost_names = bright.ratios
        for axis in ("vertical", "horizontal"):
            per_side = [
                _by_offset(block[rows], offset, strength[rows], units)
                for block, (rows, offset), strength in zip(blocks, bright.beside[axis], bright.strength, strict=True)
            ]
            self.blooming.setdefault(axis, Sums()).frames[frame] = np.stack(per_side)
        parts = bright.ghosts
        for name, which in (("target", 0), ("ghost", 1)):
            moments = [
                _moments(scan, strength, peak, block, part[which], units)
                for scan, strength, peak, block, part in zip(
                    scans, bright.strength, bright.peak, blocks, parts, strict=True
                )
            ]
            self.ghost.setdefault(name, Sums()).frames[frame] = np.stack(moments)
        ways = [scan.range_m if scan.beams.central else paths(scan) for scan in scans]
        ratio = [way[g] / way[t[p]] for way, (t, g, p) in zip(ways, parts, strict=True)]
        at = [block[part[1]] for block, part in zip(blocks, parts, strict=True)]
        self.ghost_range.add(frame, units, (at[0], at[1]), (ratio[0], ratio[1]))


def _counts(blocks: list[IndexArray], units: int) -> FloatArray:
    """How many rows of each side lie in each unit, shape (2, units, 1)."""
    return np.stack([np.bincount(block, minlength=units).astype(np.float64) for block in blocks])[:, :, None]


def _histogram(table: dict[str, Histogram], name: str) -> Histogram:
    return table.setdefault(name, Histogram())


def _sums(table: dict[tuple[str, str], Sums], key: tuple[str, str]) -> Sums:
    return table.setdefault(key, Sums())


def _share(beam: IndexArray, counted: BoolArray, hit: BoolArray, units: int) -> FloatArray:
    """Of the beams that count those that are hit, and all, in each unit, shape (units, 2)."""
    counts = [np.bincount(beam[which], minlength=units) for which in (counted & hit, counted)]
    return np.stack(counts, axis=1).astype(np.float64)


def _range_bins(distance_m: FloatArray, detection: Detection) -> Iterator[tuple[str, BoolArray]]:
    """The beams of each line of `detection_probability`, by what the line is of."""
    edges = detection.edges_m
    yield "all", distance_m > 0.0
    for i in np.flatnonzero(detection.beams).tolist():
        inside = (distance_m > 0.0) & (distance_m >= edges[i]) & (distance_m < edges[i + 1])
        yield f"{edges[i]:g}–{edges[i + 1]:g} m", inside


def _powers(block: IndexArray, values: FloatArray, units: int, highest: int) -> FloatArray:
    """Number of the values that are known, and the sums of their powers up to `highest`, (units, 1 + highest)."""
    known = ~np.isnan(values)
    if not known.all():
        block, values = block[known], values[known]
    sums = np.zeros((units, 1 + highest))
    sums[:, 0] = np.bincount(block, minlength=units)
    if values.any():  # directions of a simulation are all 0
        for power in range(1, 1 + highest):
            sums[:, power] = np.bincount(block, weights=values**power, minlength=units)
    return sums


def _by_offset(block: IndexArray, steps: FloatArray, strength: FloatArray, units: int) -> FloatArray:
    """Number of echoes and their strength by offset, shape (units, offsets, 2)."""
    size = 2 * _OFFSETS + 1
    key = block * size + np.clip(np.rint(steps), -_OFFSETS, _OFFSETS).astype(np.int64) + _OFFSETS
    counts = [np.bincount(key, weights=weight, minlength=units * size) for weight in (np.ones(len(key)), strength)]
    return np.stack(counts, axis=1).reshape(units, size, 2).astype(np.float64)


def _moments(
    scan: Scan, strength: FloatArray, peak: FloatArray, block: IndexArray, rows: IndexArray, units: int
) -> FloatArray:
    """Number of the rows, and sums of their strength, PEAK, x, y, z and r², shape (units, 7)."""
    xyz = [column[rows] for column in (scan.x_m, scan.y_m, scan.z_m)]
    columns = [np.ones(len(rows)), strength[rows], peak[rows], *xyz, sum(c**2 for c in xyz)]
    return np.stack([np.bincount(block[rows], weights=column, minlength=units) for column in columns], axis=1)
