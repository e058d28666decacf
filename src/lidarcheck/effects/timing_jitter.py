"""An echo's time scatters by more than photon statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.shared.draws import normals
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.errors import UsageError
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, PhotonHistogram, Sensor

__all__ = ["TimingJitter"]

_REFERENCE_AREA = 1000.0
_REACH = 5.0


@dataclass(frozen=True)
class TimingJitter(ReadoutEffect):
    """An echo's time scatters by more than photon statistics.

    R' = R + c / 2 (sigma (AREA / 1000)^-amplitude_power z + uniform_ns v), z standard normal, v uniform in -1 ... 1,
    drawn anew for each echo; at power 0 the scatter is that of every echo alike, at 0.5 as of averaging: jitter of the
    trigger, of the clock or of the converter, common to the detectors of a beam, which averaging over them does
    not remove. 1 ns of sigma is 0.15 m. `uniform_ns` is the half-width of a step that the converter rounds to. What
    limits such sensors: Villa et al., "SPADs and SiPMs arrays for long-range high-speed light detection and ranging",
    Sensors 21(11):3839, 2021.

    Of a linear detector it adds to the range noise of the sensor file, of which `range_floor_m` is one number with it.
    In a histogram of many shots photons jitter one by one: its pulse is wider, also that of the cover glass, and an
    echo of N photons scatters by sigma / sqrt(N) alone.

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

    def check(self, sensor: Sensor) -> None:
        """Also refuse a scatter by amplitude where no echo scatters as a whole."""
        super().check(sensor)
        if isinstance(sensor, PhotonHistogram) and self.amplitude_power != 0.0:
            what = f"timing_jitter: amplitude_power = {self.amplitude_power:g} means nothing for {sensor.name}, whose"
            raise UsageError(f"{what} photons jitter one by one", fix="use amplitude_power = 0")

    def before(self, light: Light, sensor: Sensor) -> tuple[Light, Sensor]:
        """Widen the pulse of a histogram: photons of many shots jitter one by one, the cover glass's too."""
        variance = self.sigma_ns**2 + self.uniform_ns**2 / 3.0
        if not isinstance(sensor, PhotonHistogram) or variance == 0.0:
            return light, sensor
        shape = light.shape
        if shape is not None:
            shape = replace(shape, fwhm_ns=_wider_ns(shape.fwhm_ns, variance))
        pulse = _blurred(sensor.pulse, float(np.sqrt(variance)) / sensor.bin_ns) if sensor.pulse else ()
        wider = replace(sensor, pulse_fwhm_ns=_wider_ns(sensor.pulse_fwhm_ns, variance), pulse=pulse)
        return replace(light, shape=shape), wider

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move each echo by its own draw."""
        if (self.sigma_ns == 0.0 and self.uniform_ns == 0.0) or len(scan) == 0:
            return scan
        if isinstance(around.sensor, PhotonHistogram):
            return scan  # its pulse is wider already, and echoes scatter by that
        echo = np.maximum(scan.echo_number.astype(np.int64) - 1, 0)
        uniform = around.uniforms(scan.layer, scan.point, 2 * (int(echo.max()) + 1))
        rows = np.arange(len(scan))
        weaker = elementary.power(np.maximum(scan.strength, 1.0) / _REFERENCE_AREA, -self.amplitude_power)
        late_ns = self.sigma_ns * weaker * normals(uniform[rows, 2 * echo])
        late_ns += self.uniform_ns * (2.0 * uniform[rows, 2 * echo + 1] - 1.0)
        return at_range(scan, scan.range_m + 0.5 * LIGHT_SPEED_M_PER_NS * late_ns)


def _wider_ns(fwhm_ns: float, variance: float) -> float:
    """The width of a Gaussian pulse whose variance grows by so much [ns^2]."""
    return float(np.sqrt(fwhm_ns**2 + FWHM_PER_SIGMA**2 * variance))


def _blurred(pulse: tuple[float, ...], sigma_bins: float) -> tuple[float, ...]:
    """Counts of consecutive bins whose light is spread by a Gaussian."""
    from scipy.special import ndtr

    half = int(np.ceil(_REACH * sigma_bins))
    kernel = np.diff(ndtr((np.arange(-half, half + 2) - 0.5) / sigma_bins))
    return tuple(np.convolve(pulse, kernel / kernel.sum()).tolist())
