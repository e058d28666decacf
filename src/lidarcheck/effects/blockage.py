"""Part of the field of view is dimmed or dark: dirt on the window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.shared.draws import check_interval
from lidarcheck.scan import Light
from lidarcheck.sensor import LAYERS, POINTS, azimuth_deg, elevation_deg

__all__ = ["Blockage"]

_LAYER_DEG = 0.05
_POINT_DEG = 0.125


@dataclass(frozen=True)
class Blockage(LightEffect):
    """Part of the field of view is dimmed or dark: dirt on the window.

    A patch from `first_layer` to `last_layer` and `first_point` to `last_point`, its corners rounded off: radius
    `roundness` times half its shorter side. S' = T S inside, for pulses and backscatter of the air. `transmission` T is
    that of the laser's way out and back; the background passes once and is scaled by T^background_power, 0.5 where both
    ways lead through the same dirt, 1 where the dirt lies before the receiver alone, 0 where before the laser alone.
    Dirt on the window is out of focus and has no sharp edge: over `soft_edge_deg` around the patch, T rises linearly
    to 1. How far dirt dims a laser scanner was measured by Rivero et al., "Characterization and simulation of the
    effect of road dirt on the performance of a laser scanner", ITSC 2017.

    Valid for dirt that dims; it scatters no light into other beams. Identity at transmission 1.
    """

    name = "blockage"

    transmission: float = parameter(
        "", low=0.0, high=1.0, typical=0.3, noticeable=0.03, meaning="factor on the signal inside the patch"
    )
    first_layer: int = parameter(
        "layer", low=0, high=LAYERS - 1, typical=220, whole=True, noticeable=10, meaning="lowest such layer"
    )
    last_layer: int = parameter(
        "layer", low=0, high=LAYERS - 1, typical=299, whole=True, noticeable=10, meaning="highest such layer"
    )
    first_point: int = parameter(
        "point", low=0, high=POINTS - 1, typical=440, whole=True, noticeable=4, meaning="first such point"
    )
    last_point: int = parameter(
        "point", low=0, high=POINTS - 1, typical=519, whole=True, noticeable=4, meaning="last such point"
    )
    soft_edge_deg: float = parameter(
        "deg",
        low=0.0,
        high=90.0,
        typical=0.5,
        noticeable=0.1,
        meaning="width of the edge around the patch where the dirt fades out",
    )
    roundness: float = parameter(
        "", low=0.0, high=1.0, typical=0.0, noticeable=0.2, meaning="0: rectangle, 1: fully rounded ends"
    )
    background_power: float = parameter(
        "",
        low=0.0,
        high=1.0,
        typical=0.5,
        noticeable=0.2,
        meaning="power of the transmission that the background is scaled by",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_interval(self.name, ("first_layer", self.first_layer), ("last_layer", self.last_layer))
        check_interval(self.name, ("first_point", self.first_point), ("last_point", self.last_point))

    def light(self, light: Light, around: Surroundings) -> Light:
        """Dim the beams that look through the dirt."""
        if self.transmission == 1.0:
            return light
        factor = 1.0 - (1.0 - self.transmission) * self._cover(light)
        return light.dimmed(factor, background=elementary.power(factor, self.background_power))

    def _cover(self, light: Light) -> FloatArray:
        """How much of the dirt each beam meets, 0 ... 1, shape (n_beams,)."""
        up, up_half = _middle_and_half(elevation_deg([self.first_layer, self.last_layer]), _LAYER_DEG)
        side, side_half = _middle_and_half(azimuth_deg([self.first_point, self.last_point]), _POINT_DEG)
        radius = self.roundness * min(up_half, side_half)
        up_off = np.abs(elevation_deg(light.layer) - up) - up_half + radius
        side_off = np.abs(azimuth_deg(light.point) - side) - side_half + radius
        inside = np.minimum(np.maximum(up_off, side_off), 0.0)
        outside_deg = elementary.hypot(np.maximum(up_off, 0.0), np.maximum(side_off, 0.0)) + inside - radius
        if self.soft_edge_deg == 0.0:
            return np.asarray((outside_deg <= 0.0).astype(np.float64))
        return np.asarray(np.clip(1.0 - outside_deg / self.soft_edge_deg, 0.0, 1.0))


def _middle_and_half(ends_deg: FloatArray, pitch_deg: float) -> tuple[float, float]:
    """Centre and half the width of a stretch of beams, outer edges included [deg]."""
    first, last = float(ends_deg[0]), float(ends_deg[1])
    return 0.5 * (first + last), 0.5 * (last - first + pitch_deg)
