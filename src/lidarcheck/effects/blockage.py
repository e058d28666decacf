"""Part of the field of view is dimmed or dark: dirt on the window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.parameters import MOST_BEAMS
from lidarcheck.effects.shared.draws import check_interval
from lidarcheck.scan import Light
from lidarcheck.sensor import Beams, PhotonHistogram, Sensor
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["Blockage"]


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

    Of a histogram chip it also raises the light of the cover glass, by as much as that sends back where T is 0, less
    where T is more. Valid for dirt that dims; it scatters no light into other beams. Identity at transmission 1.
    """

    name = "blockage"

    transmission: float = parameter(
        "", low=0.0, high=1.0, typical=0.3, noticeable=0.03, meaning="factor on the signal inside the patch"
    )
    first_layer: int = parameter(
        "layer",
        low=0,
        high=MOST_BEAMS,
        typical=220,
        whole=True,
        noticeable=10,
        counts="layer",
        meaning="lowest such layer",
    )
    last_layer: int = parameter(
        "layer",
        low=0,
        high=MOST_BEAMS,
        typical=299,
        whole=True,
        noticeable=10,
        counts="layer",
        meaning="highest such layer",
    )
    first_point: int = parameter(
        "point",
        low=0,
        high=MOST_BEAMS,
        typical=440,
        whole=True,
        noticeable=4,
        counts="point",
        meaning="first such point",
    )
    last_point: int = parameter(
        "point",
        low=0,
        high=MOST_BEAMS,
        typical=519,
        whole=True,
        noticeable=4,
        counts="point",
        meaning="last such point",
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
        cover = self._cover(light)
        factor = 1.0 - (1.0 - self.transmission) * cover
        dimmed = light.dimmed(factor, background=elementary.power(factor, self.background_power))
        return _glaring(dimmed, around.sensor, 1.0 - factor)

    def _cover(self, light: Light) -> FloatArray:
        """How much of the dirt each beam meets, 0 ... 1, shape (n_beams,)."""
        up, side = self._patch(light.beams)
        radius = self.roundness * min(up.half_deg, side.half_deg)
        elevation, azimuth = light.beams.angles_deg(light.layer, light.point)
        up_off = np.abs(elevation - up.middle_deg) - up.half_deg + radius
        azimuth = azimuth + 360.0 * np.rint((side.middle_deg - azimuth) / 360.0)
        side_off = np.abs(azimuth - side.middle_deg) - side.half_deg + radius
        inside = np.minimum(np.maximum(up_off, side_off), 0.0)
        outside_deg = elementary.hypot(np.maximum(up_off, 0.0), np.maximum(side_off, 0.0)) + inside - radius
        if self.soft_edge_deg == 0.0:
            return np.asarray((outside_deg <= 0.0).astype(np.float64))
        return np.asarray(np.clip(1.0 - outside_deg / self.soft_edge_deg, 0.0, 1.0))

    def _patch(self, beams: Beams) -> tuple[_Stretch, _Stretch]:
        """The patch in elevation and in azimuth: all that its layers and points look at."""
        layers = np.arange(self.first_layer, self.last_layer + 1)
        ends = np.array([self.first_point, self.last_point])
        if beams.grid:
            (elevation, azimuth), pitch = beams.angles_deg(layers, ends), beams.spacing_deg(layers[0], ends)
            return _stretch(elevation, np.broadcast_to(pitch[0][0], len(layers))), _stretch(azimuth, pitch[1])
        if isinstance(beams, ChannelBeams):
            # Channels that look aside of their column move no dirt.
            up_deg, aside_deg = beams.spacing_deg(layers, ends[0])
            side = _stretch(beams.column_azimuth_deg(ends), np.broadcast_to(aside_deg[0], 2))
            return _stretch(beams.angles_deg(layers, ends[0])[0], up_deg), side
        layer, point = beams.every()
        inside = (layer >= layers[0]) & (layer <= layers[-1]) & (point >= ends[0]) & (point <= ends[1])
        layer, point = layer[inside], point[inside]
        (elevation, azimuth), (up_deg, aside_deg) = beams.angles_deg(layer, point), beams.spacing_deg(layer, point)
        azimuth = azimuth + 360.0 * np.rint((azimuth[:1] - azimuth) / 360.0)
        return _stretch(elevation, up_deg), _stretch(azimuth, aside_deg)


class _Stretch(NamedTuple):
    """Centre and half the width of a stretch of beams, outer edges included."""

    middle_deg: float
    half_deg: float


def _stretch(angle_deg: FloatArray, pitch_deg: FloatArray) -> _Stretch:
    """The stretch that beams with these angles and distances to their neighbours take; without a beam one that every
    direction lies a turn away from."""
    if len(angle_deg) == 0:
        return _Stretch(0.0, -360.0)
    first, last = int(np.argmin(angle_deg)), int(np.argmax(angle_deg))
    low, high, pitch = angle_deg[first], angle_deg[last], 0.5 * (pitch_deg[first] + pitch_deg[last])
    return _Stretch(float(0.5 * (low + high)), float(0.5 * (high - low + pitch)))


def _glaring(light: Light, sensor: Sensor, taken: FloatArray) -> Light:
    """What dirt takes from a histogram chip's light it sends back in part: as bright as the cover glass where it takes
    all; `taken` (n_beams,)."""
    if not isinstance(sensor, PhotonHistogram) or sensor.cover_glass == 0.0:
        return light
    dirty = np.flatnonzero(taken > 0.0)
    return light.with_pulses(dirty, np.zeros(len(dirty)), sensor.cover_glass * taken[dirty])
