"""How beams stand among each other: in rows and columns, or, where they have none, one after another."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.sensor import Beams
from lidarcheck.sensor.beam_table import TableBeams

__all__ = ["PIECES", "Lattice", "lattice_of", "piece_of"]

PIECES = 40
"""Equal pieces of a frame whose beams have no neighbours by their numbers."""


@dataclass(frozen=True)
class Lattice:
    """Beams as an image of them shows them: layers from below, columns as they stand.

    `rank` (layers,): how many layers look lower; `to_left`: 1 where points count to the left, else -1; `around`:
    whether the last column stands beside the first.
    """

    beams: Beams
    rank: IntArray
    to_left: int
    around: bool

    def row(self, layer: npt.ArrayLike) -> IntArray:
        """Row of each layer, counted from below; numbers that are no layer of the sensor stay."""
        layer = np.asarray(layer, dtype=np.int32)
        inside = (layer >= 0) & (layer < len(self.rank))
        return np.where(inside, self.rank[np.where(inside, layer, 0)], layer).astype(np.int32)

    def column(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> IntArray:
        """Column of each beam in an image; numbers that are no beam of the sensor stay."""
        layer, point = np.asarray(layer, dtype=np.int32), np.asarray(point, dtype=np.int32)
        inside = (layer >= 0) & (layer < len(self.rank)) & (point >= 0)
        shown = self.beams.image_column(np.where(inside, layer, 0), np.where(inside, point, 0))
        return np.where(inside, shown, point).astype(np.int32)


@functools.lru_cache(maxsize=16)
def lattice_of(beams: Beams) -> Lattice | None:
    """The rows and columns of beams; None where they have no neighbours by their numbers."""
    if not beams.lattice:
        return None
    first = np.zeros(beams.layers, dtype=np.int32)
    elevation, _ = beams.angles_deg(np.arange(beams.layers), first)
    rank = np.empty(beams.layers, dtype=np.int32)
    rank[np.argsort(elevation, kind="stable")] = np.arange(beams.layers)
    step = _step_deg(beams)
    turns = beams.repeats and not isinstance(beams, TableBeams)
    around = turns and beams.points * abs(step) > 360.0 - 0.5 * abs(step)
    return Lattice(beams, rank, 1 if step >= 0.0 else -1, around)


def _step_deg(beams: Beams) -> float:
    """From the first point to the next [deg], 0 where there is one alone."""
    if beams.points < 2:
        return 0.0
    _, azimuth = beams.angles_deg(np.zeros(2, dtype=np.int32), np.arange(2))
    step = float(azimuth[1] - azimuth[0])
    return step - 360.0 * round(step / 360.0) if np.isfinite(step) else 0.0


def piece_of(beams: Beams, layer: IntArray, point: IntArray, points: int) -> IndexArray:
    """Which of 40 equal pieces of a frame beams lie in, from 0: of the sweep's time, or, without times, of the points.

    `points`: how many a line has where the beams do not tell. For beams without a lattice; all of shape (n,).
    """
    time_s = _times_s(beams)
    if time_s is not None and bool(beams.has(layer, point).all()):
        low, high = time_s
        part = (beams.fire_time_s(layer, point) - low) / (high - low)
    else:
        part = np.asarray(point, dtype=np.float64) / max(points, 1)
    return np.clip(np.floor(PIECES * part), 0, PIECES - 1).astype(np.int64)


@functools.lru_cache(maxsize=16)
def _times_s(beams: Beams) -> tuple[float, float] | None:
    """When the first and the last beam is fired; None where that is one moment."""
    layer, point = beams.every()
    if not len(layer):
        return None
    times: FloatArray = beams.fire_time_s(layer, point)
    low, high = float(times.min()), float(times.max())
    return (low, high) if high > low else None
