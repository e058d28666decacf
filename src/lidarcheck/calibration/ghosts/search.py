"""The ghost of a target: echoes on its own beams at twice its range, where an opaque plate hides all else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.ghosts.returns import SearchEchoes
from lidarcheck.calibration.ghosts.targets import Patch, typical
from lidarcheck.kpi.detection import wilson

__all__ = ["GhostEchoes", "search_ghost"]

SEARCH_M = (-1.5, 4.0)
"""Where a ghost may stand, beyond twice the target's range: saturated echoes are early, the second way is longer."""
BEHIND_M = 1.0
LINK_M = 0.2
LEAST_TOLERANCE_M, MOST_TOLERANCE_M = 0.3, 0.8
FEWEST_GHOSTS = 2
CHANCE = 5e-3
"""Probability that so many echoes stand there by chance, above which they are no ghost."""
SHORTEST_VIEW_M = 50.0
FAINTER = 0.8
SAME_SURFACE_M = 1.0
TELLING = 5
"""Ghost echoes of the core from which on those at the target's edge can be told from a surface beside it."""


@dataclass(frozen=True)
class GhostEchoes:
    """The ghost of a target.

    `rows`: its echoes, none where there is no ghost; `offset_m`: where most of them stand beyond twice the target's
    range, NaN without any; `beams`: beams in the target's core; `seen`: those of them with an echo there, of a ghost
    or not; `chance`: how probable as many echoes are by chance, 0 … 1; `why`: what speaks against a ghost, empty for
    one. `searched`: the echoes that stand where a ghost may; `clusters`: those of them that lie densely, the largest
    first.
    """

    rows: IndexArray
    offset_m: float
    beams: int
    seen: int
    chance: float
    why: str
    searched: IndexArray
    clusters: tuple[IndexArray, ...]

    def among(self, around: IndexArray) -> GhostEchoes:
        """The same as rows of the table of which the rows `around` were looked at."""
        clusters = tuple(around[rows] for rows in self.clusters)
        return replace(self, rows=around[self.rows], searched=around[self.searched], clusters=clusters)


@dataclass(frozen=True)
class _Behind:
    """Echoes behind a target on its beams: rows, places in its patch, offsets from twice its range; shapes (m,)."""

    rows: IndexArray
    i: IndexArray
    j: IndexArray
    offset_m: FloatArray
    core: BoolArray

    def take(self, chosen: npt.NDArray[np.bool_] | IndexArray) -> _Behind:
        return _Behind(self.rows[chosen], self.i[chosen], self.j[chosen], self.offset_m[chosen], self.core[chosen])


def search_ghost(
    echoes: SearchEchoes,
    patch: Patch,
    target: IndexArray,
    *,
    view_m: float,
    trials: int = 1,
    most: float = float("inf"),
) -> GhostEchoes:
    """The ghost of the target whose echoes are the rows `target` of those around it.

    `view_m`: the scan's farthest echo. `trials`: how many targets are looked at, so that chance is not asked too often.
    `most`: what the sensor reports of all that is brighter.
    At the target's edge a wide beam may see past it: where the edge shows more than the core, echoes there that
    continue a surface beside the target do not tell of a ghost, and belong to it only where they are as bright as those
    that do.
    """
    behind = _behind(echoes, patch, target)
    beams = int(np.count_nonzero(patch.core))
    inside = (behind.offset_m >= SEARCH_M[0]) & (behind.offset_m <= SEARCH_M[1])
    sure = ~_continues(echoes, patch, behind)
    looked_at = behind.take(inside & (sure if np.any(inside & sure) else inside))
    centre, tolerance, parts = _densest(looked_at.offset_m)
    at = np.abs(behind.offset_m - centre) <= tolerance
    near = _one_a_beam(behind.take(at), centre)
    tells = ~_continues(echoes, patch, near) if _edge_shows_more(near, patch) else np.ones(len(near.rows), bool)
    telling = int(np.count_nonzero(tells))
    chance = _chance(int(np.count_nonzero(~at)), telling, tolerance, view_m - patch.range_m)
    seen = int(np.count_nonzero(near.core))
    ghost, own = echoes.amplitude[near.rows[tells]], _of_returns(echoes, target)
    why = _against(telling, trials * chance, np.minimum(ghost, most), own, most)
    searched, clusters = np.sort(behind.rows[inside]), tuple(looked_at.rows[part] for part in parts)
    if why:
        nothing = np.zeros(0, dtype=np.int64)
        return GhostEchoes(nothing, float("nan"), beams, seen, chance, why, searched, clusters)
    rows = near.rows[tells | _as_bright(echoes.amplitude[near.rows], tells)]
    return GhostEchoes(np.sort(rows), centre, beams, seen, chance, "", searched, clusters)


def _behind(echoes: SearchEchoes, patch: Patch, target: IndexArray) -> _Behind:
    range_m = echoes.range_m
    i, j = patch.place(echoes.layer, echoes.point)
    rows = np.flatnonzero((i >= 0) & (range_m > patch.range_m))
    rows = np.setdiff1d(rows[patch.mask[i[rows], j[rows]]], target, assume_unique=True)
    own = patch.own_range_m(i[rows], j[rows])
    rows, own = rows[range_m[rows] > own + BEHIND_M], own[range_m[rows] > own + BEHIND_M]
    return _Behind(rows, i[rows], j[rows], range_m[rows] - 2.0 * own, patch.core[i[rows], j[rows]])


def _densest(offset_m: FloatArray) -> tuple[float, float, list[IndexArray]]:
    """Where the offsets (m,) lie most densely, how far around it they belong there, and all that lie densely (DBSCAN).

    NaN and the least distance for none.
    """
    if not len(offset_m):
        return float("nan"), LEAST_TOLERANCE_M, []
    from sklearn.cluster import DBSCAN

    label = DBSCAN(eps=LINK_M, min_samples=FEWEST_GHOSTS).fit(offset_m[:, None]).labels_
    if label.max() < 0:
        return float(offset_m[0]), LEAST_TOLERANCE_M, []
    counts = np.bincount(label[label >= 0])
    parts = [np.flatnonzero(label == i) for i in np.argsort(-counts, kind="stable")]
    most = offset_m[parts[0]]
    centre = typical(most)
    width = 1.48 * float(np.median(np.abs(most - centre)))
    return centre, float(np.clip(4.0 * width, LEAST_TOLERANCE_M, MOST_TOLERANCE_M)), parts


def _of_returns(echoes: SearchEchoes, target: IndexArray) -> FloatArray:
    """Amplitudes of the target's returns: a saturated one may have fallen apart into echoes."""
    _, of = np.unique(echoes.of[target], return_inverse=True)
    return np.bincount(of, echoes.amplitude[target]).astype(np.float64)


def _one_a_beam(echoes: _Behind, centre: float) -> _Behind:
    """Of several echoes on a beam that which stands closest to the centre."""
    order = np.lexsort((np.abs(echoes.offset_m - centre), echoes.j, echoes.i))
    i, j = echoes.i[order], echoes.j[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = (np.diff(i) != 0) | (np.diff(j) != 0)
    return echoes.take(order[first])


def _chance(others: int, seen: int, tolerance: float, view_m: float) -> float:
    """Probability of `seen` echoes or more, somewhere in the search, from the rate of the others on these beams."""
    from scipy.special import gammainc

    if seen == 0:
        return 1.0
    expected = (others + 0.5) / max(view_m, SHORTEST_VIEW_M) * 2.0 * tolerance
    places = (SEARCH_M[1] - SEARCH_M[0]) / (2.0 * tolerance) + 1.0
    return min(1.0, float(gammainc(seen, expected)) * places)


def _against(seen: int, chance: float, ghost: FloatArray, target: FloatArray, most: float) -> str:
    if seen == 0:
        return "no echo at twice its range"
    if seen < FEWEST_GHOSTS or chance > CHANCE:
        return f"{seen} echo{'es' if seen != 1 else ''} at twice its range, as chance gives"
    if np.median(ghost) > FAINTER * np.median(target) and np.median(ghost) < most:
        return f"the {seen} echoes at twice its range are not fainter than it"
    return ""


def _continues(around: SearchEchoes, patch: Patch, echoes: _Behind) -> BoolArray:
    """Whether each echo at the target's edge stands at the range of an echo on a beam beside the target, (m,)."""
    found = np.zeros(len(echoes.rows), dtype=np.bool_)
    range_m = around.range_m
    i, j = patch.place(around.layer, around.point)
    others = np.flatnonzero((i >= 0) & (range_m > patch.range_m + BEHIND_M))
    others = others[~patch.mask[i[others], j[others]]]
    edge = np.flatnonzero(~echoes.core)
    apart = [np.abs(a[edge][:, None] - b[others]) for a, b in ((echoes.i, i), (echoes.j, j))]
    same = np.abs(range_m[echoes.rows[edge]][:, None] - range_m[others]) < SAME_SURFACE_M
    found[edge] = np.any((apart[0] <= 1) & (apart[1] <= 1) & same, axis=1)
    return found


def _edge_shows_more(near: _Behind, patch: Patch) -> bool:
    """Whether the edge's beams have echoes there more often than the core's, which see nothing but the target."""
    beams, seen = int(np.count_nonzero(patch.core)), int(np.count_nonzero(near.core))
    edge, edge_seen = int(np.count_nonzero(patch.mask)) - beams, len(near.rows) - seen
    return edge > 0 and edge_seen / edge > float(wilson(seen, beams, z=3.0)[1])


def _as_bright(values: FloatArray, tells: BoolArray) -> BoolArray:
    """Which echoes are as bright as those that tell of a ghost, shape (m,); all where these are few."""
    if np.count_nonzero(tells) < TELLING:
        return np.ones(len(values), dtype=np.bool_)
    return np.asarray((values >= 0.8 * values[tells].min()) & (values <= 1.25 * values[tells].max()))
