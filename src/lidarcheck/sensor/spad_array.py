"""The detector of a SPAD array: avalanches counted into PEAK, WIDTH and AREA."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from lidarcheck.errors import UsageError
from lidarcheck.sensor.bounds import LIGHT_SPEED_M_PER_NS, Bounds
from lidarcheck.sensor.sensor import Sensor

__all__ = ["NonIdeal", "SpadArray"]

_BOUNDS: Mapping[str, Bounds] = {
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


@dataclass(frozen=True, kw_only=True)
class SpadArray(Sensor):
    """N = `spads` x `shots` SPADs whose outputs are counted bin by bin; meanings in `sensors/SLIM.toml`.

    `rows`, `columns`: how the SPADs of a point lie; where they do not multiply to `spads`, in one row.
    """

    detector: ClassVar[str] = "spad_array"
    bounds: ClassVar[Mapping[str, Bounds]] = _BOUNDS

    spads: int
    shots: int
    threshold: int
    peak_saturation: int
    on_bins: int
    dead_bins: int
    background_per_ns: float
    bin_ns: float
    time_offset_ns: float
    rows: int = 3
    columns: int = 0
    nonideal: NonIdeal = NonIdeal()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dead_bins < self.on_bins:
            raise UsageError(
                f"dead_bins = {self.dead_bins} is below on_bins = {self.on_bins}",
                fix="a SPAD cannot avalanche while its output is still ON; use dead_bins >= on_bins",
            )

    __hash__ = Sensor.__hash__

    @property
    def detectors(self) -> int:
        """N: SPADs times shots, all independent."""
        return self.spads * self.shots

    @property
    def bright_signal(self) -> float:
        """S from which a surface saturates all SPADs and may bloom or show ghosts."""
        return 30.0

    @property
    def threshold_counts(self) -> float:
        """As many avalanches as are just seen, were they all to come at once."""
        return self.threshold + 1

    def signal_of(self, counts: float) -> float:
        """The S that makes so many avalanches in all detectors."""
        return counts / self.detectors

    @property
    def bins(self) -> int:
        """Number of bins of the trace: every bin that begins within `max_range_m`."""
        return int(2.0 * self.max_range_m / LIGHT_SPEED_M_PER_NS / self.bin_ns) + 1
