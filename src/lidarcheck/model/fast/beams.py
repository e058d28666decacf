"""Which frame is drawn, and its beams as the fast path sees them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model.streams import purpose_key

__all__ = ["CHUNK", "DrawnBeams", "Task"]

ColumnArray = npt.NDArray[np.int32]

CHUNK = 32768
"""Beams a thread takes at a time."""


class Task(NamedTuple):
    """Which frame, on how many threads, at which ranges, told to whom."""

    seed: int
    frame: int
    threads: int | None
    rounded: bool
    progress: Callable[[int, int], object] | None

    @property
    def key(self) -> tuple[np.uint64, np.uint64, np.uint64]:
        """Seed, purpose and frame as kernels see them."""
        return np.uint64(self.seed), np.uint64(purpose_key("fast")), np.uint64(self.frame)


@dataclass
class DrawnBeams:
    """What is drawn from, a row a beam: at most one pulse, range and S 0 where there is none; and what was drawn.

    `special`: rows of beams that need more than their word. `plain`: beams with an echo of their own, by chunk.
    """

    layer: ColumnArray
    point: ColumnArray
    range_m: FloatArray
    signal: FloatArray
    drawn: npt.NDArray[np.uint64]
    special: IndexArray
    plain: IndexArray
    odd: IndexArray

    @classmethod
    def of(cls, layer: ColumnArray, point: ColumnArray, range_m: FloatArray, signal: FloatArray) -> DrawnBeams:
        """Beams that have not drawn yet."""
        n = len(layer)
        chunks = len(range(0, n, CHUNK))
        drawn, special = np.empty(n, dtype=np.uint64), np.empty(n, dtype=np.int64)
        counts = np.zeros((2, chunks), dtype=np.int64)
        return cls(layer, point, range_m, signal, drawn, special, counts[0], counts[1])

    def __len__(self) -> int:
        return len(self.layer)

    def bounds(self, start: int) -> tuple[int, int]:
        """The chunk that begins with a row."""
        return start, min(start + CHUNK, len(self))

    def listed(self) -> IndexArray:
        """Rows of the special beams."""
        starts = range(0, len(self), CHUNK)
        return np.concatenate([self.special[at : at + odd] for at, odd in zip(starts, self.odd, strict=True)])
