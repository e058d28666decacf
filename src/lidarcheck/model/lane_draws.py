"""Draws of what follows from avalanches: the second stream of each beam of a group, a few draws at a time.

Whoever draws brings a work space with `draws` (2 * `BATCH` * LANES,): `BATCH` draws a lane, and behind all of them the
exponential numbers that they make; and `state`, rows of `LANES` whole numbers, of which the first `ROWS` are used here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import LANES, log
from lidarcheck.model.streams import Stream, philox, unit

__all__ = ["BATCH", "ROWS", "begin_draws", "secondary", "waiting_time"]

BATCH = 16
"""Draws of a beam that are made at a time."""
ROWS = 3
"""Rows of `state` that tell where each lane's stream stands."""
_AT, _BLOCK, _KEY = (k * LANES for k in range(ROWS))
_BRANCH = np.uint64(1)
_WAITS = np.uint64(BATCH * LANES)
_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)


@inlined
def begin_draws(space: Any, lane: int, key: Any) -> None:
    """Go to the first draw of a beam, which streams know by its `key`."""
    space.state[_AT + lane], space.state[_BLOCK + lane] = BATCH, 0
    space.state[_KEY + lane] = np.int64(key)


@kernel
def _refill(key: WordArray, frame: Any, beam: int, block: int, lane: int, draws: FloatArray) -> None:
    """The next draws, and their logarithms all at once: several of them cost little more than one."""
    at = np.uint64(lane * BATCH)
    for k in range(np.uint64(BATCH // 4)):
        first, second, third, fourth = philox(key[0], key[1], np.uint64(block) + k, np.uint64(beam), frame, _BRANCH)
        row = at + k * _FOUR
        draws[row], draws[row + _ONE] = unit(first), unit(second)
        draws[row + _TWO], draws[row + _THREE] = unit(third), unit(fourth)
    for k in range(np.uint64(BATCH)):
        draws[at + k + _WAITS] = -log(1.0 - draws[at + k])


@inlined
def _taken(stream: Stream, space: Any, lane: int) -> int:
    """Where a lane's next draw stands."""
    state = space.state
    at = state[_AT + lane]
    if at == BATCH:
        block = state[_BLOCK + lane]
        _refill(stream.key, stream.counter[2], state[_KEY + lane], block, lane, space.draws)
        state[_BLOCK + lane] = block + BATCH // 4
        at = 0
    state[_AT + lane] = at + 1
    return BATCH * int(lane) + int(at)


@inlined
def secondary(stream: Stream, space: Any, lane: int) -> float:
    """The next draw of a lane's beam for what follows from avalanches."""
    return float(space.draws[_taken(stream, space, lane)])


@inlined
def waiting_time(stream: Stream, space: Any, lane: int) -> float:
    """The next draw as an exponential number of mean 1."""
    return float(space.draws[np.uint64(_taken(stream, space, lane)) + _WAITS])
