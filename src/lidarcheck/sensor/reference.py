"""The built-in sensors' grid: what a table's beams are where nobody says otherwise."""

from __future__ import annotations

import functools
from typing import Literal

from lidarcheck.sensor.grid import GridBeams

__all__ = ["VARIANTS", "reference_beams"]

VARIANTS: tuple[Literal["SMART"], Literal["SLIM"]] = ("SMART", "SLIM")


@functools.cache
def reference_beams() -> GridBeams:
    """The beams of SMART and of SLIM."""
    from lidarcheck.sensor.document import shipped

    beams = shipped(VARIANTS[0]).beams
    assert isinstance(beams, GridBeams)
    return beams
