"""The reference sensor: its numbers, its beams, and the materials its light meets.

Sensor frame, metres: X forward, Y left, Z up; azimuth positive to the left, elevation upward. A beam is
(layer, point).
"""

from __future__ import annotations

import difflib
import functools
import tomllib
from dataclasses import dataclass, fields, replace
from importlib import resources
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError

__all__ = [
    "FWHM_PER_SIGMA",
    "LAYERS",
    "LIGHT_SPEED_M_PER_NS",
    "POINTS",
    "RETRO_GAIN_MAX",
    "VARIANTS",
    "Bounds",
    "Material",
    "NonIdeal",
    "Sensor",
    "azimuth_deg",
    "beam_directions",
    "cos_sin",
    "elevation_deg",
    "layer_of",
    "point_of",
]

LIGHT_SPEED_M_PER_NS = 0.299792458
FWHM_PER_SIGMA = 2.3548
LAYERS = 520
POINTS = 960
VARIANTS = ("SMART", "SLIM")
RETRO_GAIN_MAX = 1e6


class Bounds(NamedTuple):
    """The closed interval a number may lie in, whether it is a whole number, its unit, and a change to be noticed.

    `noticeable` follows the rules of effects' parameters (`effects.parameters`), at the variants' own numbers.
    """

    low: float
    high: float
    whole: bool
    unit: str
    noticeable: float


SENSOR_BOUNDS: dict[str, Bounds] = {
    "spads": Bounds(1, 1000, True, "SPADs per point", 1),
    "shots": Bounds(1, 100, True, "shots", 1),
    "threshold": Bounds(0, 100_000, True, "detectors ON", 1),
    "peak_saturation": Bounds(1, 100_000, True, "detectors ON", -5),
    "on_bins": Bounds(1, 1000, True, "bins", 1),
    "dead_bins": Bounds(1, 1000, True, "bins", 1),
    "pulse_fwhm_ns": Bounds(0.01, 200.0, False, "ns", 0.25),
    "background_per_ns": Bounds(0.0, 10.0, False, "avalanches per armed SPAD and ns", 7.5e-5),
    "signal_at_1m": Bounds(0.0, 1e9, False, "avalanches per SPAD and shot at 1 m", 600.0),
    "bin_ns": Bounds(0.01, 10.0, False, "ns", 0.01),
    "max_range_m": Bounds(1.0, 1000.0, False, "m", -30.0),
    "max_echoes": Bounds(1, 16, True, "echoes", 1),
    "time_offset_ns": Bounds(-1000.0, 1000.0, False, "ns", 0.07),
    "range_resolution_m": Bounds(0.0, 1.0, False, "m", 0.01),
}
"""Every number of the sensor that a model file may override, with its allowed interval."""


@dataclass(frozen=True, slots=True)
class NonIdeal:
    """What real SPADs do and the reference sensor's do not; all zero there. Detector effects set it.

    `crosstalk_sides`, `crosstalk_corners`: avalanches that one sets off in the same bin, on average and in an endless
    array, among its four side and its four corner neighbours; each neighbour that is armed with a quarter of it.
    `afterpulse`: probability that an avalanche sets off a later one in its SPAD; it comes an exponential time of mean
    `afterpulse_ns` behind the end of the dead time, for the share `afterpulse_slow_share` of them of mean
    `afterpulse_slow_ns`. `dead_spread_ns`: standard deviation of the dead time from avalanche to avalanche;
    `dead_recovery_ns`: mean of an exponential time that is added to it. `threshold_dither`: share of the beams, drawn
    anew for each frame, whose threshold is one detector higher.
    """

    crosstalk_sides: float = 0.0
    crosstalk_corners: float = 0.0
    afterpulse: float = 0.0
    afterpulse_ns: float = 1.0
    afterpulse_slow_share: float = 0.0
    afterpulse_slow_ns: float = 1.0
    dead_spread_ns: float = 0.0
    dead_recovery_ns: float = 0.0
    threshold_dither: float = 0.0

    @property
    def any(self) -> bool:
        """Whether detectors must be followed one by one."""
        tied = max(self.crosstalk_sides, self.crosstalk_corners, self.afterpulse)
        return max(tied, self.dead_spread_ns, self.dead_recovery_ns) > 0.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """The numbers of one sensor variant; units in the names, meanings in `sensors/*.toml`.

    Build one with `Sensor.of("SMART", threshold=10)`. `UsageError` names a number that is out of its bounds.
    """

    variant: Literal["SMART", "SLIM"]
    spads: int
    shots: int
    threshold: int
    peak_saturation: int
    on_bins: int
    dead_bins: int
    pulse_fwhm_ns: float
    background_per_ns: float
    signal_at_1m: float
    bin_ns: float
    max_range_m: float
    max_echoes: int
    time_offset_ns: float
    range_resolution_m: float
    nonideal: NonIdeal = NonIdeal()

    def __post_init__(self) -> None:
        for name, bounds in SENSOR_BOUNDS.items():
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise UsageError(f"{name} = {value!r} is no number", fix=f"use a number of {bounds.unit}")
            if not bounds.low <= value <= bounds.high or (bounds.whole and value != int(value)):
                kind = "a whole number" if bounds.whole else "a number"
                raise UsageError(
                    f"{name} = {value} is out of range",
                    fix=f"use {kind} from {bounds.low:g} to {bounds.high:g} {bounds.unit}",
                )
            object.__setattr__(self, name, int(value) if bounds.whole else float(value))
        if self.dead_bins < self.on_bins:
            raise UsageError(
                f"dead_bins = {self.dead_bins} is below on_bins = {self.on_bins}",
                fix="a SPAD cannot avalanche while its output is still ON; use dead_bins >= on_bins",
            )

    @classmethod
    def of(cls, variant: str, **overrides: float) -> Sensor:
        """The sensor of that variant, with numbers replaced by name."""
        if variant not in VARIANTS:
            raise UsageError(f"there is no sensor variant {variant!r}", fix='use "SMART" or "SLIM"')
        for name in overrides:
            if name not in SENSOR_BOUNDS:
                near = difflib.get_close_matches(name, SENSOR_BOUNDS, n=1)
                fix = f"did you mean {near[0]}?" if near else f"known: {', '.join(SENSOR_BOUNDS)}"
                raise UsageError(f"a sensor has no number {name!r}", fix=fix)
        return replace(_default(variant), **overrides)  # type: ignore[arg-type]

    @property
    def detectors(self) -> int:
        """N: SPADs times shots, all independent."""
        return self.spads * self.shots

    @property
    def bins(self) -> int:
        """Number of bins of the trace: every bin that begins within `max_range_m`."""
        return int(2.0 * self.max_range_m / LIGHT_SPEED_M_PER_NS / self.bin_ns) + 1

    @property
    def sigma_ns(self) -> float:
        """Standard deviation of the Gaussian pulse."""
        return self.pulse_fwhm_ns / FWHM_PER_SIGMA

    def overrides(self) -> dict[str, float]:
        """The numbers that differ from the variant's own."""
        own = _default(self.variant)
        return {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if f.name in SENSOR_BOUNDS and getattr(self, f.name) != getattr(own, f.name)
        }


@functools.cache
def _default(variant: str) -> Sensor:
    text = resources.files("lidarcheck").joinpath(f"sensors/{variant}.toml").read_text(encoding="utf-8")
    numbers: dict[str, Any] = tomllib.loads(text)
    return Sensor(variant=variant, **numbers)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Material:
    """What a surface returns.

    `reflectance` 0 ... 1; a retro-reflector multiplies it by `retro_gain`, at any incidence.
    """

    name: str
    reflectance: float
    kind: Literal["lambertian", "retro"] = "lambertian"
    retro_gain: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.reflectance <= 1.0:
            raise UsageError(f"reflectance = {self.reflectance} of {self.name} is out of range", fix="use 0 to 1")
        if not 0.0 <= self.retro_gain <= RETRO_GAIN_MAX:
            fix = f"use 0 to {RETRO_GAIN_MAX:g}"
            raise UsageError(f"retro_gain = {self.retro_gain} of {self.name} is out of range", fix=fix)


def elevation_deg(layer: npt.ArrayLike) -> FloatArray:
    """Elevation of a layer [deg]; same shape."""
    return (np.asarray(layer, dtype=np.float64) - 259.5) * 0.05


def azimuth_deg(point: npt.ArrayLike) -> FloatArray:
    """Azimuth of a point column [deg], positive to the left; same shape."""
    return (np.asarray(point, dtype=np.float64) - 479.5) * 0.125


def layer_of(elevation: npt.ArrayLike) -> IntArray:
    """Nearest layer of an elevation [deg]; may lie outside 0 ... 519."""
    return np.rint(np.asarray(elevation, dtype=np.float64) / 0.05 + 259.5).astype(np.int32)


def point_of(azimuth: npt.ArrayLike) -> IntArray:
    """Nearest point column of an azimuth [deg]; may lie outside 0 ... 959."""
    return np.rint(np.asarray(azimuth, dtype=np.float64) / 0.125 + 479.5).astype(np.int32)


def beam_directions(layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
    """Unit vectors of beams, shape (n, 3), in the sensor frame."""
    cos_phi, sin_phi = cos_sin(layer, "layer")
    cos_theta, sin_theta = cos_sin(point, "point")
    directions = np.empty((3, *np.shape(layer)))
    np.multiply(cos_theta, cos_phi, out=directions[0, ...])
    np.multiply(sin_theta, cos_phi, out=directions[1, ...])
    directions[2, ...] = sin_phi
    # Each coordinate lies in one piece: tables want columns.
    return np.moveaxis(directions, 0, -1)


_ONE_BIT_LESS, _ONE_BIT_MORE = (49, 112, 407, 470), (20, 499)
"""Layers whose sine has always been one bit beside the nearest number. It stays so, since a golden compares bits."""


@functools.cache
def _table(axis: Literal["layer", "point"]) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of every layer's elevation, or of every point's azimuth."""
    angle = np.deg2rad(elevation_deg(np.arange(LAYERS)) if axis == "layer" else azimuth_deg(np.arange(POINTS)))
    cosine, sine = elementary.rounded_cos_sin(angle)
    if axis == "layer":
        for layers, toward in ((_ONE_BIT_LESS, 0.0), (_ONE_BIT_MORE, 2.0)):
            sine[[*layers]] = np.nextafter(sine[[*layers]], toward * np.sign(sine[[*layers]]))
    return cosine, sine


def cos_sin(index: npt.ArrayLike, axis: Literal["layer", "point"]) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of the indices' angles; those of the sensor's own beams are read off a table."""
    at = np.asarray(index)
    cosine, sine = _table(axis)
    if at.size and at.dtype.kind in "iu" and at.min() >= 0 and at.max() < len(cosine):
        return cosine[at], sine[at]
    angle = np.deg2rad(elevation_deg(at) if axis == "layer" else azimuth_deg(at))
    return elementary.cos(angle), elementary.sin(angle)
