"""Air whose density differs from place to place: with height, and by a random field over range and azimuth, another in
every frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.effects.shared.draws import normals
from lidarcheck.scan import Light
from lidarcheck.sensor import Beams
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["Uneven", "brightness", "depth_m", "patches_of", "strata_of"]

_WAVES = 16
_SECTOR_DEG = 0.5
_STEP_DEG = 0.05
"""So fine are the elevations that air of beams without layers is told apart by."""
_WHOLE_TURN_DEG = 350.0
_CELL_M = 1.0
_STEPS_PER_DOUBLING = 32
"""What a row's air sends back counts in steps of 2 %, so that few numbers occur: detectors keep tables for each."""
_BLOCK = 8192
"""Beams that are looked at together: in large frames few of them look into the same air."""
_THICKEST = 20.0
"""The density's logarithm is kept between plus and minus this, far beyond any fog's."""


@dataclass(frozen=True)
class Uneven:
    """The density of the air relative to even air's: `density` (n_rows, n_cells), in cells of `_CELL_M` of the range;
    beams look into `row[layer]`, `row[point]` or `row[beams.index(layer, point)]`, as `by` says."""

    density: FloatArray
    row: IndexArray
    by: Literal["layer", "point", "beam"]

    def row_of(self, light: Light, beams: slice) -> IndexArray:
        """The row that each of some beams looks into, (n,)."""
        if self.by == "beam":
            at = light.beams.index(light.layer[beams], light.point[beams])
        else:
            at = np.asarray(getattr(light, self.by)[beams], dtype=np.int64)
        return self.row[np.clip(at, 0, len(self.row) - 1)]


def depth_m(parts: Sequence[Uneven], light: Light) -> FloatArray:
    """The integral of the relative density up to each pulse's range, as metres of even air; shape (n_pulses,).

    The density is the product of the parts'.
    """
    found = [np.empty(0)]
    for beams, density, row in _blocks(parts, light):
        up_to = np.concatenate([np.zeros((len(density), 1)), np.cumsum(density, axis=1)], axis=1) * _CELL_M
        first = light.first_pulse[beams.start : beams.stop + 1]
        at = np.clip(light.pulse_range_m[first[0] : first[-1]] / _CELL_M, 0.0, density.shape[1])
        cell = np.minimum(at.astype(np.int64), density.shape[1] - 1)
        mine = np.repeat(row, np.diff(first))
        low, high = up_to[mine, cell], up_to[mine, cell + 1]
        found.append(low + (at - cell) * (high - low))
    return np.concatenate(found)


def brightness(
    parts: Sequence[Uneven], light: Light, profile: FloatArray, step_m: float, extinction_per_m: float
) -> FloatArray:
    """What the air sends back to each beam, as a part of what even air would, (n_beams,).

    `profile` (m,): what even air sends back, in cells of `step_m`. Uneven air changes its total, not its form: its
    density differs little over the range from which nearly all of it comes.
    """
    found = [np.empty(0)]
    at_m = (np.arange(len(profile)) + 0.5) * step_m
    for _, density, row in _blocks(parts, light):
        used = at_m < density.shape[1] * _CELL_M
        here_m, weight = at_m[used], profile[used]
        cell = (here_m / _CELL_M).astype(np.int64)
        deep_m = np.cumsum(density, axis=1)[:, cell] * _CELL_M - density[:, cell] * ((cell + 1) - here_m)
        sent = density[:, cell] * elementary.exp(-2.0 * extinction_per_m * (deep_m - here_m))
        part = elementary.product(sent, weight) / max(float(weight.sum()), 1e-300)
        part = elementary.exp2(
            np.round(elementary.log2(np.maximum(part, 1e-6)) * _STEPS_PER_DOUBLING) / _STEPS_PER_DOUBLING
        )
        found.append(part[row])
    return np.concatenate(found)


def _blocks(parts: Sequence[Uneven], light: Light) -> Iterator[tuple[slice, FloatArray, IndexArray]]:
    """Beams that follow each other, the densities that they look into, and the row of these for each, (n,)."""
    for start in range(0, len(light), _BLOCK):
        beams = slice(start, min(start + _BLOCK, len(light)))
        row, density = np.zeros(beams.stop - start, dtype=np.int64), np.ones((1, 1))
        for part in parts:
            pair, row = np.unique(row * len(part.density) + part.row_of(light, beams), return_inverse=True)
            density = density[pair // len(part.density)] * part.density[pair % len(part.density)]
        yield beams, density, row


def strata_of(around: Surroundings, thinning_per_m: float) -> Uneven:
    """Air that thins out with the height above the sensor as exp(-t z), z = R sin(elevation); t is `thinning_per_m`."""
    cells = max(int(np.ceil(around.sensor.max_range_m / _CELL_M)), 1)
    range_m = (np.arange(cells) + 0.5) * _CELL_M
    elevation, row, by = _elevations(around.ideal.beams)
    climb = elementary.sin(np.deg2rad(elevation))
    density = elementary.exp(np.clip(-thinning_per_m * climb[:, None] * range_m, -_THICKEST, _THICKEST))
    return Uneven(density, row, by)


def _elevations(beams: Beams) -> tuple[FloatArray, IndexArray, Literal["layer", "beam"]]:
    """The elevations of the air's rows [deg], and the row of each layer, or of each beam."""
    layers = np.arange(beams.layers)
    if beams.grid or isinstance(beams, ChannelBeams):
        return beams.angles_deg(layers, 0)[0], layers, "layer"
    layer, point = beams.every()
    step = np.rint(beams.angles_deg(layer, point)[0] / _STEP_DEG).astype(np.int64)
    row = np.zeros(beams.size, dtype=np.int64)
    row[beams.index(layer, point)] = step - step.min()
    return np.arange(step.min(), step.max() + 1) * _STEP_DEG, row, "beam"


def _azimuths(beams: Beams) -> tuple[FloatArray, IndexArray, Literal["point", "beam"]]:
    """The azimuths of all points, or of all beams [deg], and their places among `size` numbers."""
    if beams.grid:
        points = np.arange(beams.points)
        return beams.angles_deg(0, points)[1], points, "point"
    layer, point = beams.every()
    return beams.angles_deg(layer, point)[1], beams.index(layer, point), "beam"


def patches_of(around: Surroundings, patchiness: float, patch_m: float, patch_deg: float) -> Uneven:
    """The frame's own patches: exp(s g - s^2 / 2), g Gaussian of standard deviation 1, whose correlation falls by
    sqrt(e) over `patch_m` of the range and over `patch_deg` of the azimuth; `s` is `patchiness`.

    g is a sum of waves of random directions and phases, which over many frames has that correlation exactly.
    """
    # A layer beyond the sensor's own: what a frame has once is drawn apart from what columns have.
    beams = around.ideal.beams
    uniform = around.uniforms([beams.layers], [0], 3 * _WAVES)[0].reshape(3, _WAVES)
    along, across, phase = normals(uniform[0]), normals(uniform[1]), 2.0 * np.pi * uniform[2]
    azimuth, place, by = _azimuths(beams)
    first, span = azimuth.min(), azimuth.max() - azimuth.min()
    sector = np.zeros(beams.points if by == "point" else beams.size, dtype=np.int64)
    sector[place] = np.floor((azimuth - first) / _SECTOR_DEG).astype(np.int64)
    middle_deg = (np.arange(int(sector.max()) + 1) + 0.5) * _SECTOR_DEG
    cells = max(int(np.ceil(around.sensor.max_range_m / _CELL_M)), 1)
    range_m = (np.arange(cells) + 0.5) * _CELL_M
    if span > _WHOLE_TURN_DEG:
        # Waves that fit a turn: the last sector lies beside the first.
        per_rad = 360.0 / (2.0 * np.pi * patch_deg)
        across = np.rint(across * per_rad) / per_rad
    turn = (
        along[:, None, None] * range_m / patch_m
        + (across[:, None] * middle_deg / patch_deg + phase[:, None])[..., None]
    )
    field = np.sqrt(2.0 / _WAVES) * elementary.cos(turn).sum(axis=0)
    return Uneven(elementary.exp(patchiness * field - 0.5 * patchiness**2), sector, by)
