"""What kernels of the fast path read: the grid that a frame's libraries share, the libraries, pulses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model.detector_echoes import fixed

__all__ = ["NO_PULSES", "Levels", "SeveralPulses", "Tables"]


class Tables(NamedTuple):
    """What the libraries of a frame have in common.

    `before`, `length` (blocks,): spans of blocks. `lowest`: the exponent of block 1. The bits say how many signal
    steps, phases and samples there are. Of beams with several pulses: `gap`, bins that must lie between two spans;
    `dark`, S that sets off no avalanche; `most_pulses`, more than which go through the exact chain.
    """

    before: IndexArray
    length: IndexArray
    lowest: int
    bins: int
    bins_per_m: float
    signal_bits: int
    phase_bits: int
    sample_bits: int
    gap: int
    dark: float
    most_pulses: int


class Levels(NamedTuple):
    """The libraries of a frame, one a level of background; or a `single` one.

    `words_at` (levels,): where the words of each begin in memory. `filled` (levels, blocks + 1): which blocks are
    there; the last column says whether the library is. `ready` (levels, 2): what keeps a beam of just that background,
    or of one between it and the next, from its libraries: nothing (0), or as in `draw.py` that there is none that fits
    (`EXACT`) or not yet (`TABLE`). `alarms` (levels, 3): the
    clumps of echoes a bin that background alone makes, as a polynomial of where a background stands between a level and
    the next. `first`: number of the first level; `lowest`: exponent of level 1; `bits`: levels between two powers of
    two.
    """

    words_at: IndexArray
    filled: npt.NDArray[np.bool_]
    ready: npt.NDArray[np.uint8]
    alarms: FloatArray
    first: int
    lowest: int
    bits: int
    single: bool


class SeveralPulses(NamedTuple):
    """The pulses of all beams, as in `Light`; none where no beam has several."""

    first: IndexArray
    range_m: FloatArray
    signal: FloatArray


NO_PULSES = SeveralPulses(fixed(np.zeros(1, dtype=np.int64)), fixed(np.empty(0)), fixed(np.empty(0)))
