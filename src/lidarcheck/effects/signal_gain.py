"""The whole signal is scaled."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.scan import Light

__all__ = ["SignalGain"]


@dataclass(frozen=True)
class SignalGain(LightEffect):
    """The whole signal is scaled: laser power, optics, an evenly dirty window.

    S' = gain S for all light of the laser; background is unchanged. The range equation is linear in the emitted energy
    and in the transmission of the optics, so one factor stands for all of them. Identity at gain 1.
    """

    name = "signal_gain"
    role = "gain"

    gain: float = parameter(
        "", low=0.0, high=100.0, typical=0.9, noticeable=0.09, meaning="factor on the signal of every pulse"
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale every pulse."""
        return light if self.gain == 1.0 else light.dimmed(self.gain)
