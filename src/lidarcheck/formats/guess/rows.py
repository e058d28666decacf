"""The rows of all frames of a guess, each with its ring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.bins import rings_by_wrap
from lidarcheck.formats.assign.cloud import Cloud
from lidarcheck.formats.assign.rings import says_nothing
from lidarcheck.formats.geometry.unit import unit_of
from lidarcheck.formats.guess.elevations import clusters
from lidarcheck.formats.guess.origin import sharpest_origin

__all__ = ["Labelled", "labelled"]

_MOST_RINGS = 4096
_CHANGES = 0.5
"""Share of the rows whose ring is another than the row's before, where rows stand in the order of firing."""


@dataclass(frozen=True)
class Labelled:
    """Rows with a ring, of shape (n,) each, frames one after another in the order of their files.

    `told`: `ring`, `Layer`, `order of rows` (each turn another ring) or `elevations`. `point`, `time`, `range_m`: None
    where the files have none. `aside_deg`: what the azimuth is beyond that from the axis, for beams that start beside
    it.
    """

    position: FloatArray
    ring: IntArray
    frame: IntArray
    told: str
    point: IntArray | None
    time: npt.NDArray[Any] | None
    range_m: FloatArray | None
    frames: int
    error_m: float
    notes: tuple[str, ...] = ()
    aside_deg: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.ring)

    @property
    def level_m(self) -> FloatArray:
        """Distance from the axis."""
        return np.asarray(np.hypot(self.position[:, 0], self.position[:, 1]))

    @property
    def azimuth_deg(self) -> FloatArray:
        """Azimuth from where the beams start."""
        azimuth = np.asarray(np.rad2deg(np.arctan2(self.position[:, 1], self.position[:, 0])))
        return azimuth if self.aside_deg is None else azimuth + self.aside_deg

    def starting(self, forward_m: float, offset_deg: FloatArray) -> Labelled:
        """The same rows seen from where their beams start: forward along the column, each ring so far beside it."""
        beside = np.sin(np.deg2rad(offset_deg))[self.ring]
        return replace(self, aside_deg=np.rad2deg(forward_m * beside / np.maximum(self.level_m, 1e-3)))

    @property
    def by_firing(self) -> bool:
        """Whether rows stand in the order of firing: rings in turn, not ring after ring."""
        same = np.diff(self.frame) == 0
        return bool(same.any()) and float(np.mean(np.diff(self.ring)[same] != 0)) > _CHANGES

    def of_rings(self, numbers: npt.NDArray[Any]) -> Labelled:
        """The rows of some rings, which count from 0 in that order then."""
        rows = np.flatnonzero(np.isin(self.ring, numbers))
        columns: dict[str, Any] = {
            name: None if (own := getattr(self, name)) is None else own[rows]
            for name in ("position", "frame", "point", "time", "range_m")
        }
        ring = np.searchsorted(numbers, self.ring[rows]).astype(np.int32)
        return replace(self, ring=ring, **columns)


def labelled(clouds: Sequence[Cloud]) -> Labelled:
    """The rows of frames with their rings. `UsageError` where nothing tells rings, or X, Y, Z are not in metres."""
    position = np.concatenate([cloud.position for cloud in clouds])
    frame = np.repeat(np.arange(len(clouds), dtype=np.int32), [len(cloud) for cloud in clouds])
    error = max(cloud.error for cloud in clouds)
    ranges = _joined([cloud.range for cloud in clouds])
    unit = unit_of(np.linalg.norm(position, axis=1), ranges, error)
    if unit.units:
        what = f"X, Y, Z are not in m: the ranges fit in {' or '.join(unit.units)}"
        raise UsageError(what, fix="write them in m")
    ring, told = _ring(clouds, position)
    kept = np.flatnonzero(ring >= 0)
    given = [cloud.point if cloud.layer is not None or cloud.ring is not None else None for cloud in clouds]
    point = _joined([p if p is not None else c.column for p, c in zip(given, clouds, strict=True)])
    time = _joined([cloud.time for cloud in clouds])
    notes = [] if len(kept) == len(ring) else [f"{len(ring) - len(kept)} of {len(ring)} rows lie in no ring"]
    return Labelled(
        position[kept],
        ring[kept].astype(np.int32),
        frame[kept],
        told,
        None if point is None else point[kept].astype(np.int32),
        None if time is None else time[kept],
        None if ranges is None else ranges[kept],
        len(clouds),
        error,
        tuple(notes),
    )


def _ring(clouds: Sequence[Cloud], position: FloatArray) -> tuple[npt.NDArray[Any], str]:
    """The ring of each row, -1 for none, and what told it."""
    for told in ("ring", "layer"):
        ring = _joined([getattr(cloud, told) for cloud in clouds])
        if ring is not None and not says_nothing(ring):
            _check_rings(ring)
            return ring, "ring" if told == "ring" else "Layer"
    if len(clouds) == 1:
        ring = rings_by_wrap(position)
        if ring is not None:
            return ring, "order of rows"
    level, height = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
    elevation = np.rad2deg(np.arctan2(height, level))
    ring = clusters(elevation)
    if ring is None:
        forward, up = sharpest_origin(level, height)
        ring = clusters(np.rad2deg(np.arctan2(height - up, level - forward)))
    if ring is None:
        what = "no column tells the rings, and the elevations show none: rows lie at all of them"
        if len(elevation) < 200:
            what = f"{len(elevation)} rows without a column of the rings are too few to show elevations"
        raise UsageError(what, fix="name the column with --ring, or give the clouds as the driver writes them")
    return ring, "elevations"


def _check_rings(ring: npt.NDArray[Any]) -> None:
    if not np.all(np.isfinite(ring)) or bool((ring != np.rint(ring)).any()):
        raise UsageError("the column of the rings has values that are no whole numbers", fix="name another with --ring")
    if len(np.unique(ring)) > _MOST_RINGS:
        what = f"the column of the rings has {len(np.unique(ring))} different values"
        raise UsageError(what, fix="name another with --ring")


def _joined(columns: Sequence[npt.NDArray[Any] | None]) -> npt.NDArray[Any] | None:
    present = [column for column in columns if column is not None]
    return np.concatenate(present) if len(present) == len(columns) else None
