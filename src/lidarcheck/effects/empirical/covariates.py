"""What empirical terms may depend on, of pulses, of echoes and of beams.

`range_m`, `layer` and `point` are of the pulse or echo itself. `incidence_deg`, `material_id` and `signal_log10` are
of the surface that a pulse comes from, or of the one on the echo's beam that is nearest to it in range; `signal_log10`
is the logarithm of S by the range equation, before any effect. `area_log10`, `peak_log10` and `width_ns` are of the
echo itself.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.scan import IdealScan, Light, Scan

__all__ = [
    "COVARIATES",
    "ECHO_COVARIATES",
    "FEATURES",
    "BeamColumns",
    "EchoColumns",
    "PulseColumns",
    "keys_of",
    "nearest_rows",
]

COVARIATES = ("range_m", "layer", "point", "incidence_deg", "material_id", "signal_log10")
FEATURES = ("area_log10", "peak_log10", "width_ns")
"""What only an echo has."""
ECHO_COVARIATES = (*COVARIATES, *FEATURES)

_FAINTEST = 1e-9
"""The S of a surface that returns nothing: faint beyond every knot, yet with a logarithm."""


class PulseColumns:
    """The covariates of the pulses of a light, by name; shape (n_pulses,)."""

    def __init__(self, light: Light, around: Surroundings) -> None:
        self._light, self._around = light, around

    def __call__(self, name: str) -> FloatArray:
        """The covariate of that name."""
        light = self._light
        if name == "range_m":
            return light.pulse_range_m
        if name in ("layer", "point"):
            return np.repeat(getattr(light, name), np.diff(light.first_pulse)).astype(np.float64)
        return _of_rows(name, light.rows(), self._around)


class EchoColumns:
    """The covariates of the echoes of a scan, by name; shape (n_echoes,)."""

    def __init__(self, scan: Scan, around: Surroundings) -> None:
        self._scan, self._around = scan, around
        self._rows: IndexArray | None = None

    def __call__(self, name: str) -> FloatArray:
        """The covariate of that name."""
        scan = self._scan
        if name == "range_m":
            return scan.range_m
        if name in ("layer", "point"):
            return np.asarray(getattr(scan, name), dtype=np.float64)
        if name in FEATURES:
            return _feature(name, scan)
        if self._rows is None:
            self._rows = nearest_rows(scan, self._around.ideal)
        return _of_rows(name, self._rows, self._around)


class BeamColumns:
    """The covariates of all beams of an ideal scan in ascending (layer, point), by name; shape (n_beams,).

    `rows`: of the surface that returns most of each beam's light; `range_m` is that surface's, and what only
    an echo has is of the beam's largest echo, NaN where there is none.
    """

    def __init__(self, scan: Scan, around: Surroundings) -> None:
        self._scan, self._around = scan, around
        ideal = around.ideal
        key = keys_of(ideal)
        if bool(np.all(key[1:] > key[:-1])):
            self.keys, self.rows = key, np.arange(len(key))
        else:
            order = np.lexsort((around.signal(ideal) * ideal.shares(), key))
            last = np.flatnonzero(np.append(key[order][1:] != key[order][:-1], True))
            self.keys, self.rows = key[order][last], order[last]
        self.layer, self.point = ideal.layer[self.rows], ideal.point[self.rows]
        distance_m = ideal.distance_m[self.rows]
        self.range_m = np.where(distance_m > 0.0, distance_m, np.nan)

    def __call__(self, name: str) -> FloatArray:
        """The covariate of that name."""
        if name == "range_m":
            return self.range_m
        if name in ("layer", "point"):
            return np.asarray(getattr(self, name), dtype=np.float64)
        if name in FEATURES:
            return self._of_largest(_feature(name, self._scan))
        return _of_rows(name, self.rows, self._around)

    def _of_largest(self, values: FloatArray) -> FloatArray:
        """Each beam's value of its echo of the largest AREA, of the first of several."""
        scan = self._scan
        key = keys_of(scan)
        order = np.lexsort((-scan.echo_number.astype(np.int64), scan.area, key))
        last = order[np.flatnonzero(np.append(key[order][1:] != key[order][:-1], True)[: len(order)])]
        beam = np.searchsorted(self.keys, key[last])
        fired = beam < len(self.keys)
        fired[fired] = self.keys[beam[fired]] == key[last][fired]
        found = np.full(len(self.keys), np.nan)
        found[beam[fired]] = values[last[fired]]
        return found


def _feature(name: str, scan: Scan) -> FloatArray:
    if name == "width_ns":
        return np.asarray(scan.width_ns, dtype=np.float64)
    return np.asarray(elementary.log10(np.maximum(scan.strength if name == "area_log10" else scan.peak, 1.0)))


def keys_of(table: Scan | IdealScan) -> IndexArray:
    """A number for each row's beam, in the order of (layer, point); shape (n,)."""
    return table.layer.astype(np.int64) << 32 | table.point


def nearest_rows(scan: Scan, ideal: IdealScan) -> IndexArray:
    """The row of the ideal scan that each echo's beam meets nearest in range to it, shape (n,); -1 for no surface."""
    hit = np.flatnonzero(ideal.distance_m > 0.0)
    key = keys_of(ideal)[hit]
    if not bool(np.all(key[1:] >= key[:-1])):
        order = np.argsort(key, kind="stable")
        hit, key = hit[order], key[order]
    asked = keys_of(scan)
    first, last = np.searchsorted(key, asked), np.searchsorted(key, asked, side="right")
    distance_m = np.append(ideal.distance_m[hit], np.inf)
    range_m = scan.range_m
    best = first.copy()
    for step in range(1, int((last - first).max(initial=0))):
        other = np.minimum(first + step, last - 1)
        other = np.where(last > first, other, first)
        nearer = np.abs(distance_m[other] - range_m) < np.abs(distance_m[best] - range_m)
        best = np.where(nearer, other, best)
    return np.where(last > first, np.append(hit, -1)[best], -1)


def _of_rows(name: str, rows: npt.NDArray[np.integer], around: Surroundings) -> FloatArray:
    """A covariate of rows of the ideal scan; NaN for row -1 and for what meets nothing."""
    ideal = around.ideal
    values = np.full(len(rows), np.nan)
    known = np.flatnonzero(rows >= 0)
    known = known[ideal.distance_m[rows[known]] > 0.0]
    if name == "signal_log10":
        column = elementary.log10(np.maximum(around.signal(ideal), _FAINTEST))
    else:
        column = np.asarray(getattr(ideal, name), dtype=np.float64)
    values[known] = column[rows[known]]
    return values
