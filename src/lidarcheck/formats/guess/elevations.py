"""The elevations that a scan's rows lie at: a median for each ring; without rings, where rows stand densest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.formats.assign.rings import medians

__all__ = ["FEWEST_ROWS", "MOST_SPREAD", "Rings", "clusters", "rings_of", "sound"]

FEWEST_ROWS = 50
"""Of fewer rows a ring's elevation is not said."""
MOST_SPREAD = 0.1
"""A ring spreads by no more than this part of the spacing, or it is none."""
_ALONE_DEG = 1.0
"""What counts as the spacing of a ring without another."""
_WIDTHS_DEG = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Bins in which dense elevations are looked for; the widest that separates most of them counts."""
_VALLEY = 0.2
"""Two peaks are two where the bins between them fall to this part of the lower one."""
_OF_ALL = 0.9
"""Share of the rows that must lie in rings, or the elevations show none."""


@dataclass(frozen=True)
class Rings:
    """Rings, a value each: their number, elevation [deg], spread (the median distance from it), and how many rows."""

    number: npt.NDArray[np.int64]
    elevation_deg: FloatArray
    spread_deg: FloatArray
    rows: npt.NDArray[np.int64]

    @property
    def spacing_deg(self) -> FloatArray:
        """To the nearest other ring [deg]."""
        if len(self.number) < 2:
            return np.full(len(self.number), _ALONE_DEG)
        order = np.argsort(self.elevation_deg, kind="stable")
        gaps = np.diff(self.elevation_deg[order])
        near = np.empty(len(order))
        near[order] = np.minimum(np.r_[np.inf, gaps], np.r_[gaps, np.inf])
        return near

    def take(self, which: npt.NDArray[Any]) -> Rings:
        """Some of the rings."""
        return Rings(self.number[which], self.elevation_deg[which], self.spread_deg[which], self.rows[which])


def rings_of(elevation_deg: FloatArray, ring: npt.NDArray[Any]) -> Rings:
    """Median and spread of each ring's elevations; both inputs of shape (n,)."""
    number, middle = medians(elevation_deg, ring)
    place = np.searchsorted(number, ring)
    spread = medians(np.abs(elevation_deg - middle[place]), ring)[1]
    return Rings(number, middle, spread, np.bincount(place, minlength=len(number)))


def sound(rings: Rings) -> npt.NDArray[np.bool_]:
    """Which rings have rows enough and spread little beside the spacing to the others that have."""
    found = rings.rows >= FEWEST_ROWS
    near = np.full(len(found), np.inf)
    near[found] = rings.take(found).spacing_deg
    return np.asarray(found & (rings.spread_deg <= MOST_SPREAD * near))


def clusters(elevation_deg: FloatArray) -> IntArray | None:
    """The ring of each row, shape (n,), from 0 by ascending elevation, -1 for none; None where they show no rings."""
    best: IntArray | None = None
    most = 0
    for width in _WIDTHS_DEG:
        label = _peaks(elevation_deg, width)
        within = label >= 0
        if not within.any():
            continue
        rings = rings_of(elevation_deg[within], label[within])
        good = sound(rings)
        if rings.rows[good].sum() < _OF_ALL * len(label) or np.count_nonzero(good) <= most:
            continue
        most = int(np.count_nonzero(good))
        place = np.full(int(label.max()) + 2, -1, dtype=np.int32)
        place[rings.number[good]] = np.arange(most)
        best = place[label]
    return best


def _peaks(elevation_deg: FloatArray, width: float) -> IntArray:
    """The peak that each elevation belongs to: bins between the valleys of a histogram; -1 far from any."""
    low = float(elevation_deg.min()) - 2.0 * width
    cell = np.floor((elevation_deg - low) / width).astype(np.int64)
    occupied, place, counts = np.unique(cell, return_inverse=True, return_counts=True)
    # A peak that falls between two bins is in both: each cell counts with its neighbours.
    beside = np.zeros(len(occupied), dtype=np.int64)
    for shift in (-1, 0, 1):
        at = np.minimum(np.searchsorted(occupied, occupied + shift), len(occupied) - 1)
        beside += np.where(occupied[at] == occupied + shift, counts[at], 0)
    group = np.zeros(len(occupied), dtype=np.int32)
    current, top, lowest = 0, int(beside[0]), int(beside[0])
    for i in range(1, len(occupied)):
        height = int(beside[i])
        apart = occupied[i] - occupied[i - 1] > 2
        if apart or (lowest < _VALLEY * top and lowest < _VALLEY * height):
            current, top, lowest = current + 1, height, height
        top, lowest = max(top, height), height if height > top else min(lowest, height)
        group[i] = current
    return group[place]
