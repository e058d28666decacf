"""What any sensor shows beside a bright target: its features over the offset in beams, from a scan or a CSV table.

For sensors that are no SPAD arrays, whose tables nobody fits. Wide CSV: `offset_layers` (vertical) or `offset_points`
(horizontal), and any of `range_m` and the sensor's features, by their names or aliases.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.calibration.blooming.csv import BEAM_OFFSETS, is_profile, number_of, profile_axis, rows_of
from lidarcheck.calibration.blooming.workflow import BloomingMeasurement
from lidarcheck.calibration.echoes import features_of, ways
from lidarcheck.calibration.ghosts.returns import brightness
from lidarcheck.cases.source import ideal_of, scan_of
from lidarcheck.errors import InputError, NotThereError
from lidarcheck.formats.lut import Axis
from lidarcheck.kpi.blooming import target_offset
from lidarcheck.kpi.target import target_rows
from lidarcheck.model import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["BesideTarget", "beside_target", "beside_target_in", "beside_target_of"]

_NEAR_M = 3.0
"""How far a target may stand from the distance that the user names."""
_WINDOWS = 2.0
"""Windows of detection about the target's range within which light is the target's."""


@dataclass(frozen=True)
class BesideTarget:
    """Means over the offset from the target [beams; upward, to the left], shapes (k,).

    `echoes`: how many there are; `range_m`, `features`: their means, NaN where not known. Offset 0 is the target.
    """

    name: str
    axis: Axis
    distance_m: float
    offset: FloatArray
    echoes: IndexArray
    range_m: FloatArray
    features: Mapping[str, FloatArray]

    @property
    def on_target(self) -> BoolArray:
        """Which offsets are the target's own, shape (k,)."""
        return np.asarray(self.offset == 0.0)


def beside_target(measured: BloomingMeasurement, model: Model, axis: Axis) -> BesideTarget:
    """A measurement's profile: a CSV table as it is, or a scan, whose target the ideal scan tells, else its brightness.

    With an ideal scan, beams that meet another surface near the target's range are left out.
    `InputError` names the file that shows no target, or several where no distance is named.
    """
    name, sensor = str(measured.path), model.sensor
    if is_profile(measured.path):
        return _of_table(Path(measured.path), sensor, axis, measured.distance_m)
    scan = scan_of(measured.path, measured.placement, sensor)
    if measured.ideal is not None:
        ideal = ideal_of(measured.ideal, sensor)
        return beside_target_of(scan, ideal, model, axis, name, measured.distance_m)
    target = _bright(scan, sensor, name)
    layer, point, way_m = scan.layer[target], scan.point[target], ways(scan)[target]
    at = _one_target(way_m, measured.distance_m, name)
    mine = np.abs(way_m - at) <= _WINDOWS * sensor.window_m
    return beside_target_in(scan, sensor, axis, (layer[mine], point[mine], at), name)


def beside_target_of(
    scan: Scan, ideal: IdealScan, model: Model, axis: Axis, name: str = "the scan", distance_m: float | None = None
) -> BesideTarget:
    """The profile of the target that an ideal scan tells, at `distance_m` where there are several."""
    sensor = model.sensor
    rows = target_rows(ideal, model, None)
    if rows is None:
        what = "no beam of the ideal scan meets a retro-reflector of the model"
        raise NotThereError(what, file=ideal.file or name, fix="check the material IDs")
    layer, point, way_m = ideal.layer[rows], ideal.point[rows], ideal.distance_m[rows]
    others = ideal.take(~rows & (ideal.distance_m > 0.0))
    at = _one_target(way_m, distance_m, name)
    mine = np.abs(way_m - at) <= _WINDOWS * sensor.window_m
    seen = others.take(np.abs(others.distance_m - at) <= 2.0 * _WINDOWS * sensor.window_m)
    scan = scan.take(~np.isin(_beams(scan), np.setdiff1d(_beams(seen), scan.beams.index(layer, point))))
    return beside_target_in(scan, sensor, axis, (layer[mine], point[mine], at), name)


def beside_target_in(
    scan: Scan, sensor: Sensor, axis: Axis, target: tuple[IntArray, IntArray, float], name: str = "the scan"
) -> BesideTarget:
    """The profile of a target whose beams (layer, point) and range [m] are known."""
    layer, point, at_m = target
    way_m = ways(scan)
    near = np.abs(way_m - at_m) <= _WINDOWS * sensor.window_m
    offset, _ = target_offset(scan.layer, scan.point, layer, point, axis, scan.beams)
    rows = np.flatnonzero(near & np.isfinite(offset))
    if not len(rows):
        what = f"no echo at the target's range, {at_m:.1f} m"
        raise NotThereError(what, file=name, fix="do the files belong together?")
    found, where = np.unique(offset[rows] + 0.0, return_inverse=True)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(where, values[rows], len(found)) / np.bincount(where, minlength=len(found)))

    features = {feature: mean(values) for feature, (_, values) in features_of(scan, sensor).items()}
    return BesideTarget(name, axis, at_m, found, np.bincount(where), mean(way_m), features)


def _beams(table: Scan | IdealScan) -> IndexArray:
    return table.beams.index(table.layer, table.point)


def _bright(scan: Scan, sensor: Sensor, name: str) -> BoolArray:
    """Echoes far above what an ordinary surface sends back."""
    told = brightness(scan, sensor)
    bright = np.asarray((told.values >= told.above) & scan.beams.has(scan.layer, scan.point))
    if told.relative or not bright.any():
        what = f"no {told.column} tells a bright target: {told.why}"
        raise NotThereError(what, file=name, fix="name the ideal scan with --ideal")
    return bright


def _one_target(way_m: FloatArray, distance_m: float | None, name: str) -> float:
    """The range of the target that is named, else of the only one."""
    ordered = np.sort(way_m)
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > _NEAR_M) + 1)
    at = [float(np.median(part)) for part in parts]
    near = [one for one in at if distance_m is not None and abs(one - distance_m) <= _NEAR_M]
    if len(near) == 1 or (distance_m is None and len(at) == 1):
        return (near or at)[0]
    listed = ", ".join(f"{one:.1f}" for one in at[:8])
    if distance_m is None:
        raise InputError(f"bright targets stand at {listed} m", file=name, fix=f"say which: SCAN@{at[0]:.1f}")
    what = f"no bright target within {_NEAR_M:g} m of {distance_m:g} m; there are some at {listed} m"
    raise InputError(what, file=name, fix="name the distance of one of them")


def _of_table(file: Path, sensor: Sensor, axis: Axis, distance_m: float | None) -> BesideTarget:
    """A profile as its CSV table has it."""
    if profile_axis(file) != axis:
        raise InputError(f"is a {profile_axis(file)} profile", file=file, fix=f"{axis} ones are asked for")
    first, *rest = rows_of(file)
    header = [name.strip().lower() for name in first]
    own = next((name for name in header if name in BEAM_OFFSETS), None)
    if own is None:
        what = f"counts SPAD rows or columns, and {sensor.name} is no SPAD array"
        raise InputError(what, file=file, line=1, fix=f"name columns {', '.join(BEAM_OFFSETS)}")
    names = {f.name: (f.name.lower(), *(alias.lower() for alias in f.aliases)) for f in sensor.features}
    columns = {name: next((header.index(n) for n in known if n in header), None) for name, known in names.items()}
    columns = {name: at for name, at in columns.items() if at is not None}
    if not columns:
        raise InputError(f"has none of {', '.join(names)}", file=file, line=1, fix="give at least one of them")
    numbered = [(line, row) for line, row in enumerate(rest, start=2) if any(cell.strip() for cell in row)]
    offset = np.array([number_of(row, header.index(own), line, file, needed=True) for line, row in numbered])
    order = np.argsort(offset, kind="stable")
    ranges = header.index("range_m") if "range_m" in header else None
    table = {
        name: np.array([number_of(row, at, line, file) for line, row in numbered])[order]
        for name, at in {"range_m": ranges, **columns}.items()
    }
    range_m = table.pop("range_m")
    known = range_m[np.isfinite(range_m)]
    at_m = distance_m if distance_m is not None else float(np.mean(known)) if len(known) else float("nan")
    if not at_m > 0.0:
        raise InputError("has no ranges", file=file, fix="name the distance as PROFILE@DISTANCE")
    echoes = np.any([np.isfinite(values) for values in table.values()], axis=0).astype(np.int64)
    return BesideTarget(file.name, axis, at_m, offset[order], echoes, range_m, table)
