"""The detector of an APD or an analogue SiPM: one amplitude a shot, held against a threshold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from lidarcheck.errors import UsageError
from lidarcheck.sensor.bounds import Bounds
from lidarcheck.sensor.sensor import Sensor

__all__ = ["Linear"]

_BOUNDS: Mapping[str, Bounds] = {
    "near_m": Bounds(0.0, 1000.0, False, "m", 0.5),
    "threshold": Bounds(0.0, 1e12, False, "amplitude", 0.5),
    "noise": Bounds(0.0, 1e12, False, "amplitude", 0.1),
    "excess": Bounds(0.0, 1e6, False, "amplitude a unit of signal", 0.1),
    "relative": Bounds(0.0, 1.0, False, "part of the signal", 0.05),
    "false_rate_hz": Bounds(0.0, 1e9, False, "Hz", 1000.0),
    "range_floor_m": Bounds(0.0, 100.0, False, "m", 0.002),
    "edge_factor": Bounds(0.0, 10.0, False, "pulse widths", 0.2),
    "range_at_threshold_m": Bounds(0.0, 100.0, False, "m", 0.01),
    "range_power": Bounds(0.0, 10.0, False, "", 0.1),
    "range_base_m": Bounds(0.0, 100.0, False, "m", 0.002),
    "range_slope": Bounds(0.0, 1.0, False, "m a m", 0.0005),
    "walk_m_per_decade": Bounds(-100.0, 100.0, False, "m a decade of amplitude", 0.005),
    "walk_reference": Bounds(1e-12, 1e15, False, "amplitude", 10.0),
    "saturation": Bounds(1e-12, 1e15, False, "amplitude", -10.0),
    "recovery_ns": Bounds(0.0, 10_000.0, False, "ns a decade of amplitude", 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Linear(Sensor):
    """One amplitude a shot: a ~ N(S, noise^2 + excess S + (relative S)^2), detected above `threshold`.

    Amplitudes are in the unit of `noise`, 1 unless the file says otherwise. None: `false_rate_hz` by Rice's formula
    from threshold and noise, `walk_reference` ten thresholds, `saturation` none. `range_law`: "physical" (floor and
    slope of the pulse's edge), "power" (of threshold over signal), "distance" (base and slope).
    """

    detector: ClassVar[str] = "linear"
    bounds: ClassVar[Mapping[str, Bounds]] = _BOUNDS

    threshold: float = 5.5
    noise: float = 1.0
    excess: float = 0.0
    relative: float = 0.0
    false_rate_hz: float | None = None
    range_floor_m: float = 0.01
    edge_factor: float = 1.0
    range_law: Literal["physical", "power", "distance"] = "physical"
    range_at_threshold_m: float | None = None
    range_power: float = 1.0
    range_base_m: float | None = None
    range_slope: float = 0.0
    walk_m_per_decade: float = 0.0
    walk_reference: float | None = None
    saturation: float | None = None
    recovery_ns: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for law, needed in (("power", "range_at_threshold_m"), ("distance", "range_base_m")):
            if self.range_law == law and getattr(self, needed) is None and needed not in self.missing:
                raise UsageError(f'range_law = "{law}" needs {needed}', fix=f"give {needed}")

    __hash__ = Sensor.__hash__

    @property
    def _unit(self) -> float:
        """A standard deviation of the dark beam, or a tenth of the threshold where that has no noise."""
        return self.noise if self.noise > 0.0 else 0.1 * self.threshold

    @property
    def threshold_counts(self) -> float:
        """The threshold in standard deviations of the dark beam."""
        return self.threshold / self._unit if self._unit > 0.0 else 0.0

    def signal_of(self, counts: float) -> float:
        """So many standard deviations of the dark beam."""
        return counts * self._unit

    @property
    def window_m(self) -> float:
        """An echo so near to a surface is that surface's."""
        return max(super().window_m, 5.0 * self.range_floor_m)
