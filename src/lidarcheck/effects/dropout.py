"""Beams lose their echo at random."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.scan import Scan

__all__ = ["Dropout"]


@dataclass(frozen=True)
class Dropout(ReadoutEffect):
    """Beams lose their echo at random, whatever its strength.

    Each beam loses all its echoes with probability `share`, independently: packets lost on the way, or a readout that
    skips. Measured sensors keep more than 99.5 % of strong echoes. Identity at 0, nothing left at 1.
    """

    name = "dropout"

    share: float = parameter("", low=0.0, high=1.0, typical=0.02, meaning="probability that a beam loses its echoes")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Leave out the beams that are lost."""
        if self.share == 0.0:
            return scan
        return scan.take(around.uniforms(scan.layer, scan.point)[:, 0] >= self.share)
