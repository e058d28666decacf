"""A sensor: its beams, what it reports, and the numbers of its detector."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal, Self

from lidarcheck.errors import UsageError
from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.bounds import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Bounds, check_numbers
from lidarcheck.sensor.feature import Feature
from lidarcheck.sensor.sweep import Sweep

__all__ = ["KEEP", "RANGE_KEYS", "Keep", "Sensor"]

Keep = Literal["strongest", "first", "last", "strongest_last", "first_last", "first_strongest", "strongest_second"]
KEEP: tuple[Keep, ...] = (
    "strongest", "first", "last", "strongest_last", "first_last", "first_strongest", "strongest_second"
)  # fmt: skip
RANGE_KEYS: Mapping[str, str] = {
    "min_m": "min_range_m",
    "max_m": "max_range_m",
    "step_m": "range_resolution_m",
    "offset_m": "range_offset_m",
    "min_separation_m": "min_separation_m",
}
"""The keys of a sensor file's `[range]`, and the names that these numbers have here."""

_COMMON: Mapping[str, Bounds] = {
    "signal_at_1m": Bounds(0.0, 1e15, False, "the signal's unit at 1 m", 600.0),
    "pulse_fwhm_ns": Bounds(0.01, 200.0, False, "ns", 0.25),
    "min_range_m": Bounds(0.0, 1000.0, False, "m", 0.5),
    "max_range_m": Bounds(1.0, 1000.0, False, "m", -30.0),
    "max_echoes": Bounds(1, 16, True, "echoes", 1),
    "range_resolution_m": Bounds(0.0, 1.0, False, "m", 0.01),
    "range_offset_m": Bounds(-100.0, 100.0, False, "m", 0.01),
    "min_separation_m": Bounds(0.0, 100.0, False, "m", 0.3),
    "frame_rate_hz": Bounds(0.001, 10_000.0, False, "Hz", 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Sensor(abc.ABC):
    """What sensors of every detector have; a subclass adds the detector's own numbers. Units stand in the names.

    Build one with `lidarcheck.sensor.sensor_of("SLIM", threshold=10)`. `variant`: the name or file that a model gives;
    `keep`: which echoes survive where there are more than `max_echoes`, by `strength` (empty: the amplitude before
    calibration and quantisation); `return_order`, `duplicate_return`, `handedness`, `time_unit`, `time_zero`,
    `deskewed`: how its files are written. `background_per_ns`: avalanches without any light of the laser; `near_m`:
    what the optics lose close by. `tables`: overrides of whole tables of the sensor file by a model, as they stood
    there. `missing`: required numbers that the file does not give: the sensor cannot be simulated. `file`: where it
    was read from, and `plain`: the sensor as that file has it, without a model's overrides; empty, None: shipped.
    `UsageError` names a number that is out of its bounds.
    """

    detector: ClassVar[str] = ""
    bounds: ClassVar[Mapping[str, Bounds]] = {}

    variant: str
    name: str = ""
    source: tuple[str, ...] = ()
    beams: Beams = field(repr=False)
    sweep: Sweep
    features: tuple[Feature, ...] = ()
    frame_rate_hz: float
    max_echoes: int
    keep: Keep = "strongest"
    strength: str = ""
    return_order: Literal["range", "as_kept"] = "range"
    duplicate_return: Literal["drop", "repeat"] = "drop"
    handedness: Literal["right", "left"] = "right"
    time_unit: str = "auto"
    time_zero: str = "auto"
    deskewed: bool = False
    footprint_deg: tuple[float, float] = (0.0, 0.0)
    footprint: Literal["gaussian", "box"] = "gaussian"
    sub_rays: tuple[int, int] = (1, 1)
    min_range_m: float
    max_range_m: float
    range_resolution_m: float
    range_offset_m: float = 0.0
    min_separation_m: float | None = None
    signal_at_1m: float
    pulse_fwhm_ns: float
    background_per_ns: float = 0.0
    near_m: float = 0.0
    tables: Mapping[str, Any] = field(default_factory=dict, repr=False)
    missing: tuple[str, ...] = ()
    file: str = ""
    plain: Sensor | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_numbers(self, {**_COMMON, **self.bounds})
        if self.min_range_m >= self.max_range_m:
            what = f"min_range_m = {self.min_range_m:g} is not below max_range_m = {self.max_range_m:g}"
            raise UsageError(what, fix="use a gate of some length")
        if self.max_echoes < 2 and "_" in self.keep:
            raise UsageError(
                f"keep = {self.keep!r} keeps two echoes, returns = {self.max_echoes}", fix="use returns = 2"
            )

    def __hash__(self) -> int:
        numbers = tuple(getattr(self, name) for name in (*_COMMON, *self.bounds))
        return hash((type(self), self.variant, self.keep, *numbers))

    @classmethod
    def of(cls, variant: str, **overrides: Any) -> Self:
        """The shipped sensor of that name, with numbers replaced by name; `UsageError` for another detector's."""
        from lidarcheck.sensor.document import shipped

        return cls.narrow(shipped(variant, overrides))

    @classmethod
    def narrow(cls, sensor: Sensor) -> Self:
        """The same sensor as one of this detector; `UsageError` where it has another."""
        if isinstance(sensor, cls):
            return sensor
        what = f"{sensor.name} has the detector {sensor.detector}, not {cls.detector}"
        raise UsageError(what, fix=f"use a sensor with the detector {cls.detector}")

    @property
    def nominal(self) -> Sensor:
        """The sensor whose numbers these are: itself, unless a program stands in the place of its detector."""
        return self

    @property
    def sigma_ns(self) -> float:
        """Standard deviation of the Gaussian pulse."""
        return self.pulse_fwhm_ns / FWHM_PER_SIGMA

    @property
    def separation_m(self) -> float:
        """Surfaces nearer to each other make one echo: `min_separation_m`, else half the pulse's length."""
        own = self.min_separation_m
        return 0.5 * LIGHT_SPEED_M_PER_NS * self.pulse_fwhm_ns if own is None else own

    @property
    def window_m(self) -> float:
        """Half the pulse's length: an echo so near to a surface is that surface's."""
        return 0.5 * LIGHT_SPEED_M_PER_NS * self.pulse_fwhm_ns

    @property
    def bright_signal(self) -> float:
        """S from which a surface is so bright that it may bloom or show ghosts."""
        return self.signal_of(300.0 * self.threshold_counts)

    @property
    @abc.abstractmethod
    def threshold_counts(self) -> float:
        """About as many counts as are just seen."""

    @abc.abstractmethod
    def signal_of(self, counts: float) -> float:
        """The S that makes so many counts; of a detector that counts nothing, so many times its noise."""

    @classmethod
    def numbers(cls) -> Mapping[str, Bounds]:
        """Every number that a model file may override by its name, with its allowed interval."""
        return {**cls.bounds, **{name: bound for name, bound in _COMMON.items() if name not in cls.bounds}}

    def feature(self, name: str) -> Feature:
        """The feature of that name; `UsageError` with those that the sensor has."""
        for found in self.features:
            if found.name == name:
                return found
        known = ", ".join(found.name for found in self.features) or "none"
        raise UsageError(f"{self.name} reports no {name}", fix=f"it reports {known}")

    def overrides(self) -> dict[str, Any]:
        """The numbers and tables that differ from the variant's own."""
        from lidarcheck.sensor.document import own

        plain = own(self)
        changed = {
            name: getattr(self, name)
            for name in (f.name for f in fields(self))
            if name in self.numbers() and getattr(self, name) != getattr(plain, name)
        }
        return {**changed, **self.tables}
