"""Empirical: beams gain echoes, as many as a function says on average."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import ReadoutEffect, Surroundings, choice_parameter, list_parameter, unfit_for
from lidarcheck.effects.empirical.covariates import BeamColumns, keys_of
from lidarcheck.effects.empirical.terms import (
    NOT_COUNTED,
    Additive,
    covariate_parameter,
    knots_parameter,
    uncounted,
    values_parameter,
)
from lidarcheck.effects.shared.ranges import renumbered
from lidarcheck.errors import UsageError
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["EmpiricalExtra"]

_NEEDED = ("range_from", "range_knots", "range_density", "peak_quantiles", "area_quantiles", "width_quantiles")


def _quantiles(unit: str, low: float, high: float, meaning: str, example: tuple[float, ...]) -> tuple[float, ...]:
    made: tuple[float, ...] = list_parameter(unit, low=low, high=high, meaning=meaning, example=example)
    return made


@dataclass(frozen=True)
class EmpiricalExtra(Additive, ReadoutEffect):
    """Empirical: beams gain echoes, as many as a function of the beam or its surface says on average.

    A beam gains f(u) + g(v) echoes on average: their whole part, and one more with the rest as its probability, by the
    beam's own draw; none below 0. f and g are linear between knots and constant outside, and a beam's covariates are
    those of the surface that returns most of its light and of its largest echo. An echo's range comes from a density
    that is constant between `range_knots`: by `range_from` in metres from the sensor (`sensor`), in metres behind the
    surface (`surface`), or in multiples of the surface's range (`ratio`). PEAK, AREA and WIDTH come together from
    quantiles at equal steps from the least to the largest. It describes and does not explain.

    A beam that meets nothing gains no echo by a surface, and none gains one outside of the sensor's range. Of more
    echoes than the sensor reports, those of smallest AREA fall out. New echoes merge with no other. Identity at
    values 0.
    """

    name = "empirical_extra"
    unfit = unfit_for(linear=NOT_COUNTED, photon_histogram=NOT_COUNTED)

    covariate: str | None = covariate_parameter("what f depends on", example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(10.0, 60.0))
    values: tuple[float, ...] = values_parameter("", 10.0, "f there, a mean number", example=(0.2, 0.2))
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 10.0, "g there, added to it")
    range_from: str | None = choice_parameter(
        ("sensor", "surface", "ratio"), meaning="what range_knots are counted from", example="surface"
    )
    range_knots: tuple[float, ...] = list_parameter(
        "m, or 1", low=-1e4, high=1e4, ascending=True, meaning="where the density changes", example=(2.0, 8.0)
    )
    range_density: tuple[float, ...] = list_parameter(
        "", low=0.0, high=1e9, meaning="the density between the knots, of any sum", example=(1.0,)
    )
    peak_quantiles: tuple[float, ...] = _quantiles("detectors", 1.0, 1e6, "quantiles of PEAK", (10.0, 30.0))
    area_quantiles: tuple[float, ...] = _quantiles("counts", 1.0, 1e9, "quantiles of AREA", (20.0, 300.0))
    width_quantiles: tuple[float, ...] = _quantiles("ns", 0.0, 1e4, "quantiles of WIDTH", (2.0, 14.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_zero():
            return
        for name in (name for name in _NEEDED if not getattr(self, name)):
            raise UsageError(f"{self.name}: {name} is missing", fix="say where the echoes lie and how strong they are")
        for name in ("peak_quantiles", "area_quantiles", "width_quantiles"):
            if any(np.diff(getattr(self, name)) < 0.0):
                raise UsageError(f"{self.name}: {name} decreases", fix="give quantiles from the least to the largest")
        steps, density = len(self.range_knots) - 1, len(self.range_density)
        if steps != density or not any(self.range_density):
            what = f"range_density has {density} numbers for {steps} steps"
            what = what if steps != density else "range_density is 0 everywhere"
            fix = "give one number fewer than range_knots has" if steps != density else "give a number above 0"
            raise UsageError(f"{self.name}: {what}", fix=fix)

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """What is counted, also around a program."""
        return uncounted(sensor)

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Add the echoes, and leave out those that the sensor would not report."""
        if self.is_zero():
            return scan
        beams = BeamColumns(scan, around)
        mean = np.maximum(self.total(beams, len(beams.keys)), 0.0)
        most = int(np.ceil(mean.max(initial=0.0)))
        uniform = around.uniforms(beams.layer, beams.point, 1 + 2 * most)
        count = (np.floor(mean) + (uniform[:, 0] < mean % 1.0)).astype(np.int64)
        lit = np.repeat(np.arange(len(count)), count)
        own = np.arange(len(lit)) - np.repeat(np.cumsum(count) - count, count)
        range_m = self._range_m(uniform[lit, 1 + 2 * own], beams.range_m[lit])
        inside = (range_m >= 0.0) & (range_m <= around.sensor.max_range_m)
        lit, own, range_m = lit[inside], own[inside], range_m[inside]
        if len(lit) == 0:
            return scan
        columns = {"layer": beams.layer[lit], "point": beams.point[lit]}
        added = _added(scan, columns, range_m, self._features(uniform[lit, 2 + 2 * own], around))
        touched = np.isin(keys_of(scan), beams.keys[lit])
        changed = _most(renumbered(_joined(scan.take(touched), added)), around.sensor.max_echoes)
        result = _joined(scan.take(~touched), changed)
        return result.take(np.lexsort((result.echo_number, keys_of(result))))

    def _range_m(self, uniform: FloatArray, surface_m: FloatArray) -> FloatArray:
        """Ranges by the inverse of the density's distribution function, NaN where they need a surface; (n,)."""
        knots = np.array(self.range_knots)
        below = np.append(0.0, np.cumsum(np.diff(knots) * np.array(self.range_density)))
        place = np.interp(uniform * below[-1], below, knots)
        if self.range_from == "sensor":
            return np.asarray(place)
        return np.asarray(surface_m + place if self.range_from == "surface" else surface_m * place)

    def _features(self, uniform: FloatArray, around: Surroundings) -> dict[str, Any]:
        """PEAK, AREA and WIDTH of new echoes as the sensor reports them, shape (n,) each."""
        sensor = SpadArray.narrow(around.sensor.nominal)
        peak = np.clip(np.rint(_at_level(self.peak_quantiles, uniform)), 1.0, sensor.peak_saturation)
        area = np.maximum(np.rint(_at_level(self.area_quantiles, uniform)), peak)
        bins = np.maximum(np.rint(_at_level(self.width_quantiles, uniform) / sensor.bin_ns), 1.0)
        return {"peak": peak, "area": area, "width_ns": bins * sensor.bin_ns}


def _at_level(quantiles: tuple[float, ...], level: FloatArray) -> FloatArray:
    """The quantile function at levels in 0 ... 1, same shape; a single quantile is the value of all."""
    return np.interp(level, np.linspace(0.0, 1.0, len(quantiles)), quantiles)


def _added(scan: Scan, beams: dict[str, Any], range_m: FloatArray, features: dict[str, Any]) -> Scan:
    """New echoes as a scan with the columns that the other one has, those unknown to the sensor 0."""
    n = len(range_m)
    xyz = scan.beams.positions_m(beams["layer"], beams["point"], range_m)
    last = np.full(n, np.iinfo(np.int32).max)  # behind all echoes of equal range, until they are numbered
    extra = {name: np.zeros(n, dtype=column.dtype) for name, column in scan.extra.items()}
    place: dict[str, Any] = {"x_m": xyz[:, 0], "y_m": xyz[:, 1], "z_m": xyz[:, 2], "echo_number": last}
    return replace(scan, **beams, **place, **features, extra=extra)


def _joined(one: Scan, other: Scan) -> Scan:
    """The rows of both."""
    names = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
    columns: dict[str, Any] = {name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in names}
    extra = {name: np.concatenate([column, other.extra[name]]) for name, column in one.extra.items()}
    return replace(one, **columns, extra=extra)


def _most(scan: Scan, room: int) -> Scan:
    """Of each beam the echoes of largest AREA, as many as there is room for; numbered anew where one falls out."""
    if int(scan.echo_number.max(initial=0)) <= room:
        return scan
    key = keys_of(scan)
    order = np.lexsort((scan.echo_number, -scan.area, key))  # of equal AREA the nearest stays, as in the sensor
    starts = np.append(True, key[order][1:] != key[order][:-1])
    place = np.arange(len(scan))
    rank = place - np.maximum.accumulate(np.where(starts, place, 0))
    kept = np.zeros(len(scan), dtype=bool)
    kept[order] = rank < room
    return renumbered(scan.take(kept))
