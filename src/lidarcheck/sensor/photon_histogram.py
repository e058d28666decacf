"""The detector of a histogram chip: photons of many shots counted into bins, zone by zone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from lidarcheck.sensor.bounds import Bounds
from lidarcheck.sensor.sensor import Sensor

__all__ = ["PhotonHistogram"]

_BOUNDS: Mapping[str, Bounds] = {
    "spads": Bounds(1, 1_000_000, True, "SPADs a zone", 1),
    "shots": Bounds(1, 1_000_000_000, True, "shots a frame", 100_000),
    "bins": Bounds(8, 65_536, True, "bins", 1),
    "bin_ns": Bounds(1e-4, 1000.0, False, "ns", 0.001),
    "first_bin_ns": Bounds(-10_000.0, 10_000.0, False, "ns", 0.05),
    "dead_bins": Bounds(1, 65_536, True, "bins", 1),
    "background_per_ns": Bounds(0.0, 10.0, False, "avalanches per SPAD, shot and ns", 5e-7),
    "cover_glass": Bounds(0.0, 1e6, False, "avalanches per SPAD and shot", 1e-4),
    "threshold_sigma": Bounds(0.0, 1e6, False, "standard deviations", 0.5),
}


@dataclass(frozen=True, kw_only=True)
class PhotonHistogram(Sensor):
    """One histogram a zone and frame, of N = `spads` x `shots` trials.

    `first_bin_ns`: start of bin 0 against zero range. `readout`: "first" counts the first photon of each SPAD and shot,
    "all" every one outside the dead time of `dead_bins`. `cover_glass`: light that the cover sends back, at zero range.
    `pulse`: the pulse by bins, normalised, in place of the Gaussian; `pulse_file` where it was read from. `coates`:
    counts are corrected for photons that came too late to be the first.
    """

    detector: ClassVar[str] = "photon_histogram"
    bounds: ClassVar[Mapping[str, Bounds]] = _BOUNDS

    spads: int
    shots: int
    bins: int
    bin_ns: float
    first_bin_ns: float = 0.0
    readout: Literal["first", "all"] = "all"
    dead_bins: int = 1
    cover_glass: float = 0.0
    pulse_file: str = ""
    pulse: tuple[float, ...] = ()
    threshold_sigma: float = 5.0
    coates: bool = False

    __hash__ = Sensor.__hash__

    @property
    def threshold_counts(self) -> float:
        """As many counts as stand out of the background of a pulse's width."""
        background = self.trials * self.background_per_ns * self.pulse_fwhm_ns
        return self.threshold_sigma * math.sqrt(max(background, 1.0))

    def signal_of(self, counts: float) -> float:
        """The S that makes so many counts in a frame."""
        return counts / self.trials

    @property
    def trials(self) -> int:
        """N: SPADs times shots."""
        return self.spads * self.shots
