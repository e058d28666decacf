"""What a scene comparison compares: each beam's view of each object, in the measured and the simulated frames.

A unit is a beam and an object that the beam meets; a beam that meets nothing is a unit of no object. Its values are
those of the echo that comes from the object's surface (within 2 m), the strongest where there are several. Echoes of
no surface count, as stray echoes, for the unit of the beam's nearest object.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.echoes import amplitude
from lidarcheck.kpi.features import feature_column
from lidarcheck.kpi.pairing import Pairing, beam_keys, pair_with_ideal
from lidarcheck.scan import COUNTED, IdealScan, Scan
from lidarcheck.sensor import Beams

__all__ = [
    "FEATURES",
    "NOTHING",
    "Feature",
    "Units",
    "Values",
    "features_in",
    "joined_units",
    "joined_values",
    "units_of",
    "values_of",
]

NOTHING = -1
"""The label of a unit whose beam meets nothing."""


@dataclass(frozen=True)
class Feature:
    """One quantity of a unit. `counts`: a number of echoes, defined without one too; `column`: what it is made of."""

    name: str
    title: str
    unit: str
    counts: bool = False
    column: str = ""


FEATURES = (
    Feature("echo", "echo from the surface", "", counts=True),
    Feature("stray", "stray echoes", "", counts=True),
    Feature("range_residual", "range residual", "m"),
    Feature("log10_area", "log10 AREA", "", column="AREA"),
    Feature("peak", "PEAK", "", column="PEAK"),
    Feature("width", "WIDTH", "ns", column="WIDTH"),
)
"""What is compared of scans of SPAD arrays, in the order of reading; other sensors have features of their own."""


@dataclass(frozen=True)
class Units:
    """Beams and the objects that they meet, shape (n,) each, in ascending (beam, label).

    `frame`: which frame; `label`: the object's number, -1 for nothing; `distance_m`: of its nearest surface, 0 for
    nothing; `first`: whether it is its beam's nearest. `unit_of_row` (n_rows,) and `first_of_beam` (n_beams,) tell
    where the echoes of one frame belong. `beams`: the sensor's.
    """

    frame: IndexArray
    layer: IndexArray
    point: IndexArray
    label: IndexArray
    material: IndexArray
    distance_m: FloatArray
    first: BoolArray
    unit_of_row: IndexArray
    first_of_beam: IndexArray
    beams: Beams

    def __len__(self) -> int:
        return len(self.layer)

    @functools.cached_property
    def angles_deg(self) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of the units' beams [deg], shapes (n,)."""
        return self.beams.angles_deg(self.layer, self.point)


@dataclass(frozen=True)
class Values:
    """A scan's values of the units, shape (n,) each, by the name of the feature; NaN where there is none.

    `stray_offset_m`: how far behind the unit's surface its last stray echo lies, NaN without one.
    """

    of: dict[str, FloatArray]
    stray_offset_m: FloatArray


def units_of(ideal: IdealScan, labels: IndexArray, frame: int = 0) -> Units:
    """The units of an ideal scan whose rows have `labels`, shape (n_rows,), 0 or more."""
    beams, beam = np.unique(beam_keys(ideal.layer, ideal.point), return_inverse=True)
    hit = ideal.distance_m > 0.0
    meets = np.zeros(len(beams), dtype=np.bool_)
    meets[beam[hit]] = True
    most = int(labels.max(initial=0)) + 2
    key = beam * most + np.where(hit, labels + 1, 0)
    # A beam that misses with a part of its light and meets something with the rest is no unit of nothing.
    rows = np.flatnonzero(hit | ~meets[beam])
    order = rows[np.lexsort((ideal.distance_m[rows], key[rows]))]
    new = np.append(True, np.diff(key[order]) > 0)[: len(order)]
    unit_of_row = np.full(len(ideal), -1, dtype=np.int64)
    unit_of_row[order] = np.cumsum(new) - 1
    nearest = order[new]
    distance = np.where(hit[nearest], ideal.distance_m[nearest], 0.0)
    by_beam = np.lexsort((distance, beam[nearest]))
    first_of_beam = by_beam[np.append(True, np.diff(beam[nearest][by_beam]) > 0)[: len(by_beam)]]
    first = np.zeros(len(nearest), dtype=np.bool_)
    first[first_of_beam] = True
    return Units(
        frame=np.full(len(nearest), frame, dtype=np.int64),
        layer=ideal.layer[nearest].astype(np.int64),
        point=ideal.point[nearest].astype(np.int64),
        label=np.where(hit[nearest], labels[nearest], NOTHING).astype(np.int64),
        material=np.where(hit[nearest], ideal.material_id[nearest], NOTHING).astype(np.int64),
        distance_m=distance,
        first=first,
        unit_of_row=unit_of_row,
        first_of_beam=first_of_beam,
        beams=ideal.beams,
    )


def values_of(units: Units, ideal: IdealScan, scan: Scan) -> tuple[Values, Pairing]:
    """What a scan shows of the units, and how its echoes are paired with the ideal scan."""
    pairing = pair_with_ideal(ideal, scan)
    own = np.flatnonzero(pairing.of_surface)
    unit = units.unit_of_row[pairing.surface[own]]
    echo = np.full(len(units), -1, dtype=np.int64)
    echo[unit] = own
    # Where a unit has several, ascending strength: the last written, and so kept, is the strongest.
    several = np.flatnonzero(np.bincount(unit, minlength=len(units))[unit] > 1)
    order = several[np.argsort(np.nan_to_num(amplitude(scan)[1][own[several]]), kind="stable")]
    echo[unit[order]] = own[order]
    found = echo >= 0
    met = units.label != NOTHING
    of = {"echo": np.where(met, found.astype(np.float64), np.nan)}
    lost = np.flatnonzero(~pairing.of_surface)
    at = units.first_of_beam[pairing.echo_beam[lost]]
    false_echo = np.bincount(at, minlength=len(units)).astype(np.float64)
    of["stray"] = np.where(units.first, false_echo, np.nan)
    of["range_residual"] = _taken(pairing.residual_m, echo)
    for feature in FEATURES:
        column = feature_column(scan, feature.column) if feature.column else None
        if column is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                of[feature.name] = _taken(np.log10(column) if feature.column == "AREA" else column, echo)
    of |= {name: _taken(column, echo) for name, column in scan.features.items() if name not in COUNTED}
    offset = np.full(len(units), np.nan)
    offset[at] = scan.range_m[lost] - units.distance_m[at]
    return Values(of, np.where(met, offset, np.nan)), pairing


def features_in(*sides: Values) -> list[Feature]:
    """The features that all sides have, in the order of reading: those of SPAD arrays, then a sensor's own."""
    names = dict.fromkeys((*(f.name for f in FEATURES), *(name for side in sides for name in side.of)))
    known = {f.name: f for f in FEATURES}
    there = [name for name in names if all(name in side.of for side in sides)]
    return [known.get(name, Feature(name, name, "", column=name)) for name in there]


def _taken(column: FloatArray, echo: IndexArray) -> FloatArray:
    found = echo >= 0
    values = np.full(len(echo), np.nan)
    values[found] = column[echo[found]]
    return np.where(np.isfinite(values), values, np.nan)


def joined_units(parts: Sequence[Units]) -> Units:
    """The units of all frames, one after the other; what leads to rows and beams of one frame is left behind."""
    if len(parts) == 1:
        return parts[0]
    names = ("frame", "layer", "point", "label", "material", "distance_m", "first")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    nothing = np.zeros(0, dtype=np.int64)
    return Units(**columns, unit_of_row=nothing, first_of_beam=nothing, beams=parts[0].beams)


def joined_values(parts: Sequence[Values]) -> Values:
    """The values of all frames, of the features that all have."""
    if len(parts) == 1:
        return parts[0]
    names = [feature.name for feature in features_in(*parts)]
    of = {name: np.concatenate([part.of[name] for part in parts]) for name in names}
    return Values(of, np.concatenate([part.stray_offset_m for part in parts]))
