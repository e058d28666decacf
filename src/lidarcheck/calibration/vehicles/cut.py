"""Cutting a vehicle out of a frame: by its object in the ideal scan, by a box, or as a cluster above the ground.

The ground is taken for a plane, fitted to the lowest echoes. What stands above it is divided into cells of 0.4 m seen
from above; cells that touch are a cluster, and the nearest cluster of the vehicle's size is the vehicle, or the one
nearest to a distance that is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.vehicles.kinds import Extent, VehicleKind, extent_of
from lidarcheck.errors import InputError
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.scan import IdealScan, Scan

__all__ = ["FEWEST_ECHOES", "Cut", "CutBox", "CutSource", "cut_vehicle", "find_object", "xyz_of"]

FEWEST_ECHOES = 20
CELL_M, REACH_M = 0.4, 160.0
ABOVE_GROUND_M, KEPT_ABOVE_GROUND_M = 0.3, 0.12
GROUND_CELL_M, GROUND_REACH_M, GROUND_BIN_M = 2.0, 60.0, 0.2
FEWEST_GROUND = 10
NAMED_SHARE, NAMED_M = 0.1, 4.0
LEAST_UPRIGHT = 0.4
"""Of the least height, how much must be seen from the lowest point to the highest."""
MOST_MEASURED = 2000
DRAWN_NEARER_M = 1.5
TOP_M = 0.5
"""Above the tallest vehicle: what reaches higher is no vehicle, what hangs higher no part of one."""


@dataclass(frozen=True)
class CutBox:
    """A box along the axes of the sensor frame [m]."""

    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]

    def holds(self, xyz_m: FloatArray) -> BoolArray:
        """Which points lie inside, shape (n,)."""
        return np.asarray(np.all((xyz_m >= self.low_m) & (xyz_m <= self.high_m), axis=1))


@dataclass(frozen=True)
class CutSource:
    """What a vehicle may be cut out by. `distance_m`: where it is known to be; `file`: for messages."""

    ideal: IdealScan | None = None
    object_id: int | None = None
    box: CutBox | None = None
    distance_m: float | None = None
    file: str = ""


@dataclass(frozen=True)
class Cut:
    """A vehicle's echoes, and how they were found, in words."""

    scan: Scan
    how: str
    extent: Extent
    centroid_m: tuple[float, float, float]

    @property
    def distance_m(self) -> float:
        """Distance of the centroid from the sensor."""
        return float(np.linalg.norm(self.centroid_m))

    @property
    def xyz_m(self) -> FloatArray:
        """Positions, shape (n, 3)."""
        return xyz_of(self.scan)

    @property
    def beams(self) -> int:
        """Beams with an echo."""
        return len(np.unique(self.scan.layer.astype(np.int64) << 32 | self.scan.point))


def xyz_of(scan: Scan) -> FloatArray:
    """Positions of echoes, shape (n, 3)."""
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)


def cut_vehicle(scan: Scan, vehicle: VehicleKind | None, source: CutSource) -> Cut:
    """The vehicle's echoes; `InputError` says what was found where there is none, or too little of it.

    By the box, else by the object, else as a cluster; a scan no larger than such a vehicle is taken whole. Without a
    `vehicle`, nor box nor object, it must be one.
    """
    if not len(scan):
        raise InputError("holds no echoes", file=source.file or None, fix="was it measured, and written completely?")
    xyz = xyz_of(scan)
    if source.box is not None:
        rows, how = source.box.holds(xyz), "by the box"
        what = f"the box holds {int(rows.sum())} of the {len(scan)} echoes, which span {_spans(xyz)}"
    elif source.object_id is not None and source.ideal is not None:
        rows, how = _on_object(scan, source), f"object {source.object_id} of the ideal scan"
        what = f"object {source.object_id} has {int(rows.sum())} echoes"
    elif _is_whole(xyz, vehicle):
        rows, how = np.ones(len(scan), dtype=np.bool_), "the whole file"
        what = f"it has {len(scan)} echoes"
    elif vehicle is None:
        fix = "name the --vehicle to look for, or give its --box or --object"
        raise InputError(f"spans {_spans(xyz)}: more than a vehicle", file=source.file or None, fix=fix)
    else:
        rows, how = _cluster(xyz, vehicle, source)
        what = f"the {vehicle.name} has {int(rows.sum())} echoes"
    if int(rows.sum()) < FEWEST_ECHOES:
        raise InputError(f"{what}; at least {FEWEST_ECHOES} are needed", file=source.file or None, fix=_REMEDY)
    own = scan.take(rows)
    own_xyz = xyz[rows]
    centroid = own_xyz.mean(axis=0)
    return Cut(own, how, extent_of(own_xyz), (float(centroid[0]), float(centroid[1]), float(centroid[2])))


_REMEDY = "check the file, or give the vehicle's --box or --object"


def _spans(xyz: FloatArray) -> str:
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    return ", ".join(f"{axis} {a:.1f} to {b:.1f} m" for axis, a, b in zip("XYZ", low, high, strict=True))


def _is_whole(xyz: FloatArray, vehicle: VehicleKind | None) -> bool:
    """Whether all points together are no larger than a vehicle."""
    extent = extent_of(xyz)
    if vehicle is None:
        return extent.long_m <= 20.0 and extent.short_m <= 4.0 and extent.height_m <= 5.0
    return vehicle.fits(extent, whole=True)


def _on_object(scan: Scan, source: CutSource) -> BoolArray:
    """Echoes from the object's surface."""
    assert source.ideal is not None
    assert source.ideal.object_id is not None
    pairing = pair_with_ideal(source.ideal, scan)
    number = source.ideal.object_id[np.maximum(pairing.surface, 0)]
    return np.asarray(pairing.of_surface & (pairing.surface >= 0) & (number == source.object_id))


def find_object(ideal: IdealScan, vehicle: VehicleKind, distance_m: float | None, file: str = "") -> int:
    """The object of an ideal scan that has the vehicle's size: the nearest, or the one nearest to a known distance.

    `InputError` lists what there is instead.
    """
    assert ideal.object_id is not None
    hit = np.flatnonzero(ideal.distance_m > 0.0)
    layer, point, beams = ideal.layer[hit], ideal.point[hit], ideal.beams
    xyz = beams.positions_m(layer, point, ideal.distance_m[hit] + beams.range_offset_m(layer))
    height = xyz[:, 2] - _ground(xyz, file)
    seen = _things(xyz, height, ideal.object_id[hit].astype(np.int64), vehicle)
    return _chosen(seen, vehicle, distance_m, file, "objects in the ideal scan").number


@dataclass(frozen=True)
class _Seen:
    """A candidate: its number, how many points, their size (the height above the ground), upright span and distance."""

    number: int
    n: int
    extent: Extent
    upright_m: float
    distance_m: float


def _things(xyz: FloatArray, height: FloatArray, label: IndexArray, vehicle: VehicleKind) -> list[_Seen]:
    """What the points of each label make up; sizes along the axes where they are far from a vehicle's anyway."""
    order = np.argsort(label, kind="stable")
    numbers, starts, counts = np.unique(label[order], return_index=True, return_counts=True)
    low, high = (of.reduceat(xyz[order], starts, axis=0) for of in (np.minimum, np.maximum))
    top = np.maximum.reduceat(height[order], starts)
    seen = []
    for i in np.flatnonzero(counts >= FEWEST_ECHOES).tolist():
        span = high[i] - low[i]
        own = order[starts[i] : starts[i] + counts[i]]
        extent = Extent(float(span[:2].max()), float(span[:2].min()), float(top[i]))
        middle = 0.5 * (high[i] + low[i])
        if np.hypot(span[0], span[1]) <= 2.0 * vehicle.most_m[0] and counts[i] >= FEWEST_ECHOES:
            few = xyz[own[:: max(len(own) // MOST_MEASURED, 1)]]
            turned = extent_of(few)
            extent = Extent(turned.long_m, turned.short_m, float(np.percentile(height[own], 99.0)))
            middle = few.mean(axis=0)
        seen.append(_Seen(int(numbers[i]), int(counts[i]), extent, float(span[2]), float(np.linalg.norm(middle))))
    return seen


def _chosen(seen: Sequence[_Seen], vehicle: VehicleKind, distance_m: float | None, file: str, what: str) -> _Seen:
    """The candidate that is the vehicle; `InputError` where none is."""
    least = LEAST_UPRIGHT * vehicle.least_m[2]
    fitting = [one for one in seen if one.upright_m >= least and vehicle.fits(one.extent)]
    if not fitting:
        close = sorted(seen, key=lambda one: _misfit(one.extent, vehicle))[:3]
        found = "; ".join(f"{one.extent.words()} at {one.distance_m:.0f} m, {one.n} points" for one in close)
        text = f"there is no {vehicle.name} ({vehicle.words()}) among {len(seen)} {what}"
        text += f"; closest in size: {found}" if found else ""
        raise InputError(text, file=file or None, fix="name another --vehicle, or give its --box or --object")
    if distance_m is None:
        return min(fitting, key=lambda one: (vehicle.is_flat(one.extent), one.distance_m))
    best = min(fitting, key=lambda one: abs(one.distance_m - distance_m))
    if abs(best.distance_m - distance_m) > NAMED_M + NAMED_SHARE * distance_m + 0.5 * vehicle.usual_m[0]:
        where = ", ".join(f"{one.distance_m:.0f}" for one in sorted(fitting, key=lambda one: one.distance_m)[:8])
        text = f"the name says {distance_m:g} m, but what may be a {vehicle.name} is at {where} m"
        raise InputError(
            text, file=file or None, fix=f"write FILE@{best.distance_m:.0f}, or give its --box or --object"
        )
    return best


def _misfit(extent: Extent, vehicle: VehicleKind) -> float:
    sizes = np.array([extent.long_m, extent.height_m])
    usual = np.array([vehicle.usual_m[1], vehicle.usual_m[2]])
    return float(np.abs(np.log(np.maximum(sizes, 0.05) / usual)).sum())


def _cluster(xyz: FloatArray, vehicle: VehicleKind, source: CutSource) -> tuple[BoolArray, str]:
    """Points of the vehicle's cluster, and what was done in words."""
    height = xyz[:, 2] - _ground(xyz, source.file)
    some = np.flatnonzero((height > ABOVE_GROUND_M) & (height < vehicle.most_m[2] + 2.0 * TOP_M))
    cells = _cells(xyz)
    some = some[cells[some] >= 0]
    label = _labels(cells[some])
    seen = _things(xyz[some], height[some], label, vehicle) if len(some) else []
    found = _chosen(seen, vehicle, source.distance_m, source.file, "clusters above the ground")
    core = some[label == found.number]
    own = np.isin(cells, np.unique(cells[core])) | _drawn_nearer(xyz, xyz[core])
    rows = own & (height > KEPT_ABOVE_GROUND_M) & (height < vehicle.most_m[2] + TOP_M)
    return rows, f"the cluster of {found.extent.words()} at {found.distance_m:.1f} m"


def _drawn_nearer(xyz: FloatArray, core: FloatArray) -> BoolArray:
    """Points on the cluster's beams and up to 1.5 m before it: pile-up draws a retro-reflector's echoes so near."""

    def angles(points: FloatArray) -> FloatArray:
        level = np.hypot(points[:, 0], points[:, 1])
        return np.stack([np.arctan2(points[:, 1], points[:, 0]), np.arctan2(points[:, 2], level)], axis=-1)

    low, high = angles(core).min(axis=0), angles(core).max(axis=0)
    near = float(np.linalg.norm(core, axis=1).min())
    range_m = np.linalg.norm(xyz, axis=1)
    inside = (range_m > near - DRAWN_NEARER_M) & (range_m <= near)
    seen = angles(xyz)
    return np.asarray(inside & np.all((seen >= low) & (seen <= high), axis=1))


def _cells(xyz: FloatArray) -> IndexArray:
    """The cell of each point seen from above, -1 beyond the reach; shape (n,)."""
    side = int(2.0 * REACH_M / CELL_M)
    x, y = (np.floor((xyz[:, i] + REACH_M) / CELL_M).astype(np.int64) for i in (0, 1))
    inside = (x >= 0) & (x < side) & (y >= 0) & (y < side)
    return np.where(inside, x * side + y, -1)


def _labels(cells: IndexArray) -> IndexArray:
    """The cluster of each point in those cells, shape (n,): cells that touch, also at a corner, are one."""
    from scipy.ndimage import label

    side = int(2.0 * REACH_M / CELL_M)
    filled = np.zeros(side * side, dtype=np.bool_)
    filled[cells] = True
    number, _ = label(filled.reshape(side, side), structure=np.ones((3, 3), dtype=np.int64))
    return np.asarray(number.ravel()[cells], dtype=np.int64)


def _ground(xyz: FloatArray, file: str) -> FloatArray:
    """Height of the ground below each point [m], shape (n,): a plane through the lowest points of cells of 2 m."""
    near = np.flatnonzero(np.hypot(xyz[:, 0], xyz[:, 1]) < GROUND_REACH_M)
    cell = np.floor(xyz[near, :2] / GROUND_CELL_M).astype(np.int64)
    key = cell[:, 0] * 4096 + cell[:, 1]
    order = near[np.lexsort((xyz[near, 2], key))]
    first = np.append(True, np.diff(np.sort(key)) > 0)[: len(order)]
    low = xyz[order[first]]
    if len(low) < FEWEST_GROUND:
        what = f"there is no ground to tell the vehicle from: {len(low)} cells of {GROUND_CELL_M:g} m hold echoes"
        raise InputError(what, file=file or None, fix="give the vehicle's --box, or the ideal scan with its object")
    bins = np.floor(low[:, 2] / GROUND_BIN_M).astype(np.int64)
    values, counts = np.unique(bins, return_counts=True)
    # Of the heights that many cells have, the lowest: the ground, not the flat roofs.
    usual = values[counts >= 0.5 * counts.max()].min()
    plane = np.array([0.0, 0.0, (usual + 0.5) * GROUND_BIN_M])
    for tolerance in (1.0, 0.5, 0.3, 0.2, 0.15):
        residual = low[:, 2] - low[:, :2] @ plane[:2] - plane[2]
        own = low[np.abs(residual) < tolerance]
        if len(own) < FEWEST_GROUND:
            break
        design = np.column_stack([own[:, :2], np.ones(len(own))])
        plane = np.linalg.lstsq(design, own[:, 2])[0]
    return np.asarray(xyz[:, :2] @ plane[:2] + plane[2])
