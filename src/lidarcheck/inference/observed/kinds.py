"""What light the other echoes are of: a bright target's bloom, a ghost, the air before a surface, what lies behind it.

An echo is paired with the pulse that the geometry of its frame has at its range, whatever any model makes of it. Echoes
of one kind and place are compared with each other: a bloom above a sign says nothing of one below it.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import SIDES, BeamTable
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.observed.strata import OFFSET_EDGES, RANGE_EDGES_M, range_bin

__all__ = ["BLOOM_CELLS", "CELLS", "KINDS", "cells_of", "features_of", "kind_of_cell"]

KINDS = ("bloom", "ghost", "air", "behind")
_GHOST = (1.9, 2.15)
"""A ghost lies at about twice its surface's range."""
BLOOM_CELLS, _RANGES = len(SIDES) * len(OFFSET_EDGES), len(RANGE_EDGES_M)
"""The first cells are of blooms, by side and offset."""
_FIRST = (0, BLOOM_CELLS, BLOOM_CELLS + 1, BLOOM_CELLS + 1 + _RANGES)
CELLS = _FIRST[-1] + _RANGES
"""Blooms by side and offset of their target, ghosts, and the rest by range."""


def cells_of(beams: BeamTable, observations: Observations) -> IndexArray:
    """The cell of each other echo, shape (m,), from 0; -1 for a neighbour's surface in the place of the beam's own."""
    beam, range_m, own = observations.extra_beam, observations.extra_m, beams.distance_m[observations.extra_beam]
    before = (own == 0.0) | (range_m < own)
    cell = np.where(before, _FIRST[2], _FIRST[3]) + range_bin(range_m)
    times = range_m / np.maximum(own, 1e-9)
    cell = np.where((own > 0.0) & (times > _GHOST[0]) & (times < _GHOST[1]), _FIRST[1], cell)
    bright, bright_m = beams.bright[beam], beams.bright_m[beam]
    near = (bright > 0) & (np.abs(range_m[:, None] - bright_m) < beams.view.match_m)
    # Of several targets at that range the one that is fewest beams off.
    side = np.where(near, bright, np.iinfo(np.int64).max).argmin(axis=1)
    offset = np.searchsorted(np.asarray(OFFSET_EDGES), bright[np.arange(len(beam)), side], side="right") - 1
    cell = np.where(near.any(axis=1), side * len(OFFSET_EDGES) + offset, cell)
    return np.where((observations.extra_side < 0) | observations.detected[beam], cell, -1)


def kind_of_cell() -> IndexArray:
    """The place in `KINDS` of each cell, shape (CELLS,)."""
    return np.asarray(np.searchsorted(np.asarray(_FIRST), np.arange(CELLS), side="right") - 1)


def features_of(observations: Observations) -> FloatArray:
    """ln AREA, ln PEAK and WIDTH [ns] of each other echo, shape (m, 3)."""
    return np.column_stack([observations.extra_area, observations.extra_peak, observations.extra_width])
