"""Rays, what they meet, and whoever can tell: a scene, or an ideal scan's own surfaces.

All in the sensor frame as it stands at the frame's start: metres, X forward, Y left, Z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError

__all__ = ["Caster", "Hits", "Rays", "Velocity", "handed_over"]

Velocity = tuple[float, float, float]


@dataclass(frozen=True)
class Rays:
    """Rays, a row each: `origin_m` and unit `direction`, shape (n, 3); `time_s` after the frame's start, shape (n,).

    `slot`, shape (n,), is the rank of the sub-beam that a ray stands for among the rows of its beam, from 0: an ideal
    scan knows the surfaces of each sub-beam apart.
    """

    origin_m: FloatArray
    direction: FloatArray
    time_s: FloatArray
    slot: IntArray

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name, shape in (("origin_m", (n, 3)), ("direction", (n, 3)), ("time_s", (n,)), ("slot", (n,))):
            column = _settled(getattr(self, name), np.dtype(np.int32 if name == "slot" else np.float64))
            if column.shape != shape:
                raise UsageError(f"rays: {name} has shape {column.shape}, not {shape}")
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.time_s)

    def take(self, rows: npt.NDArray[Any]) -> Rays:
        """The rays picked by a mask or by indices."""
        return handed_over(*(column[rows] for column in (self.origin_m, self.direction, self.time_s, self.slot)))


def handed_over(origin_m: FloatArray, direction: FloatArray, time_s: FloatArray, slot: IntArray) -> Rays:
    """Rays of new arrays that nobody else writes to: they need no copies."""
    for column in (origin_m, direction, time_s, slot):
        column.flags.writeable = False
    return Rays(origin_m, direction, time_s, slot)


def _settled(column: Any, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    """The column as one that nobody writes to: itself where it is such a one already, else a copy."""
    if isinstance(column, np.ndarray) and column.dtype == kind and column.flags.owndata and not column.flags.writeable:
        return column
    copy = np.array(column, dtype=kind)
    copy.flags.writeable = False
    return copy


@dataclass(frozen=True)
class Hits:
    """What rays meet first, a row each, shape (n,) and (n, 3) for `normal`.

    `distance_m` from the ray's origin, 0 where it meets nothing within the range that was asked for; `incidence_deg`
    0 ... 90 between ray and surface; `normal`: the surface's unit normal, turned towards the ray's origin, zero where
    it is not known or nothing is met.
    """

    distance_m: FloatArray
    material_id: IntArray
    object_id: IntArray
    incidence_deg: FloatArray
    normal: FloatArray


class Caster(Protocol):
    """Something that knows what rays meet."""

    @property
    def velocities_m_s(self) -> Mapping[int, Velocity]:
        """Velocities of the objects that move on their own, by object ID."""

    def cast(self, rays: Rays, *, moving: Mapping[int, Velocity] | None = None, max_range_m: float = 300.0) -> Hits:
        """What each ray meets when the objects in `moving` have moved for the ray's `time_s`, all others at rest."""
