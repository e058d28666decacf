"""The rays of a scan's rows as they stand: the beams' axes, or what effects have made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.rays import Caster, Rays, Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import beam_directions

__all__ = ["AimedRays", "moving_of", "rank_in_beam", "rays_of", "second_rows"]


@dataclass(frozen=True)
class AimedRays(Rays):
    """Rays that know which objects move meanwhile: an effect that aims them anew must see those move, too."""

    moving: Mapping[int, Velocity] = field(default_factory=dict)

    def take(self, rows: npt.NDArray[Any]) -> AimedRays:
        """The rays picked by a mask or by indices."""
        picked = super().take(rows)
        return AimedRays(picked.origin_m, picked.direction, picked.time_s, picked.slot, self.moving)


def moving_of(rays: Rays, caster: Caster) -> Mapping[int, Velocity]:
    """Velocities of the objects that move until these rays are fired, by object ID.

    Rays that have times of their own although no effect gave them any were swept through the scene as it moves.
    """
    if isinstance(rays, AimedRays):
        return rays.moving
    return caster.velocities_m_s if np.any(rays.time_s) else {}


def rank_in_beam(layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Rank of each row among the rows of its beam, from 0, in the table's order; shape (n,)."""
    key = layer.astype(np.int64) << 32 | point
    if len(key) < 2 or bool(np.all(key[1:] > key[:-1])):
        return np.zeros(len(key), dtype=np.int32)
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    begins = np.concatenate(([True], sorted_key[1:] != sorted_key[:-1]))
    place = np.arange(len(key))
    rank = np.empty(len(key), dtype=np.int32)
    rank[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    return rank


def rays_of(ideal: IdealScan) -> Rays:
    """The rows' own rays; where no effect has changed them, the beams' axes from the origin at the frame's start."""
    if ideal.rays is not None:
        return ideal.rays
    n = len(ideal)
    slot = rank_in_beam(ideal.layer, ideal.point)
    return Rays(np.zeros((n, 3)), beam_directions(ideal.layer, ideal.point), np.zeros(n), slot)


def second_rows(ideal: IdealScan, rays: Rays) -> npt.NDArray[np.bool_]:
    """Rows that lie on the ray of a nearer one: what panes and mirrors show besides themselves; shape (n,).

    Only a scan with shares has such rows; without shares, several rows of a beam are sub-beams.
    """
    second = np.zeros(len(ideal), dtype=bool)
    if ideal.share is None or len(ideal) < 2:
        return second
    beam = ideal.layer.astype(np.int64) << 32 | ideal.point
    far = np.where(ideal.distance_m > 0.0, ideal.distance_m, np.inf)
    keys = (*rays.origin_m.T, *rays.direction.T, beam)
    order = np.lexsort((far, *keys))
    same = np.ones(len(ideal) - 1, dtype=bool)
    for key in keys:
        same &= key[order[1:]] == key[order[:-1]]
    second[order[1:][same]] = True
    return second
