"""Air whose density differs from place to place: a random field over range and azimuth, another in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Surroundings
from lidarcheck.effects.draws import normals
from lidarcheck.sensor import LAYERS, POINTS, azimuth_deg

__all__ = ["Patches", "patches_of"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_WAVES = 16
_SECTOR_DEG = 0.5
_CELL_M = 1.0
_STEPS_PER_DOUBLING = 32
"""What a sector's air sends back counts in steps of 2 %, so that few numbers occur: detectors keep tables for each."""


@dataclass(frozen=True)
class Patches:
    """The density of the air relative to its mean: `density` (n_sectors, n_cells), in cells of `_CELL_M` of the range;
    beams of a point column look into the sector `sector[point]`, (POINTS,)."""

    sector: IndexArray
    density: FloatArray

    def depth_m(self, point: npt.NDArray[np.integer], range_m: FloatArray) -> FloatArray:
        """The integral of the relative density up to a range, as metres of even air; shape (n,) as both."""
        up_to = np.concatenate([np.zeros((len(self.density), 1)), np.cumsum(self.density, axis=1)], axis=1) * _CELL_M
        at = np.clip(range_m / _CELL_M, 0.0, self.density.shape[1])
        cell = np.minimum(at.astype(np.int64), self.density.shape[1] - 1)
        sector = self.sector[np.clip(point, 0, POINTS - 1)]
        low, high = up_to[sector, cell], up_to[sector, cell + 1]
        return np.asarray(low + (at - cell) * (high - low))

    def brightness(
        self, point: npt.NDArray[np.integer], profile: FloatArray, step_m: float, extinction_per_m: float
    ) -> FloatArray:
        """What the air sends back to beams of these columns, as a part of what even air would, (n,).

        `profile` (m,): what even air sends back, in cells of `step_m`. The patches change its total, not its form: they
        are larger than the range from which nearly all of it comes.
        """
        at_m = (np.arange(len(profile)) + 0.5) * step_m
        used = at_m < self.density.shape[1] * _CELL_M
        at_m, weight = at_m[used], profile[used]
        cell = (at_m / _CELL_M).astype(np.int64)
        depth_m = np.cumsum(self.density, axis=1)[:, cell] * _CELL_M - self.density[:, cell] * ((cell + 1) - at_m)
        sent = self.density[:, cell] * np.exp(-2.0 * extinction_per_m * (depth_m - at_m))
        part = sent @ weight / max(float(weight.sum()), 1e-300)
        part = np.exp2(np.round(np.log2(np.maximum(part, 1e-6)) * _STEPS_PER_DOUBLING) / _STEPS_PER_DOUBLING)
        return np.asarray(part[self.sector[np.clip(point, 0, POINTS - 1)]])


def patches_of(around: Surroundings, patchiness: float, patch_m: float, patch_deg: float) -> Patches:
    """The frame's own patches: exp(s g - s^2 / 2), g Gaussian of standard deviation 1, whose correlation falls by
    sqrt(e) over `patch_m` of the range and over `patch_deg` of the azimuth; `s` is `patchiness`.

    g is a sum of waves of random directions and phases, which over many frames has that correlation exactly.
    """
    # A layer beyond the sensor's own: what a frame has once is drawn apart from what columns have.
    uniform = around.uniforms([LAYERS], [0], 3 * _WAVES)[0].reshape(3, _WAVES)
    along, across, phase = normals(uniform[0]), normals(uniform[1]), 2.0 * np.pi * uniform[2]
    azimuth = azimuth_deg(np.arange(POINTS))
    sector = np.floor((azimuth - azimuth.min()) / _SECTOR_DEG).astype(np.int64)
    middle_deg = (np.arange(int(sector.max()) + 1) + 0.5) * _SECTOR_DEG
    cells = max(int(np.ceil(around.sensor.max_range_m / _CELL_M)), 1)
    range_m = (np.arange(cells) + 0.5) * _CELL_M
    turn = (
        along[:, None, None] * range_m / patch_m
        + (across[:, None] * middle_deg / patch_deg + phase[:, None])[..., None]
    )
    field = np.sqrt(2.0 / _WAVES) * np.cos(turn).sum(axis=0)
    return Patches(sector, np.exp(patchiness * field - 0.5 * patchiness**2))
