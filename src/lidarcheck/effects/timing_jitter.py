"""An echo's time scatters by more than photon statistics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck import elementary
from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.shared.draws import normals
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.scan import Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS

__all__ = ["TimingJitter"]

_REFERENCE_AREA = 1000.0


@dataclass(frozen=True)
class TimingJitter(ReadoutEffect):
    """An echo's time scatters by more than photon statistics.

    R' = R + c / 2 (sigma (AREA / 1000)^-amplitude_power z + uniform_ns v), z standard normal, v uniform in -1 ... 1,
    drawn anew for each echo; at power 0 the scatter is that of every echo alike, at 0.5 as of averaging: jitter of the
    trigger, of the clock or of the converter, common to the detectors of a beam, which averaging over them does
    not remove. 1 ns of sigma is 0.15 m. `uniform_ns` is the half-width of a step that the converter rounds to. What
    limits such sensors: Villa et al., "SPADs and SiPMs arrays for long-range high-speed light detection and ranging",
    Sensors 21(11):3839, 2021.

    The echoes of a beam that change places are numbered anew. Valid while the jitter is below the spacing of echoes.
    Identity at sigma 0 and uniform_ns 0.
    """

    name = "timing_jitter"

    sigma_ns: float = parameter(
        "ns", low=0.0, high=100.0, typical=0.7, noticeable=0.1, meaning="standard deviation of an echo's time"
    )
    uniform_ns: float = parameter(
        "ns", low=0.0, high=100.0, typical=0.0, noticeable=0.5, meaning="half-width of a further, uniform scatter"
    )

    amplitude_power: float = parameter(
        "",
        low=0.0,
        high=2.0,
        typical=0.0,
        noticeable=0.25,
        meaning="power of AREA by which sigma falls, sigma_ns being that at AREA 1000",
    )

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move each echo by its own draw."""
        if (self.sigma_ns == 0.0 and self.uniform_ns == 0.0) or len(scan) == 0:
            return scan
        echo = np.maximum(scan.echo_number.astype(np.int64) - 1, 0)
        uniform = around.uniforms(scan.layer, scan.point, 2 * (int(echo.max()) + 1))
        rows = np.arange(len(scan))
        weaker = elementary.power(np.maximum(scan.area, 1.0) / _REFERENCE_AREA, -self.amplitude_power)
        late_ns = self.sigma_ns * weaker * normals(uniform[rows, 2 * echo])
        late_ns += self.uniform_ns * (2.0 * uniform[rows, 2 * echo + 1] - 1.0)
        return at_range(scan, scan.range_m + 0.5 * LIGHT_SPEED_M_PER_NS * late_ns)
