"""Scattered single echoes from drops, with mild extinction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter, unfit_for
from lidarcheck.effects.geometry.beam_rows import BeamRows
from lidarcheck.effects.geometry.own_rays import shares_that_end
from lidarcheck.effects.shared.air import ends_of
from lidarcheck.effects.shared.draws import strikes
from lidarcheck.scan import Light
from lidarcheck.sensor import Sensor

__all__ = ["Rain"]

FRESNEL = ((1.33 - 1.0) / (1.33 + 1.0)) ** 2
"""What a water surface reflects at normal incidence, 2 %; refractive index 1.33 at 905 nm."""
LARGEST_MM = 6.0
"""Larger drops break up."""
_FAINT = 0.1
"""A drop counts from this part of the avalanches on that an echo needs."""
_MOST = 4.0
"""Drops per beam, on average, that are followed; the sensor lists three echoes."""
_GRID_M = 0.01


@dataclass(frozen=True)
class Rain(LightEffect):
    """Scattered single echoes from drops, with mild extinction.

    Extinction: S' = S exp(-2 alpha R), alpha = extinction_coefficient rate^extinction_exponent. Drops of diameter D are
    as many as Marshall and Palmer counted (J. Meteorol. 5, 1948), N(D) = 8000 exp(-4.1 rate^-0.21 D) per m^3 and mm up
    to 6 mm, times `drop_density`, scattered at random in a beam of diameter d = beam_diameter_m + divergence R; in
    front of what the beam meets each gives a pulse S = drop_echo K F min((D / d)^2, 1) exp(-2 alpha R) / R^2, F = 2 %
    the Fresnel reflectance of water (Kilic et al., "Lidar light scattering augmentation (LISA)", 2021; Goodin et al.,
    "Predicting the influence of rain on lidar in ADAS", Electronics 8(1):89, 2019).

    Only drops of at least a tenth of the signal that an echo needs are drawn, and the brightest four per beam on
    average where they would be more; what all others return together is below 8 % of an echo's need up to 100 mm/h,
    with both factors typical or 1. Valid from drizzle to cloudbursts; the typical `drop_echo` and `drop_density` put
    false echoes into a few percent of the beams over the first tens of metres, where 1 and 1 stand for spheres that
    return only what their front reflects. Fog that stands behind this effect dims the drops, fog before it does not.
    Identity at rate 0.
    """

    name = "rain"
    unfit = unfit_for(photon_histogram="a zone is wide and near: drops are no echoes of their own in it")
    tree = (87, 89)
    scatters = True

    rate_mm_h: float = parameter("mm/h", low=0.0, high=300.0, typical=25.0, noticeable=5.0, meaning="rate of rain")
    extinction_coefficient: float = parameter(
        "1/m", low=0.0, high=0.1, typical=3.65e-4, noticeable=9e-5, meaning="extinction at 1 mm/h"
    )
    extinction_exponent: float = parameter(
        "", low=0.0, high=2.0, typical=0.63, noticeable=0.06, meaning="power of the rate in it"
    )
    drop_echo: float = parameter(
        "", low=0.0, high=1e4, typical=60.0, noticeable=15.0, meaning="factor on the brightness of drops"
    )
    drop_density: float = parameter(
        "", low=0.0, high=1e3, typical=0.01, noticeable=0.0025, meaning="factor on the number of drops"
    )
    beam_diameter_m: float = parameter(
        "m", low=1e-4, high=1.0, typical=0.01, noticeable=0.002, meaning="beam's diameter at the sensor"
    )
    divergence_mrad: float = parameter(
        "mrad", low=0.0, high=100.0, typical=1.4, noticeable=0.28, meaning="full angle of the beam"
    )
    nearest_m: float = parameter(
        "m", low=0.1, high=100.0, typical=1.0, noticeable=0.2, meaning="range from which on drops are seen"
    )
    drop_shape: float = parameter(
        "",
        low=0.0,
        high=10.0,
        typical=0.0,
        noticeable=1.0,
        meaning="power of the diameter in the number of drops; 0: exponential",
        option=True,
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Attenuate what there is and add the pulses of drops."""
        if self.rate_mm_h == 0.0:
            return light
        beam, range_m, signal = self._drops(light, around)
        rows = BeamRows.of(light, around.ideal, shares_that_end(around.ideal))
        # What took its toll before, as fog in the same air, takes it from the drops' light as well.
        signal = signal * elementary.exp(-2.0 * light.extinction_per_m * range_m)
        signal *= rows.reaching(beam, range_m, ends_of(rows, around.ideal, math.inf))
        seen = signal > 0.0
        return light.attenuated(self.extinction_per_m).with_pulses(beam[seen], range_m[seen], signal[seen])

    @property
    def extinction_per_m(self) -> float:
        """Alpha of the rain."""
        return self.extinction_coefficient * float(elementary.power(self.rate_mm_h, self.extinction_exponent))

    def _drops(self, light: Light, around: Surroundings) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
        """Beam, range and signal of every drop that matters, with nothing in its way; shape (m,) each."""
        floor = self._floor(around.sensor)
        grid_m, expected = self._expected(around.sensor, floor)
        beam, uniform = strikes(around, light.layer, light.point, float(expected[-1]))
        range_m = elementary.interp(uniform[:, 0] * expected[-1], expected, grid_m)
        smallest_mm = np.minimum(self._smallest_mm(range_m, around.sensor, floor), LARGEST_MM)
        diameter_mm = self._diameter_mm(smallest_mm, uniform[:, 1])
        return beam, range_m, self._signal(range_m, diameter_mm, around.sensor)

    @property
    def _slope_per_mm(self) -> float:
        return 4.1 * float(elementary.power(self.rate_mm_h, -0.21))

    @property
    def _whole_per_m3(self) -> float:
        """Drops of any size."""
        power = self.drop_shape + 1.0
        return 8000.0 * float(elementary.exp(elementary.lgamma(power)) / elementary.power(self._slope_per_mm, power))

    def _larger(self, diameter_mm: FloatArray) -> FloatArray:
        """The part of the drops that are larger; same shape."""
        if self.drop_shape == 0.0:
            return np.asarray(elementary.exp(-self._slope_per_mm * diameter_mm))
        from scipy.special import gammaincc

        return np.asarray(gammaincc(self.drop_shape + 1.0, self._slope_per_mm * diameter_mm))

    def _diameter_mm(self, smallest_mm: FloatArray, uniform: FloatArray) -> FloatArray:
        """Diameters of drops above the smallest ones, by the inverse of the distribution function; same shape."""
        near, far = self._larger(smallest_mm), self._larger(np.array(LARGEST_MM))
        larger = near - uniform * (near - far)
        if self.drop_shape == 0.0:
            return np.asarray(-elementary.log(larger) / self._slope_per_mm)
        from scipy.special import gammainccinv

        return np.asarray(gammainccinv(self.drop_shape + 1.0, larger) / self._slope_per_mm)

    def _beam_mm(self, range_m: FloatArray) -> FloatArray:
        return 1e3 * self.beam_diameter_m + self.divergence_mrad * range_m

    def _covering(self, range_m: FloatArray, sensor: Sensor) -> FloatArray:
        """S of a drop that fills the beam."""
        strength = self.drop_echo * sensor.signal_at_1m * FRESNEL
        return np.asarray(strength * elementary.exp(-2.0 * self.extinction_per_m * range_m) / range_m**2)

    def _signal(self, range_m: FloatArray, diameter_mm: FloatArray, sensor: Sensor) -> FloatArray:
        part = np.minimum((diameter_mm / self._beam_mm(range_m)) ** 2, 1.0)
        return self._covering(range_m, sensor) * part

    def _smallest_mm(self, range_m: FloatArray, sensor: Sensor, floor: float) -> FloatArray:
        """Diameter of the smallest drop whose S reaches `floor`; above `LARGEST_MM` where none does."""
        part = floor / np.maximum(self._covering(range_m, sensor), 1e-300)
        return np.where(part <= 1.0, self._beam_mm(range_m) * np.sqrt(np.minimum(part, 1.0)), 2.0 * LARGEST_MM)

    def _expected(self, sensor: Sensor, floor: float) -> tuple[FloatArray, FloatArray]:
        """Ranges and the expected number of drops of S >= `floor` in a beam up to there; shape (m,) each."""
        cells = max(math.ceil((sensor.max_range_m - self.nearest_m) / _GRID_M), 1)
        grid_m = self.nearest_m + np.arange(cells + 1, dtype=np.float64) * _GRID_M
        smallest_mm = np.minimum(self._smallest_mm(grid_m, sensor, floor), LARGEST_MM)
        per_m3 = self._whole_per_m3 * np.maximum(self._larger(smallest_mm) - self._larger(np.array(LARGEST_MM)), 0.0)
        per_m = self.drop_density * per_m3 * 0.25 * math.pi * (1e-3 * self._beam_mm(grid_m)) ** 2
        return grid_m, np.concatenate([[0.0], np.cumsum(0.5 * (per_m[1:] + per_m[:-1]) * _GRID_M)])

    def _floor(self, sensor: Sensor) -> float:
        """The S from which on a drop counts."""
        floor = sensor.signal_of(_FAINT * sensor.threshold_counts)
        if self._expected(sensor, floor)[1][-1] <= _MOST:
            return floor
        low, high = (
            elementary.log(max(floor, 1e-300)),  # a sensor without noise may see whatever there is
            elementary.log(max(self.drop_echo * sensor.signal_at_1m / self.nearest_m**2, floor)),
        )
        while high - low > 1e-3:
            middle = 0.5 * (low + high)
            many = self._expected(sensor, elementary.exp(middle))[1][-1] > _MOST
            low, high = (middle, high) if many else (low, middle)
        return float(elementary.exp(high))
