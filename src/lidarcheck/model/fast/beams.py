"""Which frame is drawn, and its beams as the fast path sees them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.detector_echoes import fixed
from lidarcheck.model.fast.tables import NO_PULSES, SeveralPulses
from lidarcheck.model.streams import purpose_key

__all__ = ["CHUNK", "DrawnBeams", "Task", "in_order", "pick_pulses", "signals"]

ColumnArray = npt.NDArray[np.int32]

_COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(11))
"""Coefficients of the cosine's series, good to 1e-15 up to a right angle."""
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
    """What is drawn from, a row a beam: one pulse, range and S 0 where there is none; and what was drawn.

    `signal` is below 0 where a beam has several, which stand in `pulses`. `background` [avalanches per armed SPAD and
    ns]: of none where all have the same. `special`: rows of beams that need more than their word. `plain`: beams with
    an echo of their own, by chunk.
    """

    layer: ColumnArray
    point: ColumnArray
    range_m: FloatArray
    signal: FloatArray
    drawn: npt.NDArray[np.uint64]
    special: IndexArray
    plain: IndexArray
    odd: IndexArray
    background: FloatArray
    pulses: SeveralPulses

    @classmethod
    def of(
        cls,
        layer: ColumnArray,
        point: ColumnArray,
        range_m: FloatArray,
        signal: FloatArray,
        background: FloatArray | None = None,
        pulses: SeveralPulses = NO_PULSES,
    ) -> DrawnBeams:
        """Beams that have not drawn yet."""
        n = len(layer)
        chunks = len(range(0, n, CHUNK))
        drawn, special = np.empty(n, dtype=np.uint64), np.empty(n, dtype=np.int64)
        counts = np.zeros((2, chunks), dtype=np.int64)
        behind = fixed(np.empty(0) if background is None else background)
        columns = (layer, point, fixed(range_m), fixed(signal), drawn, special, counts[0], counts[1], behind, pulses)
        return cls(*columns)

    def __len__(self) -> int:
        return len(self.layer)

    def bounds(self, start: int) -> tuple[int, int]:
        """The chunk that begins with a row."""
        return start, min(start + CHUNK, len(self))

    def listed(self) -> IndexArray:
        """Rows of the special beams."""
        starts = range(0, len(self), CHUNK)
        return np.concatenate([self.special[at : at + odd] for at, odd in zip(starts, self.odd, strict=True)])


@kernel
def signals(
    distance_m: FloatArray,
    incidence_deg: FloatArray,
    material: ColumnArray,
    strength: FloatArray,
    falloff: FloatArray,
    signal: FloatArray,
    start: int,
    stop: int,
) -> int:
    """S of the rows `start` ... `stop - 1` by the range equation (see `light.surface_signal`) into `signal`.

    `strength`, `falloff`: by material; NaN where there is no such material. Returns how many rows are no ordinary
    ones: a distance below 0 or not finite, an incidence beyond a right angle, a material that is not there.
    """
    odd = 0
    last = np.uint32(len(strength) - 1)
    for row in range(start, stop):
        i = np.uint64(row)
        distance, angle = distance_m[i], incidence_deg[i]
        number = np.uint32(material[i])
        number = number if number < last else last
        t = angle * (math.pi / 180.0)
        t = t * t
        cosine = 0.0
        for k in range(10, -1, -1):
            cosine = cosine * t + _COSINE[k]
        cosine = cosine if cosine > 0.0 else 0.0
        nearest = distance if distance > 1e-3 else 1e-3
        value = strength[number] * (falloff[number] * cosine + (1.0 - falloff[number])) / (nearest * nearest)
        hit = distance > 0.0
        fair = (distance >= 0.0) & (distance < math.inf) & (angle >= 0.0) & (angle <= 90.0)
        odd += 0 if fair & ((value >= 0.0) | (not hit)) else 1
        signal[i] = value if hit else 0.0
    return odd


@kernel
def in_order(layer: ColumnArray, point: ColumnArray, layers: int, points: int, start: int, stop: int) -> bool:
    """Whether the rows are beams of the sensor, one a beam, in order of (layer, point), the row before included."""
    wrong = 0
    for i in range(max(start, 1), stop):
        rises = (layer[i] > layer[i - 1]) | ((layer[i] == layer[i - 1]) & (point[i] > point[i - 1]))
        wrong += 0 if rises else 1
    for i in range(start, stop):
        inside = (layer[i] >= 0) & (layer[i] < layers) & (point[i] >= 0) & (point[i] < points)
        wrong += 0 if inside else 1
    return wrong == 0


@kernel
def pick_pulses(pulses: SeveralPulses, start: int, stop: int, range_m: FloatArray, signal: FloatArray) -> None:
    """Range and S of the pulse of each beam that has one, 0 where it has none, S -1 where it has several."""
    for row in range(start, stop):
        i = np.uint64(row)
        lit, last = 0, np.uint64(0)
        for j in range(pulses.first[i], pulses.first[i + np.uint64(1)]):
            if pulses.signal[j] > 0.0:
                lit += 1
                last = np.uint64(j)
        range_m[i] = pulses.range_m[last] if lit == 1 else 0.0
        signal[i] = pulses.signal[last] if lit == 1 else -1.0 if lit > 1 else 0.0
