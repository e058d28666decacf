"""A real and a simulated vehicle beside each other in one cloud: centroids laid onto each other, then moved apart."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.vehicles.compare import stand_apart
from lidarcheck.calibration.vehicles.cut import Cut
from lidarcheck.calibration.vehicles.kinds import VehicleKind, suggested_offset
from lidarcheck.errors import InputError
from lidarcheck.formats.scans import SCAN_COLUMNS
from lidarcheck.formats.table import Table as Columns
from lidarcheck.scan import Scan

__all__ = ["MARK", "Merged", "Placed", "merge_frames", "merge_vehicles", "place_vehicles"]

MARK = "Simulated"
"""The column that tells the two apart: 0 for the real points, 1 for the simulated ones."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Merged:
    """The merged points and how they came to be where they are.

    The real points stay; the simulated ones are moved by `aligned_m`, which lays their centroid on the real one's, and
    then by `offset_m` along X and Y. `suggested_m`: the offset that was suggested. `overlaps`: the two clouds' boxes,
    seen from above, touch.
    """

    n_real: int
    n_simulated: int
    how_real: str
    how_simulated: str
    aligned_m: tuple[float, float, float]
    offset_m: tuple[float, float]
    suggested_m: tuple[float, float]
    overlaps: bool
    filled: Mapping[str, str]
    columns: Columns = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The result for JSON, without the points."""
        return {name: value for name, value in vars(self).items() if name != "columns"}

    @property
    def clouds(self) -> tuple[FloatArray, FloatArray]:
        """Positions of real and simulated points, shape (n, 3)."""
        xyz = np.stack([self.columns.columns[name] for name in "XYZ"], axis=-1)
        return xyz[: self.n_real], xyz[self.n_real :]


@dataclass(frozen=True)
class Placed:
    """Where the simulated points go: `moved_m`, shape (n, 3); the other fields are those of `Merged`."""

    moved_m: FloatArray
    aligned_m: FloatArray
    offset_m: tuple[float, float]
    suggested_m: tuple[float, float]


def place_vehicles(
    real: Cut, simulated: Cut, vehicle: VehicleKind | None = None, *, x_m: float | None = None, y_m: float | None = None
) -> Placed:
    """Lay the simulated vehicle's centroid on the real one's and move it by the offset, as `merge_vehicles` says."""
    suggested = suggested_offset(vehicle, real.xyz_m, simulated.xyz_m)
    offset = (suggested[0] if x_m is None else x_m, suggested[1] if y_m is None else y_m)
    aligned = np.subtract(real.centroid_m, simulated.centroid_m)
    return Placed(simulated.xyz_m + aligned + np.array([*offset, 0.0]), aligned, offset, suggested)


def merge_vehicles(
    real: Cut,
    simulated: Cut,
    vehicle: VehicleKind | None = None,
    *,
    x_m: float | None = None,
    y_m: float | None = None,
    files: tuple[str, str] = ("", ""),
) -> Merged:
    """Both vehicles in one table, real left and simulated right as the sensor sees them.

    `x_m`, `y_m`: the offset along X (forward) and Y (left); what is not given is as suggested, 0 and so far to the
    right that they stand beside each other. A column that only one of the scans has is 0 for the other: see `filled`.
    """
    placed = place_vehicles(real, simulated, vehicle, x_m=x_m, y_m=y_m)
    one, moved, aligned = real.xyz_m, placed.moved_m, placed.aligned_m
    offset, suggested = placed.offset_m, placed.suggested_m
    columns, filled = _columns(real.scan, simulated.scan, files)
    for i, name in enumerate("XYZ"):
        columns[name] = np.concatenate([one[:, i], moved[:, i]])
    columns[MARK] = np.repeat(np.array([0, 1], dtype=np.int32), [len(one), len(moved)])
    if stand_apart(real, simulated):
        far = f"{real.distance_m:.1f} m and {simulated.distance_m:.1f} m"
        _log.warning("the vehicles stood elsewhere, at %s: is it one distance and pose?", far)
    overlaps = _overlap(one, moved)
    if overlaps:
        _log.warning("the two vehicles overlap; --y %g would part them", suggested[1])
    if offset[1] > 0.0:
        _log.warning("the simulated vehicle stands left of the real one, since Y points to the left")
    return Merged(
        len(one), len(moved), real.how, simulated.how, (float(aligned[0]), float(aligned[1]), float(aligned[2])),
        offset, suggested, overlaps, filled, Columns(columns),
    )  # fmt: skip


def merge_frames(real: Scan, simulated: Scan, files: tuple[str, str] = ("", "")) -> Columns:
    """Two whole frames in one table, each point where it is; `Simulated` tells them apart as in merged vehicles."""
    columns, _ = _columns(real, simulated, files)
    columns[MARK] = np.repeat(np.array([0, 1], dtype=np.int32), [len(real), len(simulated)])
    return Columns(columns)


def _overlap(one: FloatArray, other: FloatArray) -> bool:
    low, high = np.maximum(one.min(axis=0), other.min(axis=0)), np.minimum(one.max(axis=0), other.max(axis=0))
    return bool(np.all(low[:2] < high[:2]))


def _columns(real: Scan, simulated: Scan, files: tuple[str, str]) -> tuple[dict[str, Any], dict[str, str]]:
    """All columns of both scans; those that only one has are 0 for the other, and said."""
    sides = (real, simulated)
    own: list[dict[str, Any]] = []
    for scan, file in zip(sides, files, strict=True):
        lacking = set(scan.defaulted) - {"X", "Y", "Z"}
        # Beams that are not known (-1) cannot stand in a file.
        unknown = {n for n, column in (("Layer", scan.layer), ("Point", scan.point)) if (column < 0).any()}
        known = {n: getattr(scan, f) for n, f in SCAN_COLUMNS.items() if n not in lacking | unknown}
        if any(name.casefold() == MARK.casefold() for name in scan.extra):
            fix = "rename it: this is how the two will be told apart"
            raise InputError(f"has a column {MARK} of its own", file=file or None, fix=fix)
        own.append({**known, **scan.features, **scan.extra})
    spelled = [{name.casefold(): name for name in columns} for columns in own]
    merged: dict[str, Any] = {}
    filled: dict[str, str] = {}
    for key, name in {**spelled[1], **spelled[0]}.items():
        parts = []
        for columns, names, side, scan in zip(own, spelled, ("real", "simulated"), sides, strict=True):
            if key not in names:
                filled[name] = side
            parts.append(np.asarray(columns[names[key]]) if key in names else np.zeros(len(scan), dtype=np.int32))
        merged[name] = np.concatenate(parts)
    # Layer and Point of 0 would name a beam.
    for name in ("Layer", "Point"):
        if name in filled:
            del merged[name]
            filled[name] = "both, since one has none"
    for name, side in filled.items():
        _log.warning("%s is %s for %s", name, "left out" if name in ("Layer", "Point") else "0", side)
    order = [n for n in SCAN_COLUMNS if n in merged] + [n for n in merged if n not in SCAN_COLUMNS]
    return {name: merged[name] for name in order}, filled
