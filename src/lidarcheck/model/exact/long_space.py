"""Work space of long beams side by side: those in haze or under a glaring sky, which visit many bins.

Arrays are flat, a row of `WIDE` numbers for each bin. No loop reads a trace and writes it: the compiler could not tell
that the rows differ, and would go from number to number. So what a bin adds to the trace waits in `state`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.model.exact.abreast import MOST_BINS, RESERVE
from lidarcheck.model.exact.binomial import inverses
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.short_draws import BINS, WIDE

__all__ = ["ABOVE", "ARMED", "FIRED", "LANE", "ON", "QUEUE", "Lanes", "SingleArray", "new_lanes"]

QUEUE = 4096
"""Beams that are sorted by where they end, so that those side by side end together."""
SingleArray = npt.NDArray[np.float32]
LANE: Any = np.uint64(WIDE)
ARMED, FIRED, ON, ABOVE = (np.uint64(k * WIDE) for k in range(4))
"""Rows of `state`: detectors that are armed, that avalanche in this bin, that are ON, and ON above the threshold."""


class Lanes(NamedTuple):
    """Work space.

    A row for each bin: `rates`, avalanches per armed SPAD; `counts`, avalanches from `dead` bins before bin 0 on.
    `state`: what is known of each lane; `sums`, `single_sums`: of counts, `echoes`: of echoes. `reserve`: draws set
    aside first; `short`: draws of 16 bits for 16 bins; `words`: work space of draws; `inverse`: 1 / k. Shape (WIDE,):
    each lane's `beam`, the `length` of its window [bins], the detectors `dead` on entry, the `key` that streams know
    the beam by, and the `block` of draws where its stream stands. `queue`: beams that wait, `ends`: where their windows
    end, `order`: their places in order of that, `heads`: work space.
    """

    rates: SingleArray
    counts: SingleArray
    state: SingleArray
    sums: FloatArray
    single_sums: SingleArray
    echoes: FloatArray
    inverse: SingleArray
    reserve: FloatArray
    short: npt.NDArray[np.uint16]
    words: WordArray
    beam: IndexArray
    length: IndexArray
    dead: IndexArray
    key: WordArray
    block: WordArray
    queue: IndexArray
    ends: IndexArray
    order: IndexArray
    heads: IndexArray


def new_lanes(numbers: Numbers) -> Lanes:
    """Work space for one group after another; `counts` is zero before bin 0 and must be left so."""
    bins = min(numbers.bins, MOST_BINS)
    beam, length, dead = np.zeros((3, WIDE), dtype=np.int64)
    key, block = np.zeros((2, WIDE), dtype=np.uint64)
    queue, ends, order = np.zeros((3, QUEUE), dtype=np.int64)
    return Lanes(
        np.zeros(bins * WIDE, dtype=np.float32),
        np.zeros((numbers.dead + bins) * WIDE, dtype=np.float32),
        np.zeros(4 * WIDE, dtype=np.float32),
        np.zeros(6 * WIDE),
        np.zeros(6 * WIDE, dtype=np.float32),
        np.zeros(5 * WIDE),
        inverses(numbers.detectors).astype(np.float32),
        np.zeros(RESERVE * WIDE),
        np.zeros(BINS * WIDE, dtype=np.uint16),
        np.zeros(4 * WIDE, dtype=np.uint64),
        beam,
        length,
        dead,
        key,
        block,
        queue,
        ends,
        order,
        np.zeros(numbers.bins + 2, dtype=np.int64),
    )
