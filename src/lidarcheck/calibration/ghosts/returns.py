"""Returns: the echoes of a scan put together where they are one surface's light, and how bright ones are told.

A retro-reflector sends back so much light that its SPADs avalanche again after their dead time: its AREA passes what
all detectors give that fire once. No ordinary surface does that but very close ones. The second avalanches follow as a
longer echo or, where all SPADs fell silent in between, as an echo of their own: both are one return, whose range is
that of all its light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.echoes import amplitude, place_of
from lidarcheck.errors import InputError
from lidarcheck.kpi.features import STAND_INS
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, SpadArray, reference_beams, shipped, shipped_names

__all__ = ["Brightness", "Returns", "SearchEchoes", "brightness", "grid_steps", "returns_of", "sensor_of"]

FIRED_TWICE = 1.1
"""AREA over that of all detectors firing once, from which on an echo is a retro-reflector's."""
FIRED_ONCE = 0.85
"""The same for a sign that is saturated and no more; it then takes a ghost to tell it from a near wall."""
FIRED_FAR = 0.95
"""The same at ranges from which no ordinary surface sends back enough light for that."""
ORDINARY_FIRES = 1.1
"""Avalanches per SPAD and shot up to which a surface leaves every third detector without an avalanche."""
STRONG = 0.25
"""The same for both echoes of a return that fell apart."""
AGAIN_M = 2.4
"""How far behind an echo that of the same SPADs' next avalanches may stand: a dead time and a pulse."""
FAR_ABOVE = 0.5
"""Of a calibrated reflectivity, how far a sign lies above a white surface: half of the way to the largest value."""
BRIGHTEST_SHARE = 0.01


@dataclass(frozen=True)
class Brightness:
    """How bright returns are told from others: `column`'s values of the echoes (n,), the least, and why that.

    `far_above`: the least at `far_m` and beyond. `strong`: what each echo of a return has that fell apart; infinite
    where echoes are not put together. `relative`: bright only beside the scan's other echoes. `most`: what the sensor
    reports of all that is brighter.
    """

    column: str
    values: FloatArray
    above: float
    why: str
    far_above: float
    far_m: float = float("inf")
    strong: float = float("inf")
    relative: bool = False
    most: float = float("inf")


@dataclass(frozen=True)
class Returns:
    """What comes back from one surface on one beam: an echo, or several that belong together; shapes (m,).

    `layer`, `point`: row and column of the beam as it stands. `of` (n,): the return of each echo. `amplitude`: the sum
    of its echoes', `range_m`: their mean, weighted by it.
    """

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    range_m: FloatArray
    amplitude: FloatArray
    of: IndexArray

    def bright(self, bright: Brightness) -> IndexArray:
        """Those that are bright on a known beam."""
        least = np.where(self.range_m < bright.far_m, bright.above, bright.far_above)
        return np.flatnonzero((self.amplitude >= least) & (self.layer >= 0) & (self.point >= 0))


@dataclass(frozen=True)
class SearchEchoes:
    """What a search needs of echoes, shapes (n,): row and column of the beam as it stands, the way from its origin,
    amplitude, and the return that each is part of."""

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    range_m: FloatArray
    amplitude: FloatArray
    of: IndexArray

    def take(self, rows: IndexArray) -> SearchEchoes:
        """The same of some rows."""
        return SearchEchoes(self.layer[rows], self.point[rows], self.range_m[rows], self.amplitude[rows], self.of[rows])


def sensor_of(scan: Scan) -> SpadArray | None:
    """The built-in sensor whose saturation the PEAKs fit; None for other beams, or without PEAK or AREA."""
    if {"PEAK", "AREA"} & set(scan.defaulted) or not len(scan) or scan.beams != reference_beams():
        return None
    own = [one for name in shipped_names() if isinstance(one := shipped(name), SpadArray) and one.beams == scan.beams]
    own.sort(key=lambda one: one.peak_saturation)
    return next((one for one in own if scan.peak.max() <= one.peak_saturation), own[-1])


def brightness(scan: Scan, sensor: Sensor | None, above: float | None = None, *, once: bool = False) -> Brightness:
    """What counts as bright: `above` where it is given, else by the sensor's detectors or by what no ordinary surface
    reports, else the brightest 1 %.

    `once`: also what all detectors of a SPAD array fired for only once. `InputError` for a scan without any amplitude.
    """
    column, values = amplitude(scan, sensor)
    if not column:
        raise InputError(
            f"the scan has no amplitude: no AREA, PEAK, {', '.join(STAND_INS)}",
            fix="a sign is told by its brightness; give a scan with one of these columns",
        )
    counted = sensor if isinstance(sensor, SpadArray) and column == "AREA" else None
    once_all = float("inf") if counted is None else float(counted.detectors * counted.on_bins)
    if above is not None:
        return Brightness(column, values, above, "as given", above, strong=STRONG * once_all)
    if counted is not None:
        level = FIRED_ONCE if once else FIRED_TWICE
        why = f"{level:g} x {counted.detectors} detectors of {counted.variant} x {counted.on_bins} bins"
        far_m = float(np.sqrt(counted.signal_at_1m / ORDINARY_FIRES))
        return Brightness(
            column, values, level * once_all, why, min(FIRED_FAR, level) * once_all, far_m, STRONG * once_all
        )
    if (white := _above_white(sensor, column)) is not None:
        return Brightness(column, values, white[0], f"far above {white[1]}", white[0], most=white[2])
    least = float(np.quantile(values, 1.0 - BRIGHTEST_SHARE)) if len(values) else 0.0
    return Brightness(column, values, least, f"the brightest {100 * BRIGHTEST_SHARE:g} %", least, relative=True)


def _above_white(sensor: Sensor | None, column: str) -> tuple[float, str, float] | None:
    """Where the sensor calibrates its amplitude: the least value far above a white surface's, that, and the largest."""
    feature = next((f for f in (() if sensor is None else sensor.features) if f.name == column), None)
    if sensor is None or feature is None or feature.law != "calibrated_reflectivity" or feature.most is None:
        return None
    knee = float(feature.numbers.get("knee", 100.0))
    least = min(knee + FAR_ABOVE * (feature.most - knee), feature.most)
    what = f"the {knee:g} of a white surface, as {sensor.name} reports it"
    return (least, what, feature.most) if least > knee else None


def returns_of(scan: Scan, range_m: FloatArray, bright: Brightness) -> Returns:
    """The echoes put together where they belong to one return; `range_m` of all echoes, shape (n,)."""
    n = len(scan)
    row, column = place_of(scan.beams, scan.layer, scan.point)
    keys = beam_keys(scan.layer, scan.point)
    strong = np.flatnonzero(bright.values >= bright.strong)
    order = strong[np.lexsort((range_m[strong], keys[strong]))]
    again = (np.diff(keys[order]) == 0) & (np.diff(range_m[order]) <= AGAIN_M)
    first = np.arange(n)
    if len(order):
        start = np.concatenate([[True], ~again])
        head = order[np.maximum.accumulate(np.where(start, np.arange(len(order)), 0))]
        near = range_m[order] - range_m[head] <= AGAIN_M
        first[order[near]] = head[near]
    heads, of = np.unique(first, return_inverse=True)
    amplitude: FloatArray = np.bincount(of, bright.values, len(heads)).astype(np.float64)
    moment = np.bincount(of, bright.values * range_m, len(heads))
    alone = np.bincount(of, minlength=len(heads)) == 1
    together_m = range_m[heads]
    together_m[~alone] = moment[~alone] / amplitude[~alone]
    return Returns(row[heads], column[heads], together_m, amplitude, of)


def grid_steps(layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]) -> tuple[int, int]:
    """Distance of neighbouring layers and points of beams, in indices: 2 where every second one was fired."""
    return _step(layer), _step(point)


def _step(index: npt.NDArray[np.int32]) -> int:
    known = index[index >= 0]
    gaps = np.diff(np.flatnonzero(np.bincount(known))) if len(known) else np.zeros(0, dtype=np.int64)
    return int(np.argmax(np.bincount(gaps))) if len(gaps) else 1
