"""What is looked at of an echo, for each sensor: its amplitude, two further features, and when it is a surface's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.inference.observed.histogram_parts import PARTS, HistogramParts, Part
from lidarcheck.scan import Scan
from lidarcheck.sensor import Feature, PhotonHistogram, Sensor

__all__ = ["EchoView", "Slot"]

_AMPLITUDES = (
    "area_counts", "photons", "affine", "log", "range_corrected", "calibrated_reflectivity", "table", "peak_counts",
)  # fmt: skip
"""Laws of features that go up with the amplitude, the ones that say most of it first."""
_OF_BEAM = ("histogram",)
"""Laws of features that are no number; a beam's background is looked at with the echo that it has."""
_LOGARITHMIC = ("area_counts", "peak_counts", "photons", "affine", "range_corrected", "calibrated_reflectivity")
_REACH = 2.6685
"""Windows of detection within which an echo may still be a surface's, whatever shifts ranges: 2 m of a 5 ns pulse."""
_REACH_OF_5_NS_M = 2.0
_LOG_FLOOR, _STEPS_FLOOR = 0.01, 0.3
"""Spreads below which a logarithm, or a feature in its steps, is not known better."""
_RANGE_STEPS, _LEAST_RANGE_M = 0.4, 0.0005
"""The same of a range in its steps, and of a range without steps."""
_PULSE_STEPS = 0.1
"""The part of a bin in which the length of a counted pulse is looked at."""
_UNITS = {"area_counts": "counts", "peak_counts": "counts"}
"""What readers call the unit of these laws, whatever the file says."""
_OTHERS = {"area_counts": (5.1, 1.7), "peak_counts": (3.4, 1.1), "width_bins": (9.0, 5.4)}
"""Mean and spread, about, of all other echoes of counted avalanches: blooms of a sign (ln AREA 6.5, ln PEAK 4.4, WIDTH
12.9) and false alarms (3.8, 2.5, 5.1). A spread of one kind alone makes one echo of another worth up to five: single
beams that flip are then taken for slopes, and chance counts five times."""
_OF_ONE = {"area_counts": 0.2, "peak_counts": 0.15, "width_bins": 1.5}
"""Standard deviations of an echo of some thirty avalanches, as most other echoes are."""
_OF_ONE_LOG, _OF_ONE_STEPS = 0.2, 3.0
"""The same of any amplitude that stands five times out of the noise, and of what is no logarithm, in its steps."""
_PILE_UP = {"area_counts": (2000.0, 4000.0)}
"""Extra edges where few but bright beams lie: what light does to detectors shows there first."""


@dataclass(frozen=True, slots=True)
class Slot:
    """A feature of an echo: the sensor's name (empty: it has none), `log`: as ln max(value, 1); the least spread, extra
    edges of its bins, unit and step of its values. `bins`, `part`: of a histogram, what is read out of it. `others`:
    mean and spread of all other echoes, None where only the model tells; `of_one`: the spread of a single one."""

    name: str = ""
    log: bool = False
    floor: float = 1.0
    edges: tuple[float, ...] = ()
    unit: str = "1"
    step: float = 1.0
    bins: HistogramParts | None = None
    part: Part = "counts"
    others: tuple[float, float] | None = None
    of_one: float = 1.0

    def of(self, scans: Sequence[Scan]) -> FloatArray:
        """The values of all echoes, shape (n,); 0 where the sensor has no such feature."""
        if not self.name:
            return np.zeros(sum(len(scan) for scan in scans))
        values = np.concatenate([self._values(scan) for scan in scans])
        return np.log(np.maximum(values, 1.0)) if self.log else np.asarray(values, dtype=np.float64)

    def _values(self, scan: Scan) -> FloatArray:
        return scan.feature(self.name) if self.bins is None else self.bins.each(scan, self.part)


@dataclass(frozen=True, slots=True)
class EchoView:
    """The `slots` after the range: the amplitude and two further features; `reach_m`: an echo this near to a surface is
    that surface's; `range_floor_m`: the least spread of a range; `range_step_m`: the step in which ranges are shown."""

    slots: tuple[Slot, Slot, Slot]
    reach_m: float
    range_floor_m: float
    range_step_m: float

    @classmethod
    def of(cls, sensor: Sensor) -> EchoView:
        """What is looked at of a sensor's echoes."""
        features = [feature for feature in sensor.features if feature.law not in _OF_BEAM]
        strength = [f for f in features if f.name == sensor.strength]
        ranked = sorted((f for f in features if f.law in _AMPLITUDES), key=lambda f: _AMPLITUDES.index(f.law))
        first = [*strength, *ranked][:1]
        others = sorted((f for f in features if f not in first), key=_likeness)
        slots = [_slot(feature) for feature in (first + others)[:3]]
        slots = _of_histogram(sensor) or [Slot()] * (not first) + slots
        slots += [Slot()] * (3 - len(slots))
        step = sensor.range_resolution_m
        reach, floor = round(_REACH * sensor.window_m, 2), _RANGE_STEPS * step or _LEAST_RANGE_M
        return cls((slots[0], slots[1], slots[2]), reach, floor, step or _LEAST_RANGE_M)

    @property
    def match_m(self) -> float:
        """An echo so near to a bright target's range is taken to come from it."""
        return 1.25 * self.reach_m

    @property
    def length_scale(self) -> float:
        """What lengths that suit a pulse of 5 ns are multiplied by for a sensor that tells shorter ones apart."""
        return min(1.0, self.reach_m / _REACH_OF_5_NS_M)

    def columns(self, scans: Sequence[Scan]) -> list[FloatArray]:
        """The values of the slots, shape (n_echoes,) each."""
        return [slot.of(scans) for slot in self.slots]

    @property
    def names(self) -> Mapping[str, str]:
        """What the sensor calls the amplitude and the two further features, by their names in `FEATURES`."""
        return dict(zip(("area", "peak", "width"), (slot.name for slot in self.slots), strict=True))

    @property
    def least_spread(self) -> tuple[float, float, float, float]:
        """The least spread of the range and of each slot."""
        return (self.range_floor_m, self.slots[0].floor, self.slots[1].floor, self.slots[2].floor)


def _likeness(feature: Feature) -> int:
    """Features that go up with the amplitude come before others."""
    return _AMPLITUDES.index(feature.law) if feature.law in _AMPLITUDES else len(_AMPLITUDES)


def _of_histogram(sensor: Sensor) -> list[Slot]:
    """What the histogram says of each echo; nothing where the sensor reports none."""
    named = [feature.name for feature in sensor.features if feature.law == "histogram"]
    if not named or not isinstance(sensor, PhotonHistogram):
        return []
    bins, step = HistogramParts.of(sensor), _PULSE_STEPS * sensor.bin_ns
    counts, background = (
        Slot(f"{part} of {named[0]}", True, _LOG_FLOOR, (), "counts", 1.0, bins, part, of_one=_OF_ONE_LOG)
        for part in PARTS[:2]
    )
    floor, of_one = _STEPS_FLOOR * step, _OF_ONE_STEPS * step
    return [counts, background, Slot(f"pulse of {named[0]}", False, floor, (), "ns", step, bins, "pulse", None, of_one)]


def _slot(feature: Feature) -> Slot:
    log = feature.law in _LOGARITHMIC
    step = feature.step or 0.01
    unit = _UNITS.get(feature.law, feature.unit or "1")
    floor, of_one = (_LOG_FLOOR, _OF_ONE_LOG) if log else (_STEPS_FLOOR * step, _OF_ONE_STEPS * step)
    return Slot(
        feature.name,
        log,
        floor,
        _PILE_UP.get(feature.law, ()),
        unit,
        step,
        others=_OTHERS.get(feature.law),
        of_one=_OF_ONE.get(feature.law, of_one),
    )
