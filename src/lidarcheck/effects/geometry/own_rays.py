"""The rays of a scan's rows as they stand: the beams' axes, or what effects have made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.rays import Caster, Rays, Velocity
from lidarcheck.scan import IdealScan

__all__ = ["AimedRays", "moving_of", "rank_in_beam", "rays_of", "second_rows", "shares_that_end"]


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


def rank_in_beam(ideal: IdealScan) -> npt.NDArray[np.int32]:
    """Rank of each row among the rows of its beam, from 0, by what they meet: their order cannot matter; (n,)."""
    if ideal.in_order:
        return np.zeros(len(ideal), dtype=np.int32)
    key = ideal.layer.astype(np.int64) << 32 | ideal.point
    also = [column for column in (ideal.share, ideal.object_id, ideal.time_s) if column is not None]
    order = np.lexsort((*also, ideal.material_id, ideal.incidence_deg, ideal.distance_m, key))
    sorted_key = key[order]
    begins = np.concatenate(([True], sorted_key[1:] != sorted_key[:-1]))
    place = np.arange(len(key))
    rank = np.empty(len(key), dtype=np.int32)
    rank[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    return rank


def rays_of(ideal: IdealScan) -> Rays:
    """The rows' own rays; where no effect has changed them, the beams' axes at the frame's start."""
    if ideal.rays is not None:
        return ideal.rays
    n = len(ideal)
    slot = rank_in_beam(ideal)
    time_s = np.zeros(n) if ideal.time_s is None else ideal.time_s
    origins = ideal.beams.origins_m(ideal.layer, ideal.point)
    directions = ideal.beams.directions(ideal.layer, ideal.point)
    return Rays(np.zeros((n, 3)) if origins is None else origins, directions, time_s, slot)


def second_rows(ideal: IdealScan, rays: Rays) -> npt.NDArray[np.bool_]:
    """Rows that lie on the ray of a nearer one: what panes and mirrors show besides themselves; shape (n,).

    Only a scan with shares has such rows; without shares, several rows of a beam are sub-beams. Rows of one ray that
    stand for equal shares are sub-beams, too, of a scan whose file does not keep rays.
    """
    return _sent_on(ideal, rays)[0]


def shares_that_end(ideal: IdealScan) -> npt.NDArray[np.float64]:
    """The part of its beam's light whose way ends at each row, shape (n,); together 1 at most in a beam.

    A pane sends on a part of the light that it gets: the air before it is passed by that part once, not twice.
    """
    return ideal.shares() if ideal.share is None else _sent_on(ideal, rays_of(ideal))[1]


def _sent_on(ideal: IdealScan, rays: Rays) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
    """Which rows get their light from a nearer one on their ray, and what of each row's light goes no further; (n,).

    A row's light comes from the last one before it that has more than that left.
    """
    second, ends = np.zeros(len(ideal), dtype=bool), np.array(ideal.shares())
    if ideal.share is None or len(ideal) < 2:
        return second, ends
    beam = ideal.layer.astype(np.int64) << 32 | ideal.point
    far = np.where(ideal.distance_m > 0.0, ideal.distance_m, np.inf)
    keys = (*rays.origin_m.T, *rays.direction.T, beam)
    order = np.lexsort((-ideal.share, far, *keys))
    begins = np.zeros(len(order), dtype=bool)
    begins[0] = True
    for key in keys:
        begins[1:] |= key[order[1:]] != key[order[:-1]]
    first = np.flatnonzero(begins)
    count = np.diff(np.append(first, len(order)))
    for j in range(1, int(count.max())):
        place = first[count > j] + j
        row, open_ = order[place], np.ones(len(place), dtype=bool)
        for back in range(1, j + 1):
            parent = order[place - back]
            takes = open_ & (ends[parent] > ends[row] * (1.0 + 1e-9))
            ends[parent[takes]] -= ends[row[takes]]
            second[row[takes]] = True
            open_ &= ~takes
    return second, ends
