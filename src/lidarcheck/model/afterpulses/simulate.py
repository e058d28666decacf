"""Echoes of sensors whose SPADs have afterpulses and nothing else: what `exact/kernel.py` is to those without."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.afterpulses.group import simulate_group
from lidarcheck.model.afterpulses.law import (
    After,
    Law,
    Level,
    can_count,
    few_followed,
    law_of,
    level_of,
    new_after,
    window_of,
)
from lidarcheck.model.exact.blocks import tabulate
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.streams import Stream
from lidarcheck.model.way import Way
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["simulate_beams", "way"]


_MOST_PAIRS = 2.0
"""Expected crowded neighbours of a beam above which to visit all bins is the faster way."""


@kernel
def simulate_beams(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    after: After,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams in `order`, independent of each other, into `echoes`; see `exact.kernel.simulate_beams`."""
    group, blocks, n = after.chain.group, after.chain.blocks, len(order)
    level = Level(-1.0, 0.0, 0.0, 0.0)
    at: Any = np.int64(0)
    held: Any = np.int64(0)
    while True:
        alike = at < n and per_bin[np.uint64(order[at])] == level.per_bin
        if alike and held < LANES:
            beam: Any = np.uint64(order[at])
            at += 1
            begin, end = window_of(numbers, law, pulses, beam)
            if blocks.pairs[0] > _MOST_PAIRS:
                begin, end = 0, numbers.bins
            group.beam[held], group.begin[held], group.length[held] = beam, begin, end - begin
            held += 1
        elif held > 0:
            simulate_group(numbers, law, level, stream, beams, pulses, held, after, echoes)
            held = 0
        elif at < n:
            level = level_of(numbers, law, per_bin[np.uint64(order[at])])
            tabulate(blocks, numbers.detectors, numbers.threshold, level.clean)
        else:
            return


def way(sensor: SpadArray, numbers: Numbers, light: Light) -> Way | None:
    """How SPADs whose only fault is afterpulses are simulated; None for others, and where beams do not fit."""
    if not can_count(sensor, numbers, light):
        return None
    return Way((law_of(sensor, numbers),), new_after, simulate_beams, few_followed)
