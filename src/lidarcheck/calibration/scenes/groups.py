"""Where a disagreement may lie: the groups of units that a scene comparison looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.scenes.units import NOTHING, Units
from lidarcheck.scan import IdealScan

__all__ = ["DISTANCE_STEP_M", "Sectors", "UnitGroups", "groups_of", "labels_of", "sector_edges"]

DISTANCE_STEP_M = 10.0
JUMP_M, JUMP_SHARE = 0.5, 0.03
"""Neighbouring beams meet one surface where their distances differ by less than the larger of these."""
MOST_SURFACES = 500


@dataclass(frozen=True)
class UnitGroups:
    """One way to divide the units: `index` (n,) is each one's group, -1 for none; `names` says what each group is."""

    name: str
    index: IndexArray
    names: tuple[str, ...]


@dataclass(frozen=True)
class Sectors:
    """Edges of azimuth and elevation [deg], shapes (columns + 1,) and (rows + 1,)."""

    azimuth_deg: FloatArray
    elevation_deg: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows of elevation, columns of azimuth."""
        return len(self.elevation_deg) - 1, len(self.azimuth_deg) - 1


def labels_of(ideal: IdealScan, by: str) -> IndexArray:
    """The number of each row's object, material, or connected surface; shape (n_rows,), 0 or more.

    `by`: "object", "material" or "surface". Negative object numbers are raised together.
    """
    if by == "object":
        assert ideal.object_id is not None
        return ideal.object_id.astype(np.int64) - min(int(ideal.object_id.min(initial=0)), 0)
    return ideal.material_id.astype(np.int64) if by == "material" else _surfaces(ideal)


def _surfaces(ideal: IdealScan) -> IndexArray:
    """Numbers of connected surfaces, the largest 1; 0 for those beyond the `MOST_SURFACES` largest.

    Beams next to each other in layer or point whose nearest surfaces are about equally far see one surface.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    beams = ideal.beams
    at = np.full((beams.layers + 1, beams.points + 1), -1, dtype=np.int64)
    hit = np.flatnonzero(ideal.distance_m > 0.0)
    near = hit[np.argsort(-ideal.distance_m[hit], kind="stable")]
    at[ideal.layer[near], ideal.point[near]] = near
    ones, others = [], []
    for a, b in ((at[:-1, :-1], at[1:, :-1]), (at[:-1, :-1], at[:-1, 1:])):
        both = (a >= 0) & (b >= 0)
        i, j = a[both], b[both]
        jump = np.abs(ideal.distance_m[i] - ideal.distance_m[j])
        together = jump < np.maximum(JUMP_M, JUMP_SHARE * ideal.distance_m[i])
        ones.append(i[together])
        others.append(j[together])
    i, j = np.concatenate(ones), np.concatenate(others)
    n = len(ideal)
    _, part = connected_components(coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(n, n)), directed=False)
    # Rows of one beam behind the nearest belong to what the beam meets first.
    own = at[ideal.layer, ideal.point]
    part = np.where(own >= 0, part[own], -1)
    sizes = np.bincount(part[part >= 0])
    rank = np.empty(len(sizes), dtype=np.int64)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(1, len(sizes) + 1)
    number = np.where(part >= 0, rank[part], 0) if len(sizes) else np.zeros(n, dtype=np.int64)
    return np.where(number > MOST_SURFACES, 0, number).astype(np.int64)


def sector_edges(units: Units, columns: int, rows: int) -> Sectors:
    """Equal sectors over the beams that were fired."""
    elevation, azimuth = units.angles_deg
    up, aside = (0.5 * float(np.median(step)) for step in units.beams.spacing_deg(units.layer, units.point))
    # Half a beam on either side: the outermost beams lie in the outer sectors.
    return Sectors(
        np.linspace(azimuth.min() - aside, azimuth.max() + aside, columns + 1),
        np.linspace(elevation.min() - up, elevation.max() + up, rows + 1),
    )


def groups_of(
    units: Units, by: str, sectors: Sectors, names: Mapping[int, str], materials: Mapping[int, str]
) -> list[UnitGroups]:
    """Every way to divide the units, those first that say most about where: `names`: of the labels."""
    kinds = [UnitGroups("frame", np.zeros(len(units), dtype=np.int64), ("the whole frame",))]
    kinds.append(_by_number(by, units.label, names))
    if by != "material":
        kinds.append(_by_number("material", units.material, materials))
    row, column = sector_of(units, sectors)
    cells = tuple(f"sector {c + 1}, {r + 1}" for r in range(sectors.shape[0]) for c in range(sectors.shape[1]))
    kinds.append(UnitGroups("sector", row * sectors.shape[1] + column, cells))
    kinds.append(
        UnitGroups("layer", units.layer, tuple(f"layer {i}" for i in range(int(units.layer.max(initial=0)) + 1)))
    )
    points = tuple(f"point column {i}" for i in range(int(units.point.max(initial=0)) + 1))
    kinds.append(UnitGroups("point", units.point, points))
    distance = np.where(units.label == NOTHING, -1, (units.distance_m / DISTANCE_STEP_M).astype(np.int64))
    far = int(distance.max(initial=0)) + 1
    tens = tuple(f"{DISTANCE_STEP_M * i:g} to {DISTANCE_STEP_M * (i + 1):g} m" for i in range(far))
    kinds.append(UnitGroups("distance", distance, tens))
    return kinds


def sector_of(units: Units, sectors: Sectors) -> tuple[IndexArray, IndexArray]:
    """Row and column of each unit's sector."""
    elevation, azimuth = units.angles_deg
    row = np.searchsorted(sectors.elevation_deg, elevation, "right") - 1
    column = np.searchsorted(sectors.azimuth_deg, azimuth, "right") - 1
    return np.clip(row, 0, sectors.shape[0] - 1), np.clip(column, 0, sectors.shape[1] - 1)


def _by_number(kind: str, number: IndexArray, names: Mapping[int, str]) -> UnitGroups:
    values, index = np.unique(number, return_inverse=True)
    words = tuple(
        f"{kind} {value} ({names[value]})" if value in names else f"{kind} {value}" for value in values.tolist()
    )
    return UnitGroups(kind, np.where(values[index] == NOTHING, -1, index).astype(np.int64), words)
