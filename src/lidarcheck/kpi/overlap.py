"""How well two point clouds cover each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError

__all__ = ["RADIUS_M", "Overlap", "overlap", "positions"]

RADIUS_M = 0.1
MOST_REPEATED = 2000


class Overlap(NamedTuple):
    """Cover of two clouds: shares, 0 … 1, of points with one of the other within `radius_m`; Chamfer distance [m]."""

    measured_share: float
    simulated_share: float
    chamfer_m: float
    radius_m: float


def overlap(
    measured_xyz_m: npt.ArrayLike, simulated_xyz_m: npt.ArrayLike, *, radius_m: float = RADIUS_M, every: int = 1
) -> Overlap:
    """Share of measured points with a simulated one within the radius, the share back, and the Chamfer distance.

    Positions of shapes (n, 3) and (m, 3). The Chamfer distance is the mean of the two directed mean distances to the
    nearest neighbour. One cloud empty: the other's share is 0, its own share and the Chamfer distance are NaN; both
    empty: all NaN. `every`: look from every so many points only, an estimate in as much less time.
    """
    m, s = positions(measured_xyz_m), positions(simulated_xyz_m)
    there, back = _nearest_m(m[::every], s), _nearest_m(s[::every], m)
    chamfer = 0.5 * (float(there.mean()) + float(back.mean())) if len(m) and len(s) else float("nan")
    return Overlap(_share(there, radius_m), _share(back, radius_m), chamfer, radius_m)


def positions(xyz_m: npt.ArrayLike) -> FloatArray:
    """Positions [m], shape (n, 3), also of none; `UsageError` for any other shape, NaN and infinity."""
    xyz = np.asarray(xyz_m, dtype=np.float64)
    if xyz.size == 0:
        return np.zeros((0, 3))
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise UsageError(f"positions have shape {xyz.shape}", fix="give them as (n, 3)")
    if not np.isfinite(xyz).all():
        raise UsageError("a position is not finite", fix="leave out NaN and infinite values")
    return xyz


def _share(distance_m: FloatArray, radius_m: float) -> float:
    return float(np.mean(distance_m <= radius_m)) if distance_m.size else float("nan")


def _nearest_m(cloud: FloatArray, other: FloatArray) -> FloatArray:
    """Distance of each point to the nearest of the other cloud, shape (n,); infinite where that is empty."""
    if not len(other) or not len(cloud):
        return np.full(len(cloud), np.inf)
    from scipy.spatial import cKDTree

    # Unbalanced trees are built several times faster and answer a scan's queries as fast.
    tree = cKDTree(_without_stacks(other), balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(cloud, workers=-1)
    return np.asarray(distance, dtype=np.float64)


def _without_stacks(cloud: FloatArray) -> FloatArray:
    """The same places, each once if many points share theirs.

    A tree cannot part equal points, and some sensors write every lost echo at the origin: a query would visit them all.
    """
    different = np.unique(elementary.product(cloud, np.sqrt([1.0, 2.0, 3.0]))).size
    return cloud if len(cloud) - different <= MOST_REPEATED else np.unique(cloud, axis=0)
