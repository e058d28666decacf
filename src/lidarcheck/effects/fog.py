"""Extinction with range, and backscatter close to the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.shared.air import STEP_M, with_haze
from lidarcheck.effects.shared.air_patches import Uneven, brightness, depth_m, patches_of, strata_of
from lidarcheck.effects.shared.draws import check_interval
from lidarcheck.scan import Light

__all__ = ["Fog"]

CLEAR_M = 1e6
_NEAREST_M = 0.05
"""The window: no air before it sends light back, whatever the overlap says."""
_NODES = 8
_FAINT_PER_M = 1e-5
"""Where the profile ends: S per metre of air, half a percent of the reference sensor's background."""


@dataclass(frozen=True)
class Fog(LightEffect):
    """Extinction with range, and backscatter close to the sensor.

    Homogeneous fog of meteorological optical range MOR: alpha = ln 20 / MOR, beta = backscatter / MOR. Surfaces: S' = S
    exp(-2 alpha R). The air itself, in single scattering, up to what the beam meets: dS/dR = K pi beta exp(-2 alpha R)
    / R^2 times the overlap of the fields of view of laser and receiver, which rises from 0 at `overlap_start_m`:
    linearly to 1 at `overlap_full_m` where `overlap_power` is 0, else as 1 - 20^-u^overlap_power, u = (R - start) /
    (full - start), which is 95 % at `overlap_full_m`. A hard target with beta0 = rho / pi gives the same K rho / R^2
    (Rasshofer, Spies and Spies, "Influences of weather phenomena on automotive laser radar systems", Adv. Radio Sci. 9,
    2011; Hahner et al., "Fog simulation on real lidar point clouds", ICCV 2021, with beta = 0.046 / MOR, 0.023 ...
    0.092 in their droplet distributions, and an overlap from 0.9 m to 1 m).

    With `patchiness` s > 0 the air is denser here and thinner there, by exp(s g - s^2 / 2), mean 1: g is a Gaussian
    field of standard deviation 1 over range and azimuth, another in every frame, whose correlation falls by sqrt(e)
    over `patch_m` and over `patch_deg`. What the air sends back from close by then differs between directions and
    frames, and so does the light that surfaces lose. With `thinning_per_m` t it thins out with height, as exp(-t z) at
    z = R sin(elevation) above the sensor: to 37 % over 1 / t; below 0 it is denser above, as fog that has lifted. MOR
    is then the one at the sensor's height.

    Valid while multiple scattering is weak, R below about MOR / 2 for the backscatter, and for patches and layers
    larger than the few metres that most backscatter comes from; the fog does not change over the frame. Extinction
    takes its toll of all light that stands before this effect, and of what the air sends back also where that comes
    later; there, and of other air's light, the mean extinction counts.
    Identity at mor_m 1e6, clear air, where extinction would take 0.2 % at 300 m.
    """

    name = "fog"
    tree = (87, 89)
    scatters = True

    mor_m: float = parameter(
        "m", low=5.0, high=CLEAR_M, typical=100.0, noticeable=10.0, meaning="meteorological optical range"
    )
    backscatter: float = parameter(
        "1/sr", low=0.0, high=10.0, typical=0.046, noticeable=0.0115, meaning="backscatter coefficient times MOR"
    )
    overlap_start_m: float = parameter(
        "m",
        low=0.0,
        high=50.0,
        typical=0.9,
        noticeable=-0.18,
        meaning="range where the receiver begins to see the laser's beam",
    )
    overlap_full_m: float = parameter(
        "m",
        low=0.1,
        high=100.0,
        typical=1.0,
        noticeable=0.2,
        meaning="range from which on the receiver sees all of the laser's beam",
    )

    overlap_power: float = parameter(
        "", low=0.0, high=10.0, typical=0.0, noticeable=0.25, meaning="how the overlap rises; 0: linearly"
    )
    patchiness: float = parameter(
        "",
        low=0.0,
        high=2.0,
        typical=0.0,
        noticeable=0.2,
        meaning="standard deviation of the density's logarithm; 0: even",
        option=True,
    )
    patch_m: float = parameter(
        "m",
        low=1.0,
        high=1000.0,
        typical=15.0,
        noticeable=3.0,
        meaning="size of the patches along the range",
        option=True,
    )
    patch_deg: float = parameter(
        "deg", low=0.5, high=1000.0, typical=15.0, noticeable=3.0, meaning="size of the patches in azimuth", option=True
    )
    thinning_per_m: float = parameter(
        "1/m",
        low=-1.0,
        high=2.0,
        typical=0.0,
        noticeable=0.1,
        meaning="what the density's logarithm loses per metre of height; 0: even",
        option=True,
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
        even = with_haze(light.attenuated(self.extinction_per_m), around.ideal, density)
        air = self._uneven(around)
        if not air:
            return even
        haze = even.haze
        if haze is not None and len(density):
            bright = brightness(air, light, density, STEP_M, self.extinction_per_m)
            haze = replace(haze, row_share=haze.row_share * np.repeat(bright, np.diff(haze.first_row)))
        toll = elementary.exp(-2.0 * self.extinction_per_m * depth_m(air, light))
        return replace(even, pulse_signal=light.pulse_signal * toll, haze=haze)

    def _uneven(self, around: Surroundings) -> list[Uneven]:
        """How the density differs from place to place; empty for even fog."""
        parts = []
        if self.patchiness > 0.0:
            parts.append(patches_of(around, self.patchiness, self.patch_m, self.patch_deg))
        if self.thinning_per_m != 0.0:
            parts.append(strata_of(around, self.thinning_per_m))
        return parts

    @property
    def extinction_per_m(self) -> float:
        """Alpha: a contrast of 5 % is left over the meteorological optical range."""
        return float(elementary.log(20.0) / self.mor_m)

    def _density_per_m(self, strength: float, extinction_per_m: float, max_range_m: float) -> FloatArray:
        """S per metre of each cell, up to where it stays faint; `strength` is K pi beta. Shape (m,)."""
        edge_m = np.arange(math.ceil(max_range_m / STEP_M) + 1, dtype=np.float64) * STEP_M
        at_m = edge_m[1:]
        bright = strength * elementary.exp(-2.0 * extinction_per_m * at_m) / at_m**2 >= _FAINT_PER_M
        bright &= at_m > self.overlap_start_m
        cells = int(np.flatnonzero(bright)[-1]) + 1 if bright.any() else 0
        if not cells:
            return np.empty(0)
        return strength * np.diff(self._integral(edge_m[: cells + 1], 2.0 * extinction_per_m)) / STEP_M

    def _integral(self, range_m: FloatArray, decay: float) -> FloatArray:
        """Integral of overlap exp(-decay R) / R^2 from the sensor to each of rising `range_m`; same shape.

        Each cell by Gauss-Legendre quadrature in pieces that no kink of the overlap divides.
        """
        kinks = np.array([_NEAREST_M, self.overlap_start_m, self.overlap_full_m])
        edges = np.unique(np.concatenate([range_m, kinks[(kinks > range_m[0]) & (kinks < range_m[-1])]]))
        node, weight = elementary.gauss_legendre(_NODES)
        half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        at_m = middle[:, None] + half[:, None] * node
        light = self._overlap(at_m) * elementary.exp(-decay * at_m) / np.maximum(at_m, _NEAREST_M) ** 2
        pieces = half * elementary.product(light, weight)
        return np.asarray(np.interp(range_m, edges, np.concatenate([[0.0], np.cumsum(pieces)])))

    def _overlap(self, range_m: FloatArray) -> FloatArray:
        """Share of the laser's beam that the receiver sees; same shape."""
        wide = max(self.overlap_full_m - self.overlap_start_m, 1e-9)
        u = np.maximum(range_m - self.overlap_start_m, 0.0) / wide
        rise = (
            np.minimum(u, 1.0)
            if self.overlap_power == 0.0
            else -elementary.expm1(-elementary.log(20.0) * _power(u, self.overlap_power))
        )
        return np.where(range_m < _NEAREST_M, 0.0, rise)


def _power(u: FloatArray, power: float) -> FloatArray:
    """u^power, no more than what exp can take."""
    return np.asarray(np.minimum(elementary.power(np.minimum(u, 1e6), power), 700.0))
