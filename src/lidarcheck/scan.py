"""The three tables that carry everything: what each beam meets, the light that comes back, the echoes.

Each is a frozen bundle of equally long numpy columns. The columns are made read-only, so that a stage that wants other
values must build a new table.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray, freeze, freeze_extra
from lidarcheck.beams import NOT_READ, BeamHistograms, Fired, Geometry
from lidarcheck.errors import UsageError
from lidarcheck.light import Haze, Light, PulseShape, light_of_beams
from lidarcheck.rays import Rays
from lidarcheck.sensor import Beams, reference_beams

__all__ = [
    "COUNTED",
    "ECHO_COLUMNS",
    "Haze",
    "IdealScan",
    "Light",
    "PulseShape",
    "Scan",
    "beams_of",
    "joined",
    "light_of_beams",
]

ECHO_COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
"""The fields of a `Scan` that hold a value an echo; `features` and `extra` hold further ones."""

COUNTED = {"PEAK": "peak", "AREA": "area", "WIDTH": "width_ns"}
"""The features of a SPAD array, by the names that sensors give them, and their fields of a `Scan`."""

_Rows = TypeVar("_Rows", "IdealScan", "Scan")


@dataclass(frozen=True)
class IdealScan:
    """What each fired beam meets, a row each; several rows of one (layer, point) are sub-beams, parts of its light.

    `distance_m` 0: nothing within range; NaN: nobody knows. `incidence_deg`: angle between beam and surface normal.
    `time_s`: from the frame's start. `share`: the part of the beam's light that a row stands for, 0 or more, where rows
    do not share equally, as with what stands behind glass. `rays`: the row's own ray, where it is not the beam's axis
    at the frame's start; kept while effects aim, never in a file. `extra`: unknown columns, kept. `file`: where it was
    read from, for messages. `beams`: the sensor's, whose numbers `layer` and `point` are. All columns have shape (n,).
    """

    layer: IntArray
    point: IntArray
    distance_m: FloatArray
    material_id: IntArray
    incidence_deg: FloatArray
    object_id: IntArray | None = None
    time_s: FloatArray | None = None
    share: FloatArray | None = None
    rays: Rays | None = None
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    defaulted: tuple[str, ...] = ()
    file: str = ""
    beams: Beams = field(default_factory=reference_beams, repr=False)

    def __post_init__(self) -> None:
        n = len(self.layer)
        ints = dict.fromkeys(("layer", "point", "material_id", "object_id"), np.int32)
        floats = dict.fromkeys(("distance_m", "incidence_deg", "time_s", "share"), np.float64)
        freeze(self, {**ints, **floats}, n)
        freeze_extra(self, n)
        if self.rays is not None and len(self.rays) != n:
            raise UsageError(f"{len(self.rays)} rays for a table of {n} rows")

    def __len__(self) -> int:
        return len(self.layer)

    @functools.cached_property
    def in_order(self) -> bool:
        """Whether each row is a beam of its own, in order of (layer, point)."""
        key = self.layer.astype(np.int64) << 32 | self.point
        return bool(np.all(key[1:] > key[:-1]))

    def shares(self) -> FloatArray:
        """The part of its beam's light that each row stands for, shape (n,): equal parts where `share` is None."""
        if self.share is not None:
            return self.share
        if self.in_order:
            return np.ones(len(self))
        key = self.layer.astype(np.int64) << 32 | self.point
        _, beam, rows = np.unique(key, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / rows[beam])

    def take(self, rows: npt.NDArray[Any]) -> IdealScan:
        """The rows picked by a mask or by indices."""
        return _take(self, rows)


@dataclass(frozen=True)
class Scan:
    """Echoes, a row each. Columns of shape (n,).

    `echo_number` counts the echoes of a beam from 1, in order of range. `width_ns`, `area` and `peak` are what a SPAD
    array counts of an echo, `features` what other sensors report, by its names there; `feature` gives either.
    `histograms`: of each beam, whether it has an echo or not. `made`: of simulated echoes, what the detector gave
    before features were made of it; never in a file. `beams`: the sensor's, whose numbers `layer` and `point` are.
    `extra` holds the columns that lidarcheck does not know, kept as they were read; `defaulted` names the standard
    columns (`WIDTH`, `Layer`, ...) that the source did not have, whose values here are defaults. `fired`: the beams
    that were fired, where the source itself tells, None where it does not: a beam without an echo may then have seen
    nothing or may never have been fired, and `lidarcheck.kpi.fired.fired_beams` asks who else knows. Picking echoes
    leaves it as it is. `geometry`: how the file that they were read from holds X, Y, Z against the beams.
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    layer: IntArray
    point: IntArray
    echo_number: IntArray
    width_ns: FloatArray
    area: FloatArray
    peak: FloatArray
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    defaulted: tuple[str, ...] = ()
    fired: Fired | None = None
    geometry: Geometry = NOT_READ
    features: Mapping[str, FloatArray] = field(default_factory=dict)
    histograms: BeamHistograms | None = None
    made: Mapping[str, FloatArray] = field(default_factory=dict)
    beams: Beams = field(default_factory=reference_beams, repr=False)

    def __post_init__(self) -> None:
        n = len(self.x_m)
        floats = dict.fromkeys(("x_m", "y_m", "z_m", "width_ns", "area", "peak"), np.float64)
        ints = dict.fromkeys(("layer", "point", "echo_number"), np.int32)
        freeze(self, {**floats, **ints}, n)
        freeze_extra(self, n)
        freeze_extra(self, n, "features")
        freeze_extra(self, n, "made")

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def range_m(self) -> FloatArray:
        """The range that each echo reports, shape (n,): its way from the beam's origin plus the range offset."""
        if self.beams.central or not len(self):
            return np.sqrt(self.x_m**2 + self.y_m**2 + self.z_m**2)
        known = self.beams.has(self.layer, self.point)
        found = np.sqrt(self.x_m**2 + self.y_m**2 + self.z_m**2)
        xyz = np.column_stack([self.x_m, self.y_m, self.z_m])[known]
        found[known] = self.beams.ranges_m(self.layer[known], self.point[known], xyz)
        return found

    def feature(self, name: str) -> FloatArray:
        """A feature by the name that the sensor gives it, shape (n,); `KeyError` where the scan has none of it."""
        return self.features[name] if name in self.features else np.asarray(getattr(self, COUNTED[name]))

    @property
    def strength(self) -> FloatArray:
        """What "strongest" compares, shape (n,): a simulated echo's amplitude before it is reported, else AREA."""
        return self.made.get("amplitude", self.area)

    @property
    def feature_names(self) -> tuple[str, ...]:
        """The features that the source has."""
        return (*(name for name in COUNTED if name not in self.defaulted), *self.features)

    def take(self, rows: npt.NDArray[Any]) -> Scan:
        """The rows picked by a mask or by indices."""
        return _take(self, rows)

    @classmethod
    def from_beams(
        cls,
        layer: IntArray,
        point: IntArray,
        range_m: FloatArray,
        *,
        echo_number: IntArray | None = None,
        width_ns: FloatArray | None = None,
        area: FloatArray | None = None,
        peak: FloatArray | None = None,
        features: Mapping[str, FloatArray] | None = None,
        beams: Beams | None = None,
    ) -> Scan:
        """Echoes of reported ranges `range_m` along their beams; `beams`: the built-in sensors' where None."""
        beams = reference_beams() if beams is None else beams
        xyz = beams.positions_m(layer, point, range_m)
        n = len(range_m)
        given = {"EchoNumber": echo_number, "WIDTH": width_ns, "AREA": area, "PEAK": peak}
        zeros = np.zeros(n)
        return cls(
            x_m=xyz[:, 0],
            y_m=xyz[:, 1],
            z_m=xyz[:, 2],
            layer=layer,
            point=point,
            echo_number=np.ones(n, dtype=np.int32) if echo_number is None else echo_number,
            width_ns=zeros if width_ns is None else width_ns,
            area=zeros if area is None else area,
            peak=zeros if peak is None else peak,
            features=features or {},
            beams=beams,
            defaulted=tuple(name for name, column in given.items() if column is None),
        )


def _take(table: _Rows, rows: npt.NDArray[Any]) -> _Rows:
    """A table of the same kind with those rows."""
    parts: dict[str, Any] = {}
    for f in fields(table):
        value = getattr(table, f.name)
        if f.name in ("extra", "features", "made"):
            parts[f.name] = {name: column[rows] for name, column in value.items()}
        elif value is None or isinstance(value, str | tuple | Fired | Beams | BeamHistograms):
            parts[f.name] = value
        elif isinstance(value, Rays):
            parts[f.name] = value.take(rows)
        else:
            parts[f.name] = value[rows]
    return type(table)(**parts)


def joined(scans: Sequence[Scan]) -> Scan:
    """The rows of all scans of one sensor, one below the other, with the features and extra columns that all have."""
    first = scans[0]
    columns: dict[str, Any] = {name: np.concatenate([getattr(scan, name) for scan in scans]) for name in ECHO_COLUMNS}
    for mapping in ("features", "made", "extra"):
        shared = [name for name in getattr(first, mapping) if all(name in getattr(scan, mapping) for scan in scans)]
        columns[mapping] = {name: np.concatenate([getattr(scan, mapping)[name] for scan in scans]) for name in shared}
    defaulted = tuple(dict.fromkeys(name for scan in scans for name in scan.defaulted))
    return Scan(**columns, defaulted=defaulted, beams=first.beams)


def beams_of(
    x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, beams: Beams | None = None
) -> tuple[IntArray, IntArray]:
    """Nearest (layer, point) of positions; -1 where the position lies outside the sensor's field of view."""
    return (reference_beams() if beams is None else beams).nearest(np.column_stack([x_m, y_m, z_m]))
