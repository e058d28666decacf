"""When a sensor's beams are fired."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Sweep"]


@dataclass(frozen=True, slots=True)
class Sweep:
    """The order in which beams are fired, and how long a frame takes.

    `order`: column by column, layer by layer, as the beam table's times say, or all at once. `duration_s`: of a grid
    from the first column (or layer) to the last, of channels from column 0 to one past the last. `direction`: the sense
    of turning seen from above. `common_receiver`: beams that fire together share a receiver, so that light of one can
    reach another. `fire_time_in_azimuth`: a channel's azimuth moves on while the head turns until it fires.
    """

    order: Literal["columns", "layers", "table", "flash"] = "columns"
    duration_s: float = 0.1
    direction: Literal["left", "right"] = "left"
    common_receiver: bool = False
    fire_time_in_azimuth: bool = True
