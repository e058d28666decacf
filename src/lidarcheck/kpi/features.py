"""Which features two scans are compared by: those that both have, by the names that their sensor gives them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.scan import COUNTED, Scan
from lidarcheck.sensor import Feature, Sensor

__all__ = [
    "COLUMNS",
    "STAND_INS",
    "ComparedFeature",
    "Decades",
    "decades_of",
    "feature_column",
    "features_apart",
    "features_to_compare",
    "strength_name",
]

COLUMNS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {"PEAK": ("peak", ""), "AREA": ("area", ""), "WIDTH": ("width_ns", "ns")}
)
"""Standard features: column of the scan, unit where no sensor is given (PEAK and AREA count detectors)."""
STAND_INS = ("INTENSITY", "SIGNAL", "REFLECTIVITY")
"""What sensors without PEAK and AREA bring, where no sensor is given that names its features."""
_MONOTONE = ("area_counts", "photons", "affine", "log", "range_corrected", "calibrated_reflectivity", "table")
"""Laws whose value rises with the amplitude."""
_MOST_DECIMALS = 6
_OFF, _OFF_SINGLE = 2.0**-48, 2.0**-23
"""How far numbers of 64 and of 32 bits may lie off their decimals, as a part of them."""


@dataclass(frozen=True)
class ComparedFeature:
    """A feature that two scans have: its `values`, measured and simulated, (n,) and (m,), NaN where a row has none."""

    name: str
    unit: str
    values: tuple[FloatArray, FloatArray]

    @property
    def known(self) -> tuple[FloatArray, FloatArray]:
        """The values of the rows that have one."""
        m, s = (side[~np.isnan(side)] if np.isnan(side).any() else side for side in self.values)
        return m, s


def feature_column(scan: Scan, name: str, aliases: Iterable[str] = ()) -> FloatArray | None:
    """A feature of the scan, shape (n,), or None where its source did not have it.

    Columns that the reader knew as no feature are found by name or alias, in any case.
    """
    if name in scan.features or (name in COUNTED and name not in scan.defaulted):
        return np.asarray(scan.feature(name), dtype=np.float64)
    if name in COUNTED:
        return None
    named = {key.upper(): key for key in scan.extra}
    for asked in (name, *aliases):
        if (found := named.get(asked.upper())) is not None:
            return np.asarray(scan.extra[found], dtype=np.float64)
    return None


def features_to_compare(measured: Scan, simulated: Scan, sensor: Sensor | None = None) -> dict[str, Feature]:
    """The features that are looked for, by name, the standard ones first: those of the sensor and of the scans."""
    own = {} if sensor is None else {f.name: f for f in sensor.features if f.law != "histogram"}
    others = [*STAND_INS, *measured.features, *simulated.features]
    names = dict.fromkeys((*(own or COLUMNS), *others))
    standard = [name for name in COLUMNS if name in names]
    return {
        name: own.get(name, Feature(name, "", unit=COLUMNS.get(name, ("", ""))[1]))
        for name in dict.fromkeys((*standard, *names))
    }


def features_apart(
    measured: Scan, simulated: Scan, sensor: Sensor | None, left_out: dict[str, str]
) -> Iterator[ComparedFeature]:
    """The features that both scans have; into `left_out` go those that one lacks, and why."""
    expected = COLUMNS if sensor is None else [feature.name for feature in sensor.features]
    for name, feature in features_to_compare(measured, simulated, sensor).items():
        m, s = (feature_column(scan, name, feature.aliases) for scan in (measured, simulated))
        if m is not None and s is not None:
            yield ComparedFeature(name, feature.unit, (m, s) if name in COLUMNS else _alike(m, s))
        elif name in expected or m is not None or s is not None:
            lacking = [side for side, column in (("measured", m), ("simulated", s)) if column is None]
            left_out[name] = f"not in the {' nor in the '.join(lacking)} scan"


def _alike(m: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both to the coarser of the two sides' steps: differences below it are those of the files."""
    single = [side.size > 0 and np.array_equal(side, side.astype(np.float32), equal_nan=True) for side in (m, s)]
    decimals = [
        found
        for side, half in zip((m, s), single, strict=True)
        if (found := _decimals(side, _OFF_SINGLE if half else _OFF)) is not None
    ]
    if decimals:
        return np.round(m, min(decimals)), np.round(s, min(decimals))
    return (m.astype(np.float32).astype(np.float64), s.astype(np.float32).astype(np.float64)) if any(single) else (m, s)


def _decimals(values: FloatArray, off: float) -> int | None:
    """How many decimals the values are written with, up to 6; None for more, and without a value.

    `off`: how far rounding leaves a number beside its decimals, as a part of it.
    """
    some = np.abs(values[np.isfinite(values)])
    for decimals in range(_MOST_DECIMALS + 1) if some.size else ():
        if float(some.max()) * off > 0.1 * 10.0**-decimals:
            return None
        if np.all(np.abs(some - np.round(some, decimals)) <= off * some):
            return decimals
    return None


def strength_name(sensor: Sensor | None = None) -> str:
    """The feature that says how strong an echo is: AREA; of another sensor its `strength`, else the first of its
    features whose law rises with the amplitude; empty where it has none."""
    if sensor is None:
        return "AREA"
    return sensor.strength or next((f.name for f in sensor.features if f.law in _MONOTONE), "")


@dataclass(frozen=True)
class Decades:
    """A feature cut into decades of what it says of the amplitude.

    `gain`: by how much the feature rises in a decade where it is a logarithm, from `offset` on; else None, and its
    own values have the decades.
    """

    name: str = "AREA"
    offset: float = 0.0
    gain: float | None = None

    def log10(self, values: FloatArray) -> FloatArray:
        """Where each value lies, in decades; NaN for those that lie nowhere, shape (n,)."""
        if self.gain is not None:
            return np.asarray((values - self.offset) / self.gain)
        return np.asarray(elementary.log10(np.where(values > 0.0, values, np.nan)))

    def of(self, values: FloatArray) -> FloatArray:
        """The decade of each value, NaN for those that have none, shape (n,)."""
        return np.asarray(np.floor(self.log10(values)))

    def words(self, decade: float) -> str:
        """The feature and the values of a decade, as `AREA 100–1000`."""
        if self.gain is not None:
            low = self.offset + self.gain * decade
            return f"{self.name} {low:g}–{low + self.gain:g}"
        low = 10.0**decade
        return f"{self.name} {low:g}–{10.0 * low:g}"


def decades_of(sensor: Sensor | None = None) -> Decades | None:
    """The decades of the sensor's strength; None where it reports nothing of the kind."""
    name = strength_name(sensor)
    feature = next((f for f in (sensor.features if sensor is not None else ()) if f.name == name), None)
    if feature is None or feature.law != "log":
        return Decades(name) if name else None
    gain, offset = (float(feature.numbers.get(key, default)) for key, default in (("gain", 1.0), ("offset", 0.0)))
    return Decades(name, offset, gain) if gain > 0.0 else None
