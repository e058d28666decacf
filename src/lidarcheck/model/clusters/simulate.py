"""Echoes of sensors whose SPADs set off their neighbours and do nothing else: what `exact/kernel.py` is to others."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.clusters.group import simulate_group
from lidarcheck.model.clusters.law import (
    Law,
    Level,
    Space,
    can_count,
    law_of,
    level_of,
    new_space,
    well_counted,
)
from lidarcheck.model.clusters.sizes import tabulate
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, pulse_window
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.streams import Stream
from lidarcheck.model.way import Way
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["simulate_beams", "way"]


@kernel
def simulate_beams(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    space: Space,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams in `order`, independent of each other, into `echoes`; see `exact.kernel.simulate_beams`."""
    group, n = space.chain.group, len(order)
    level = Level(-1.0, 0.0)
    at: Any = np.int64(0)
    held: Any = np.int64(0)
    while True:
        alike = at < n and per_bin[np.uint64(order[at])] == level.per_bin
        if alike and held < LANES:
            beam: Any = np.uint64(order[at])
            at += 1
            begin, end = pulse_window(numbers, pulses, beam)
            group.beam[held], group.begin[held], group.length[held] = beam, begin, end - begin
            held += 1
        elif held > 0:
            simulate_group(numbers, law, level, stream, beams, pulses, held, space, echoes)
            held = 0
        elif at < n:
            level = level_of(numbers, per_bin[np.uint64(order[at])])
            tabulate(numbers, space.chain.blocks, law.sizes, level.per_bin, space.totals)
        else:
            return


def way(sensor: SpadArray, numbers: Numbers, light: Light) -> Way | None:
    """How SPADs whose only fault is crosstalk are simulated; None for others, and where beams do not fit."""
    if not can_count(sensor, numbers, light):
        return None
    return Way((law_of(sensor, numbers),), new_space, simulate_beams, well_counted)
