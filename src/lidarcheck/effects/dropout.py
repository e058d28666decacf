"""Beams lose their echo at random."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter, unfit_for
from lidarcheck.scan import Scan

__all__ = ["Dropout"]


@dataclass(frozen=True)
class Dropout(ReadoutEffect):
    """Beams lose their echo at random, whatever its strength.

    Blocks of `block_points` point columns by `block_layers` layers lose all their echoes with probability `share`,
    independently: single beams that a readout skips, with blocks of one, or packets lost on the way. Measured sensors
    keep more than 99.5 % of strong echoes. Identity at 0, nothing left at 1.
    """

    name = "dropout"
    moves_echoes = False
    unfit = unfit_for(photon_histogram="a zone always has a histogram")

    share: float = parameter(
        "", low=0.0, high=1.0, typical=0.02, noticeable=0.005, meaning="probability that a beam loses its echoes"
    )
    block_points: int = parameter(
        "", low=1, high=1000, typical=1, whole=True, noticeable=1, meaning="point columns of a block", option=True
    )
    block_layers: int = parameter(
        "", low=1, high=1000, typical=1, whole=True, noticeable=1, meaning="layers of a block", option=True
    )

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Leave out the beams that are lost."""
        if self.share == 0.0:
            return scan
        block = scan.layer // self.block_layers, scan.point // self.block_points
        return scan.take(around.uniforms(*block)[:, 0] >= self.share)
