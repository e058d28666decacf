"""Vehicles at several distances: PEAK, AREA and WIDTH of the real one against those of the simulated one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.scenes.checks import check_beams
from lidarcheck.calibration.vehicles.cut import Cut, CutSource, cut_vehicle, find_object
from lidarcheck.calibration.vehicles.kinds import Extent, VehicleKind
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.plain import plain
from lidarcheck.kpi.compare import feature_gap
from lidarcheck.kpi.comparison import FeatureGap
from lidarcheck.kpi.features import COLUMNS, feature_column, features_to_compare
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["AtDistance", "Pair", "VehicleComparison", "compare_vehicles", "joined", "stand_apart"]

KS_95 = 1.358
"""The Kolmogorov-Smirnov statistic that chance passes in 5 % of cases, times sqrt(n m / (n + m)): Smirnov's limit."""
APART_M, APART_SHARE = 1.5, 0.05
GRID_RATIO = 1.5


@dataclass(frozen=True)
class Pair:
    """A real and a simulated frame of a vehicle at one distance.

    `ideal`: what their beams meet, None where it is not known; `real_source`, `simulated_source`: what the vehicle is
    cut out by in either; `sensor`: what measured, where that is known. The ideal scan, and the object that has the
    vehicle's size in it, come in by themselves.
    """

    real: Scan
    simulated: Scan
    real_source: CutSource
    simulated_source: CutSource
    ideal: IdealScan | None = None
    sensor: Sensor | None = None


@dataclass(frozen=True)
class VehicleSide:
    """A vehicle in one scan: echoes, beams with one, size, centroid [m], and how it was cut out."""

    echoes: int
    beams: int
    extent: Extent
    centroid_m: tuple[float, float, float]
    how: str


@dataclass(frozen=True)
class AtDistance:
    """A vehicle at one distance [m] of its centroid.

    `detection_ratio`: beams with an echo, real over simulated; `detection_real`, `detection_simulated`: of the beams
    that meet the vehicle, the share with an echo from it, NaN without the ideal scan. `features`: by name; `ks_chance`:
    what `ks` passes by chance in one case of twenty. `samples`: by feature, real and simulated values; `cuts`:
    the vehicle's echoes, real and simulated.
    """

    distance_m: float
    real: VehicleSide
    simulated: VehicleSide
    detection_ratio: float
    detection_real: float
    detection_simulated: float
    features: Mapping[str, FeatureGap]
    ks_chance: Mapping[str, float]
    samples: Mapping[str, tuple[FloatArray, FloatArray]]
    cuts: tuple[Cut, Cut]

    @property
    def clouds(self) -> tuple[FloatArray, FloatArray]:
        """Positions, real and simulated, shape (n, 3) [m]."""
        return self.cuts[0].xyz_m, self.cuts[1].xyz_m


@dataclass(frozen=True)
class VehicleComparison:
    """A kind of vehicle at its distances, the nearest first; `left_out`: features that are not in all scans."""

    vehicle: str
    distances: tuple[AtDistance, ...]
    left_out: Mapping[str, str]

    def to_dict(self) -> dict[str, Any]:
        """The result for JSON, without the samples and points."""
        distances = [
            {name: plain(value) for name, value in vars(at).items() if name not in ("samples", "cuts")}
            for at in self.distances
        ]
        return {"vehicle": self.vehicle, "distances": distances, "left_out": plain(self.left_out)}


def compare_vehicles(vehicle: VehicleKind, pairs: Sequence[Pair]) -> VehicleComparison:
    """Compare a vehicle, cut out of each frame, real against simulated, at every distance.

    `InputError` names the file in which the vehicle is not found, has too few echoes, or stands elsewhere than in the
    other.
    """
    if not pairs:
        raise UsageError("there is no pair to compare", fix="give a real and a simulated frame")
    left_out: dict[str, str] = {}
    distances = [_at_distance(vehicle, pair, left_out) for pair in pairs]
    return VehicleComparison(vehicle.name, tuple(sorted(distances, key=lambda at: at.distance_m)), left_out)


def joined(parts: Sequence[VehicleComparison]) -> VehicleComparison:
    """Comparisons of one kind of vehicle at some distances, one or more, as one of all of them."""
    left_out = {name: why for part in parts for name, why in part.left_out.items()}
    distances = sorted((at for part in parts for at in part.distances), key=lambda at: at.distance_m)
    return VehicleComparison(parts[0].vehicle, tuple(distances), left_out)


def _at_distance(vehicle: VehicleKind, pair: Pair, left_out: dict[str, str]) -> AtDistance:
    pair = _with_object(vehicle, pair)
    real = cut_vehicle(pair.real, vehicle, pair.real_source)
    simulated = cut_vehicle(pair.simulated, vehicle, pair.simulated_source)
    _check_same(real, simulated, pair)
    samples, units = _samples(pair, real.scan, simulated.scan, left_out)
    shares = [_detected(pair.ideal, source, scan) for source, scan in _sides(pair)]
    return AtDistance(
        distance_m=0.5 * (real.distance_m + simulated.distance_m),
        real=_side(real),
        simulated=_side(simulated),
        detection_ratio=real.beams / simulated.beams,
        detection_real=shares[0],
        detection_simulated=shares[1],
        features={name: feature_gap(*both, unit=units[name]) for name, both in samples.items()},
        ks_chance={name: KS_95 * math.sqrt(1.0 / len(r) + 1.0 / len(s)) for name, (r, s) in samples.items()},
        samples=samples,
        cuts=(real, simulated),
    )


def _sides(pair: Pair) -> tuple[tuple[CutSource, Scan], tuple[CutSource, Scan]]:
    return (pair.real_source, pair.real), (pair.simulated_source, pair.simulated)


def _side(cut: Cut) -> VehicleSide:
    return VehicleSide(len(cut.scan), cut.beams, cut.extent, cut.centroid_m, cut.how)


def _with_object(vehicle: VehicleKind, pair: Pair) -> Pair:
    """The pair with the vehicle's object in the ideal scan, where that numbers its objects and no box is given."""
    for (source, scan), side in zip(_sides(pair), ("real", "simulated"), strict=True):
        if pair.ideal is not None:
            check_beams(scan, pair.ideal, side, source.file)
    if pair.ideal is None or pair.real_source.box is not None:
        return pair
    number = pair.real_source.object_id
    if pair.ideal.object_id is None:
        if number is not None:
            what = f"has no ObjectID, so no object {number}"
            raise InputError(what, file=pair.ideal.file or None, fix="leave out --object, or give a --box")
        return pair
    if number is None:
        number = find_object(pair.ideal, vehicle, pair.real_source.distance_m, pair.ideal.file)
    elif not np.any(pair.ideal.object_id[pair.ideal.distance_m > 0.0] == number):
        seen = np.unique(pair.ideal.object_id[pair.ideal.distance_m > 0.0]).tolist()
        some = ", ".join(map(str, seen[:12])) + (" ..." if len(seen) > 12 else "")
        raise InputError(f"no beam meets object {number}", file=pair.ideal.file or None, fix=f"it has {some}")
    real, simulated = (replace(source, ideal=pair.ideal, object_id=number) for source, _ in _sides(pair))
    return replace(pair, real_source=real, simulated_source=simulated)


def _check_same(real: Cut, simulated: Cut, pair: Pair) -> None:
    """Refuse a pair whose vehicles stand elsewhere, or were seen on other beam grids."""
    if stand_apart(real, simulated):
        what = f"its vehicle ({real.how}) is at {_at(real)}, the simulated one ({simulated.how}) at {_at(simulated)}"
        fix = "give the files of the same distance in the same order, or name it: FILE@25"
        raise InputError(what, file=pair.real_source.file or None, fix=fix)
    for axis in ("layer", "point"):
        steps = [_step(getattr(cut.scan, axis)) for cut in (real, simulated)]
        if max(steps) >= GRID_RATIO * min(steps) > 0.0:
            what = f"its vehicle has echoes on {axis}s {steps[0]:g} apart, the simulated one {steps[1]:g} apart"
            fix = "compare scans of one beam grid and variant"
            raise InputError(what, file=pair.real_source.file or None, fix=fix)


def stand_apart(real: Cut, simulated: Cut) -> bool:
    """Whether two cuts are farther apart than hidden or dark parts of one vehicle explain."""
    apart = float(np.linalg.norm(np.subtract(real.centroid_m, simulated.centroid_m)))
    return apart > APART_M + APART_SHARE * real.distance_m + 0.25 * real.extent.long_m


def _at(cut: Cut) -> str:
    x, y, z = cut.centroid_m
    return f"X {x:.1f}, Y {y:.1f}, Z {z:.1f} m"


def _step(index: npt.NDArray[np.int32]) -> float:
    """Usual distance between neighbouring lines that have echoes; 0 where that cannot be told."""
    lines = np.unique(index[index >= 0])
    return float(np.median(np.diff(lines))) if len(lines) > 5 else 0.0


def _samples(
    pair: Pair, real: Scan, simulated: Scan, left_out: dict[str, str]
) -> tuple[dict[str, tuple[FloatArray, FloatArray]], dict[str, str]]:
    """The features that both scans have, and their units; `InputError` where they share none."""
    samples, units = {}, {}
    expected = COLUMNS if pair.sensor is None else [feature.name for feature in pair.sensor.features]
    wanted = features_to_compare(real, simulated, pair.sensor)
    for name, feature in wanted.items():
        both = [feature_column(scan, name, feature.aliases) for scan in (real, simulated)]
        if both[0] is not None and both[1] is not None:
            samples[name] = (both[0], both[1])
            units[name] = COLUMNS[name][1] if name in COLUMNS else feature.unit
        elif name in expected or both[0] is not None or both[1] is not None:
            lacking = [file for one, file in zip(both, _files(pair), strict=True) if one is None]
            left_out[name] = f"not in {' nor in '.join(lacking)}"
    if not samples:
        what = f"has none of {', '.join(wanted)} that the simulated scan has too"
        fix = "compare scans that have PEAK, AREA or WIDTH" if pair.sensor is None else "compare scans that have one"
        raise InputError(what, file=pair.real_source.file or None, fix=fix)
    return samples, units


def _files(pair: Pair) -> tuple[str, str]:
    return pair.real_source.file or "the real scan", pair.simulated_source.file or "the simulated scan"


def _detected(ideal: IdealScan | None, source: CutSource, scan: Scan) -> float:
    """Share of the beams that meet the vehicle's object with an echo from it (2 m)."""
    if ideal is None or ideal.object_id is None or source.object_id is None:
        return math.nan
    own = (ideal.object_id == source.object_id) & (ideal.distance_m > 0.0)
    meet = np.unique(ideal.layer[own].astype(np.int64) << 32 | ideal.point[own])
    pairing = pair_with_ideal(ideal, scan)
    on = pairing.of_surface & own[np.maximum(pairing.surface, 0)]
    return len(np.unique(pairing.echo_beam[on])) / len(meet) if len(meet) else math.nan
