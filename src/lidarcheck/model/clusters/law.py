"""What avalanches of a sensor set off beside them, as kernels see it, and the work space of a group of beams."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, ShortArray
from lidarcheck.jit import inlined
from lidarcheck.model.clusters.sizes import most_rate, sizes_of
from lidarcheck.model.detectors.array import detectors_of
from lidarcheck.model.exact.abreast import MOST_BINS, MOST_DETECTORS
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.single import Scratch, new_scratch
from lidarcheck.model.lane_draws import BATCH, ROWS
from lidarcheck.model.lane_math import LANES, fired
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = [
    "ARMED_ALL",
    "ARMED_KNOWN",
    "FIRST",
    "KNOWN",
    "NEAR",
    "ROOM",
    "SPLIT",
    "UNKNOWN",
    "Law",
    "Level",
    "Places",
    "Space",
    "can_count",
    "law_of",
    "level_of",
    "new_space",
    "well_counted",
]

KNOWN, SPLIT, ARMED_ALL, ARMED_KNOWN, FIRST, NEAR = ((ROWS + k) * LANES for k in range(6))
"""Rows of `Places.state`, behind those of its draws."""
UNKNOWN = -(1 << 30)
"""A detector whose place in the array is not known of any avalanche: it may be armed or dead, as the counts have it."""
ROOM = 1024
"""Avalanches just before a window that are written down; half as many strikes are, far more than there can be."""


class Law(NamedTuple):
    """What an avalanche may set off, in eight directions: see `Detectors`, of which `chance` (8,), `quiet` (9,) and
    `neighbour` are. `per_log`: -1 / log(quiet[0]). `sizes[n]`: probability that a cluster without limits has n
    avalanches. `most_per_bin`: the highest background that is counted.
    """

    chance: FloatArray
    quiet: FloatArray
    neighbour: npt.NDArray[np.int32]
    per_log: float
    sizes: FloatArray
    most_per_bin: float


class Level(NamedTuple):
    """A background: avalanches per armed SPAD and bin; the probability that it strikes within `dead - 1` bins."""

    per_bin: float
    some: float


class Places(NamedTuple):
    """What is known of places, a lane for each beam of a group, and one more for what lies far before the windows.

    `counts`: that of the group (see `Abreast`); `own`, as long: the avalanches among them whose detectors are known.
    `armed_from`, `known`, `detectors` numbers a lane: from which bin of the window on each detector is armed, or
    `UNKNOWN`; the list of those that are known. `near`, `ROOM` numbers a lane: bins of the avalanches just before the
    window. `left` (LANES,): avalanches that set off nothing before the next that tries to. `fired`, `joined`: detectors
    that avalanche in the bin that is looked at, by themselves and set off. `earliest`, `strikes`: where background
    strikes before a bin, and in blocks; `tree`: tries of a cluster's avalanches, and behind them their places.
    `draws`, `state`: see `lane_draws`; `state` has the detectors that are known, the first bin of the window whose
    avalanches are not split among them and the others yet, those armed and those armed and known in that bin (before
    any is armed again), the bin before which all are armed, and how many stand in `near`.
    """

    counts: ShortArray
    own: ShortArray
    armed_from: npt.NDArray[np.int32]
    known: npt.NDArray[np.int32]
    near: npt.NDArray[np.int32]
    left: FloatArray
    fired: IndexArray
    joined: IndexArray
    earliest: IndexArray
    strikes: IndexArray
    tree: IndexArray
    inverse: FloatArray
    draws: FloatArray
    state: IndexArray


class Space(NamedTuple):
    """Work space of a group of beams; `chain`: that of the exact chain; `totals[n]`: probability that background's
    strikes of a block, and all that they may set off, are n avalanches."""

    chain: Scratch
    places: Places
    totals: FloatArray


def can_count(sensor: SpadArray, numbers: Numbers, light: Light) -> bool:
    """Whether detectors do nothing but set off their neighbours, and beams fit the lanes."""
    real = sensor.nonideal
    alone = max(real.afterpulse, real.dead_spread_ns, real.dead_recovery_ns) == 0.0
    fits = numbers.detectors <= MOST_DETECTORS and numbers.bins <= MOST_BINS and numbers.dead >= max(numbers.on, 2)
    return max(real.crosstalk_sides, real.crosstalk_corners) > 0.0 and alone and fits and light.haze is None


def law_of(sensor: SpadArray, numbers: Numbers) -> Law:
    """What the sensor's avalanches set off; `UsageError` names a number that is out of range."""
    real = detectors_of(sensor, numbers)
    chance, quiet = real.chance[:8], real.quiet[:9]
    per_log = -1.0 / float(elementary.log1p(quiet[0] - 1.0)) if quiet[0] > 0.0 else 0.0
    sides, corners = float(chance[0]), float(chance[4])
    most = most_rate(numbers, sides, corners)
    return Law(chance, quiet, real.neighbour, per_log, sizes_of(sides, corners), most)


def new_space(numbers: Numbers, law: Law) -> Space:
    """Work space for one group after another; counts are zero and detectors unknown before one, and left so."""
    chain, lanes = new_scratch(numbers), LANES + 1
    places = Places(
        chain.group.counts,
        np.zeros_like(chain.group.counts),
        np.full(lanes * numbers.detectors, UNKNOWN, dtype=np.int32),
        np.zeros(lanes * numbers.detectors, dtype=np.int32),
        np.zeros(lanes * ROOM, dtype=np.int32),
        np.zeros(LANES),
        np.zeros(numbers.detectors + 1, dtype=np.int64),
        np.zeros(numbers.detectors + 1, dtype=np.int64),
        np.zeros(ROOM // 2, dtype=np.int64),
        np.zeros(ROOM // 2, dtype=np.int64),
        np.zeros(2 * len(law.sizes), dtype=np.int64),
        chain.inverse,
        np.zeros(2 * BATCH * LANES),
        np.zeros((ROWS + 6) * LANES, dtype=np.int64),
    )
    return Space(chain, places, np.zeros(len(law.sizes)))


def well_counted(numbers: Numbers, law: Law, per_bin: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether backgrounds are so low that counting pays."""
    return np.asarray(per_bin <= law.most_per_bin)


@inlined
def level_of(numbers: Numbers, per_bin: float) -> Level:
    """The level of a background."""
    return Level(per_bin, fired(numbers.detectors * per_bin * (numbers.dead - 1)))
