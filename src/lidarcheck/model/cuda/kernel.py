"""The kernel of `cuda.py`, which says what it does; apart from it, since to import numba's GPU part takes time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import cuda

from lidarcheck.model.exact.blocks import Blocks
from lidarcheck.model.exact.long_alone import simulate_one
from lidarcheck.model.exact.single import Scratch
from lidarcheck.model.streams import Stream

__all__ = ["simulate_beams"]

_gpu: Any = cuda


@_gpu.jit  # type: ignore[untyped-decorator]
def simulate_beams(
    numbers: Any, key: Any, frame: Any, beams: Any, level: Any, pulses: Any, order: Any, threads: Any, counts: Any,
    rates: Any, draws: Any, held: Any, crowds: Any, cells: Any, inverse: Any, blocks: Any, group: Any, echoes: Any,
) -> None:  # fmt: skip
    """Simulate the beams in `order`, of one background: each of the threads takes every `threads`-th of them.

    `counts`, `rates`, `draws`, `held`, `crowds`, `cells`: work space, a column for each thread. numba turns the
    functions that this one calls into ones for the GPU.
    """
    t = _gpu.grid(1)
    if t >= threads:
        return
    counter = _gpu.local.array(4, np.uint64)
    counter[2] = frame
    counter[3] = 0
    own = Blocks(
        blocks.length, blocks.small, blocks.above, blocks.log_small, held[:, t], crowds[:, t], cells[:, t],
        blocks.pairs, blocks.rate, blocks.calm,
    )  # fmt: skip
    scratch = Scratch(counts[:, t], rates[:, t], draws[:, t], inverse, own, group)
    for k in range(t, len(order), threads):
        simulate_one(numbers, Stream(counter, key), beams, level, pulses, np.uint64(order[k]), scratch, echoes)
