"""What calibration looks at of echoes: how strong they are, their features, their ways, where their beams stand."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.features import STAND_INS, feature_column, strength_name
from lidarcheck.kpi.lattice import lattice_of
from lidarcheck.kpi.pairing import paths
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams, Sensor

__all__ = ["amplitude", "echo_features", "features_of", "place_of", "ways"]

_COUNTED = {"AREA": "", "PEAK": "", "WIDTH": "ns"}
"""What a SPAD array counts, and the units that are shown: PEAK and AREA count detectors."""
_OF_BEAM = ("histogram", "background")
"""Laws of features that belong to a beam, not to its echoes."""


def amplitude(scan: Scan, sensor: Sensor | None = None) -> tuple[str, FloatArray]:
    """Name and values of the column that tells an echo's strength, shape (n,); empty name and NaN without one.

    The sensor's own strength comes first, then AREA, what other sensors bring in its place, PEAK, and a confidence.
    """
    own = {} if sensor is None else {f.name: f.aliases for f in sensor.features}
    confidence = [] if sensor is None else [f.name for f in sensor.features if f.law == "confidence"]
    for name in dict.fromkeys((strength_name(sensor), "AREA", *STAND_INS, "PEAK", *confidence)):
        values = feature_column(scan, name, own.get(name, ())) if name else None
        if values is not None:
            return name, values
    return "", np.full(len(scan), np.nan)


def echo_features(sensor: Sensor) -> tuple[str, ...]:
    """The names of the features that a sensor reports of each echo."""
    return tuple(feature.name for feature in sensor.features if feature.law not in _OF_BEAM)


def features_of(scan: Scan, sensor: Sensor | None = None) -> dict[str, tuple[str, FloatArray]]:
    """The features of echoes that the scan has: name to unit and values, shape (n,)."""
    own = {} if sensor is None else {f.name: f for f in sensor.features if f.law not in _OF_BEAM}
    found: dict[str, tuple[str, FloatArray]] = {}
    for name in dict.fromkeys((*_COUNTED, *own, *(() if sensor else scan.features), *STAND_INS)):
        feature = own.get(name)
        values = feature_column(scan, name, () if feature is None else feature.aliases)
        if values is not None:
            found[name] = (_COUNTED.get(name, "" if feature is None else feature.unit), values)
    return found


def ways(scan: Scan) -> FloatArray:
    """From each beam's origin to its echoes [m], shape (n,), as exact as the scan is."""
    return scan.range_m if scan.beams.central else paths(scan)


def place_of(beams: Beams, layer: IntArray, point: IntArray) -> tuple[IntArray, IntArray]:
    """Row and column of beams as they stand; numbers that are no beam of the sensor stay.

    `UsageError` for beams without neighbours by their numbers.
    """
    lattice = lattice_of(beams)
    if lattice is None:
        what = "these beams have no neighbours by their numbers, and what is looked for lies on neighbours"
        raise UsageError(what, fix="use a sensor with lines and columns")
    return lattice.row(layer), lattice.column(layer, point)
