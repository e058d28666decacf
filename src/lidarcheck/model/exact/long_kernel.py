"""Long beams: those in haze, and all where background crowds its blocks. Apart, since most frames have none."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.long_alone import long_end
from lidarcheck.model.exact.long_group import simulate_queue
from lidarcheck.model.exact.long_space import QUEUE, Lanes, new_lanes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.exact.single import BackgroundLevel, Scratch, level_of
from lidarcheck.model.streams import Stream

__all__ = ["new_lanes", "simulate_long_beams"]


@kernel
def simulate_long_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    scratch: Scratch,
    lanes: Lanes,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams in `order`, all of them long; see `kernel.simulate_beams`."""
    level = BackgroundLevel(-1.0, 0.0, 0.0)
    n = len(order)
    at: Any = np.int64(0)
    queued: Any = np.int64(0)
    while True:
        alike = at < n and per_bin[np.uint64(order[at])] == level.per_bin
        if alike and queued < QUEUE:
            beam: Any = np.uint64(order[at])
            at += 1
            lanes.queue[queued] = beam
            lanes.ends[queued] = long_end(numbers, scratch.blocks, level, pulses, beam)
            queued += 1
        elif queued > 0:
            simulate_queue(numbers, stream, beams, level, pulses, queued, scratch, lanes, echoes)
            queued = 0
        elif at < n:
            level = level_of(numbers, scratch.blocks, pulses, per_bin[np.uint64(order[at])])
        else:
            return
