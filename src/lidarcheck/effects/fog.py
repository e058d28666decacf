"""Extinction with range, and backscatter close to the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.air import STEP_M, with_haze
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.draws import check_interval
from lidarcheck.scan import Light

__all__ = ["Fog"]

FloatArray = npt.NDArray[np.float64]

CLEAR_M = 1e6
_FAINT_PER_M = 1e-5
"""Where the profile ends: S per metre of air, half a percent of the reference sensor's background."""


@dataclass(frozen=True)
class Fog(LightEffect):
    """Extinction with range, and backscatter close to the sensor.

    Homogeneous fog of meteorological optical range MOR: alpha = ln 20 / MOR, beta = backscatter / MOR. Surfaces:
    S' = S exp(-2 alpha R). The air itself, in single scattering, up to what the beam meets:
    dS/dR = K pi beta exp(-2 alpha R) / R^2 times the overlap of the fields of view of laser and receiver, which rises
    linearly from 0 at `overlap_start_m` to 1 at `overlap_full_m`. A hard target with beta0 = rho / pi gives the same
    K rho / R^2 (Rasshofer, Spies and Spies, "Influences of weather phenomena on automotive laser radar systems",
    Adv. Radio Sci. 9, 2011; Hahner et al., "Fog simulation on real lidar point clouds", ICCV 2021, with beta = 0.046 /
    MOR, 0.023 ... 0.092 in their droplet distributions, and an overlap from 0.9 m to 1 m).

    Valid while multiple scattering is weak, R below about MOR / 2 for the backscatter; the fog does not change over the
    frame. Extinction takes its toll of all light that stands before this effect, and of what the air sends back also
    where that comes later.
    Identity at mor_m 1e6, clear air, where extinction would take 0.2 % at 300 m.
    """

    name = "fog"
    tree = (87, 89)

    mor_m: float = parameter("m", low=5.0, high=CLEAR_M, typical=100.0, meaning="meteorological optical range")
    backscatter: float = parameter(
        "1/sr", low=0.0, high=10.0, typical=0.046, meaning="backscatter coefficient times MOR"
    )
    overlap_start_m: float = parameter(
        "m", low=0.1, high=50.0, typical=0.9, meaning="range where the receiver begins to see the laser's beam"
    )
    overlap_full_m: float = parameter(
        "m", low=0.1, high=100.0, typical=1.0, meaning="range from which on the receiver sees all of the laser's beam"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        ends = ("overlap_start_m", self.overlap_start_m), ("overlap_full_m", self.overlap_full_m)
        check_interval(self.name, *ends)

    def light(self, light: Light, around: Surroundings) -> Light:
        """Attenuate what there is and add the fog's own backscatter."""
        if self.mor_m == CLEAR_M:
            return light
        strength = around.sensor.signal_at_1m * math.pi * self.backscatter / self.mor_m
        # What took its toll before, as rain in the same air, takes it from the fog's own light as well.
        extinction_per_m = self.extinction_per_m + light.extinction_per_m
        density = self._density_per_m(strength, extinction_per_m, around.sensor.max_range_m)
        return with_haze(light.attenuated(self.extinction_per_m), around.ideal, density)

    @property
    def extinction_per_m(self) -> float:
        """Alpha: a contrast of 5 % is left over the meteorological optical range."""
        return math.log(20.0) / self.mor_m

    def _density_per_m(self, strength: float, extinction_per_m: float, max_range_m: float) -> FloatArray:
        """S per metre of each cell, up to where it stays faint; `strength` is K pi beta. Shape (m,)."""
        edge_m = np.arange(math.ceil(max_range_m / STEP_M) + 1, dtype=np.float64) * STEP_M
        at_m = edge_m[1:]
        bright = strength * np.exp(-2.0 * extinction_per_m * at_m) / at_m**2 >= _FAINT_PER_M
        bright &= at_m > self.overlap_start_m
        cells = int(np.flatnonzero(bright)[-1]) + 1 if bright.any() else 0
        if not cells:
            return np.empty(0)
        return strength * np.diff(self._integral(edge_m[: cells + 1], 2.0 * extinction_per_m)) / STEP_M

    def _integral(self, range_m: FloatArray, decay: float) -> FloatArray:
        """Integral of overlap exp(-decay R) / R^2 from the sensor to `range_m`, exactly; same shape."""
        from scipy.special import exp1

        start, full = self.overlap_start_m, self.overlap_full_m

        def inverse_square(at: FloatArray) -> FloatArray:
            return np.asarray(decay * exp1(decay * at) - np.exp(-decay * at) / at)

        def inverse(at: FloatArray) -> FloatArray:
            return np.asarray(-exp1(decay * at))

        beyond = np.maximum(range_m, full)
        integral = inverse_square(beyond) - inverse_square(np.array(full))
        if full - start > 1e-6:
            within, begin = np.clip(range_m, start, full), np.array(start)
            rise = inverse(within) - inverse(begin) - start * (inverse_square(within) - inverse_square(begin))
            integral = integral + rise / (full - start)
        # Differences of nearly equal numbers must not leave a falling integral: light is never negative.
        return np.maximum.accumulate(integral)
