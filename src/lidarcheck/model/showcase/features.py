"""What the echoes of the demonstration are like, beam by beam: the numbers that curves are drawn of."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.model.light import surface_signal
from lidarcheck.model.showcase.scene import ABOVE, BESIDE, MATERIALS, RETRO, ideal_scan
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["Axis", "Features", "axes", "features", "stray_axes"]

_BELONGS_M = 3.0
"""An echo farther from what its beam meets belongs to something else; pile-up takes a bright one up to 1 m."""
_POINT = 0.75
"""Each point column sees surfaces of its own, so that any change sorts by it a little, and looks ragged."""
_STRAY = 0.7
"""Where strays stand says less than which beams have them."""
_RANGES_M = np.geomspace(1.0, 300.0, 25)
_RATIOS = np.linspace(0.0, 3.0, 31)


@dataclass(frozen=True)
class Axis:
    """What curves are drawn over: the bin of each beam, -1 for those left out, and where each bin stands.

    `weight` below 1: a change must be so much clearer on this axis to be shown on it.
    """

    name: str
    label: str
    bin: IndexArray
    at: FloatArray
    log: bool = False
    weight: float = 1.0


@dataclass(frozen=True)
class Features:
    """Of each run (first axis) and beam of the demonstration, shape (runs, n); NaN where there is no such thing.

    `detected`: 1 where an echo belongs to the surface. `area`, `peak`, `width_ns`, `residual_m`: of the first echo
    that belongs to the surface. `strays`: echoes that belong to none. `by_range`, `by_ratio`, shapes (runs, n, k):
    strays by their range, and by their range as a multiple of the surface's.
    """

    detected: FloatArray
    area: FloatArray
    peak: FloatArray
    width_ns: FloatArray
    residual_m: FloatArray
    strays: FloatArray
    by_range: FloatArray
    by_ratio: FloatArray


def features(runs: Sequence[Scan]) -> Features:
    """The features of several runs of the demonstration."""
    each = [_of_run(scan) for scan in runs]
    return Features(*(np.stack(column) for column in zip(*each, strict=True)))


def _of_run(scan: Scan) -> tuple[FloatArray, ...]:
    ideal = ideal_scan()
    n = len(ideal)
    key = ideal.beams.index(ideal.layer, ideal.point)
    reported = ideal.beams.index(scan.layer, scan.point)
    fired = np.isin(reported, key)
    scan, beam = scan.take(fired), np.searchsorted(key, reported[fired])
    surface = np.where(ideal.distance_m > 0.0, ideal.distance_m, np.nan)
    offset = scan.range_m - surface[beam]
    with np.errstate(invalid="ignore"):
        belongs = np.abs(offset) <= _BELONGS_M
    mine = _first(beam, scan.range_m, belongs)
    columns = np.full((4, n), np.nan)
    columns[:, beam[mine]] = [column[mine] for column in (scan.area, scan.peak, scan.width_ns, offset)]
    detected = np.where(np.isnan(surface), np.nan, np.isfinite(columns[3]))
    beam, range_m = beam[~belongs], scan.range_m[~belongs]
    strays = np.bincount(beam, minlength=n).astype(np.float64)
    by_range = _counts(beam, range_m, _RANGES_M, n)
    by_ratio = _counts(beam, range_m / surface[beam], _RATIOS, n)
    by_ratio[np.isnan(surface)] = np.nan
    return detected, *columns, strays, by_range, by_ratio


def _first(beam: IndexArray, range_m: FloatArray, eligible: BoolArray) -> IndexArray:
    """Of each beam the nearest eligible echo, where it has one: indices of echoes.

    A bright surface makes the SPADs fire twice; which of the two echoes is the larger is a matter of chance.
    """
    rows = np.flatnonzero(eligible)
    order = rows[np.lexsort((range_m[rows], beam[rows]))]
    return order[np.concatenate(([True], np.diff(beam[order]) > 0))] if len(order) else order


def _counts(beam: IndexArray, value: FloatArray, edges: FloatArray, n: int) -> FloatArray:
    """How many echoes of each beam fall into each bin, shape (n, k)."""
    k = len(edges) - 1
    place = np.searchsorted(edges, value, "right") - 1
    inside = (place >= 0) & (place < k) & np.isfinite(value)
    flat = np.bincount(beam[inside] * k + place[inside], minlength=n * k)
    return flat.reshape(n, k).astype(np.float64)


@functools.cache
def axes() -> list[Axis]:
    """What curves can be drawn over, the telling ones first."""
    ideal = ideal_scan()
    hit = ideal.distance_m > 0.0
    retro = hit & (ideal.material_id == RETRO)
    plain = hit & ~retro
    range_m = np.where(plain, ideal.distance_m, np.nan)
    reflectance = np.full(len(ideal), np.nan)
    for material_id, material in MATERIALS.items():
        reflectance[plain & (ideal.material_id == material_id)] = 100.0 * material.reflectance
    above = _offset(ideal.layer, ideal.point, retro)
    beside = _offset(ideal.point, ideal.layer, retro)
    above[np.abs(above) > ABOVE] = np.nan
    beside[np.abs(beside) > BESIDE] = np.nan
    incidence = np.where(plain, ideal.incidence_deg, np.nan)
    signal = np.where(plain, surface_signal(ideal, Model(Sensor.of("SMART"), MATERIALS)), np.nan)
    label = "signal of the surface [avalanches per SPAD and shot]"
    return [
        _binned("signal", label, signal, np.geomspace(0.05, 200.0, 19), log=True),
        _binned("incidence", "incidence on the surface [deg]", incidence, np.linspace(0.0, 90.0, 37)),
        _binned("range", "range of the surface [m]", range_m, np.arange(2.5, 90.0, 5.0)),
        _each("reflectance", "reflectance of the surface [%]", reflectance),
        _binned("layer", "layer", ideal.layer.astype(np.float64), np.arange(98.0, 334.0, 4.0)),
        _binned(
            "point",
            "point column",
            ideal.point.astype(np.float64),
            np.linspace(0.0, float(ideal.beams.points), 49),
            weight=_POINT,
        ),
        _binned("above", "layers above the retro-reflector", above, np.arange(-ABOVE - 2.0, ABOVE + 3.0, 4.0)),
        _binned(
            "beside", "points to the left of the retro-reflector", beside, np.arange(-BESIDE - 1.0, BESIDE + 2.0, 2.0)
        ),
    ]


def _offset(along: npt.NDArray[np.int32], line: npt.NDArray[np.int32], target: BoolArray) -> FloatArray:
    """Of beams on the target's lines, how far along these they are from its middle; NaN for others."""
    on_line = (line >= line[target].min()) & (line <= line[target].max())
    return np.where(on_line, along - np.median(along[target]), np.nan)


def _binned(
    name: str, label: str, value: FloatArray, edges: FloatArray, *, log: bool = False, weight: float = 1.0
) -> Axis:
    place = np.searchsorted(edges, np.where(np.isfinite(value), value, np.inf), "right") - 1
    middle = np.sqrt(edges[1:] * edges[:-1]) if log else 0.5 * (edges[1:] + edges[:-1])
    return Axis(name, label, np.where((place >= 0) & (place < len(middle)), place, -1), middle, log, weight)


def _each(name: str, label: str, value: FloatArray) -> Axis:
    """Every value that occurs is a bin."""
    at = np.unique(value[np.isfinite(value)])
    return Axis(name, label, np.where(np.isfinite(value), np.searchsorted(at, value), -1), at)


@functools.cache
def stray_axes() -> list[tuple[str, Axis]]:
    """The axes of `by_range` and `by_ratio`, each with that name, flattened over beams and bins."""
    ideal = ideal_scan()
    retro = (ideal.distance_m > 0.0) & (ideal.material_id == RETRO)
    range_m, ratio = np.sqrt(_RANGES_M[1:] * _RANGES_M[:-1]), 0.5 * (_RATIOS[1:] + _RATIOS[:-1])
    places = [np.tile(np.arange(len(at)), (len(ideal), 1)) for at in (range_m, ratio)]
    label = "range of the echo / range of the surface"
    of_retro = np.where(retro[:, None], places[1], -1).ravel()
    return [
        ("by_ratio", Axis("retro_ratio", f"{label}, on the retro-reflector", of_retro, ratio)),
        ("by_range", Axis("stray_range", "range of the echo [m]", places[0].ravel(), range_m, log=True, weight=_STRAY)),
        ("by_ratio", Axis("stray_ratio", label, places[1].ravel(), ratio)),
    ]
