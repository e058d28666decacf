"""Some layers are more or less sensitive than others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.effects.base import LightEffect, Surroundings, list_parameter, parameter
from lidarcheck.effects.parameters import MOST_BEAMS
from lidarcheck.effects.shared.draws import check_interval
from lidarcheck.scan import Light
from lidarcheck.sensor import PhotonHistogram

__all__ = ["LayerGain"]


@dataclass(frozen=True)
class LayerGain(LightEffect):
    """Some layers are more or less sensitive than others.

    S' = gain S on every `every`-th layer of `first_layer` ... `last_layer`, beginning with the first: the photon
    detection efficiency, or the optics' share, of SPAD rows; gain 0 is dead ones. A block with `every` 1; a read-out
    that alternates between two halves of the chip with 2. Any other pattern with `gains`, a factor for each of those
    layers, times `gain`; where there are fewer than layers, they begin again. Background is light of the scene and
    scales alike. Of a histogram chip, zones stand for layers: zone (layer, point) has the number layer * points +
    point. What a channel of a linear detector lacks in gain, a higher threshold of it takes away as well: amplitudes
    tell the two apart, detections do not. Identity at gain 1 without gains.
    """

    name = "layer_gain"

    gain: float = parameter(
        "", low=0.0, high=10.0, typical=0.8, noticeable=0.08, meaning="factor on the light of those layers"
    )
    first_layer: int = parameter(
        "layer",
        low=0,
        high=MOST_BEAMS,
        typical=250,
        whole=True,
        noticeable=1,
        counts="line",
        meaning="first such layer",
    )
    last_layer: int = parameter(
        "layer",
        low=0,
        high=MOST_BEAMS,
        typical=269,
        whole=True,
        noticeable=1,
        counts="line",
        meaning="last such layer",
    )
    gains: tuple[float, ...] = list_parameter(
        "", low=0.0, high=10.0, noticeable=0.1, meaning="a factor for each such layer, from the first on"
    )
    every: int = parameter(
        "layers",
        low=1,
        high=MOST_BEAMS,
        typical=1,
        whole=True,
        noticeable=1,
        meaning="1: each layer between, 2: ...",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_interval(self.name, ("first_layer", self.first_layer), ("last_layer", self.last_layer))

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale the light of those layers."""
        if self.gain == 1.0 and not self.gains:
            return light
        zones = around.sensor.detector == PhotonHistogram.detector
        line = light.beams.index(light.layer, light.point) if zones else light.layer
        inside = (line >= self.first_layer) & (line <= self.last_layer)
        inside &= (line - self.first_layer) % self.every == 0
        own = np.asarray(self.gains or (1.0,))[(line - self.first_layer) // self.every % max(len(self.gains), 1)]
        factor = np.where(inside, self.gain * own, 1.0)
        return light.dimmed(factor, background=factor)
