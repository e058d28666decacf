"""What afterpulses a sensor has, as kernels see it, and the work space of those who wait for one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, ShortArray
from lidarcheck.jit import inlined
from lidarcheck.model.detectors.array import detectors_of
from lidarcheck.model.exact.abreast import MOST_BINS, MOST_DETECTORS
from lidarcheck.model.exact.background import SMALL
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, pulse_window
from lidarcheck.model.exact.single import Scratch, new_scratch
from lidarcheck.model.lane_draws import BATCH, ROWS, secondary, waiting_time
from lidarcheck.model.lane_math import LANES, fired, log1p, log_rest
from lidarcheck.model.streams import Stream
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = [
    "BEGIN",
    "END",
    "POINTS",
    "After",
    "Law",
    "Level",
    "Trails",
    "can_count",
    "due",
    "few_followed",
    "gap",
    "law_of",
    "level_of",
    "new_after",
    "record",
    "window_of",
]

BEGIN, END, POINTS = ((ROWS + k) * LANES for k in range(3))
"""Rows of `Trails.state`, behind those of its draws."""
_ROOM = 1 << 17
"""Most avalanches of a beam outside its window, so that memory stays bounded."""
_MANY = 5.0
"""Afterpulses of a beam above which a longer window pays."""
_MOST_FOLLOWED = 64.0
"""Detectors of a beam, set going by background, above which following all of them is the simpler way."""


class Law(NamedTuple):
    """`chance`: that an avalanche has an afterpulse; `per_log`: -1 / log(1 - chance). Times in bins: mean delays
    `delay` and, for the share `slow_share`, `slow_delay`; `warm_up`: before bin 0, as `Detectors` has it."""

    chance: float
    per_log: float
    delay: float
    slow_delay: float
    slow_share: float
    warm_up: int


class Level(NamedTuple):
    """A background: avalanches per armed SPAD and bin; those with an afterpulse to come (`dirty`), those without
    (`clean`); `dead_rate`: a detector of the pool is dead with probability 1 - exp(-dead_rate)."""

    per_bin: float
    dirty: float
    clean: float
    dead_rate: float


class Trails(NamedTuple):
    """What followed detectors read and leave behind, a lane for each beam of a group; few arrays, since a call hands
    over each of them.

    Flat, a row of `LANES` for each bin: `rates`, `counts` of the group (see `Abreast`); `back`, detectors of the pool
    that are armed again in each bin of the window and of a dead time behind it. `outside`, `room` numbers a lane: the
    bins before and behind the window in which followed detectors avalanche, in any order. `pending`: afterpulses to
    come of the detector that is followed. `draws`, `state`: see `lane_draws`; `state` has the window's begin and end,
    too, and how many stand in `outside`.
    """

    rates: FloatArray
    counts: ShortArray
    back: ShortArray
    room: int
    outside: npt.NDArray[np.int32]
    pending: IndexArray
    draws: FloatArray
    state: IndexArray


class After(NamedTuple):
    """Work space of a group of beams; `chain`: that of the exact chain, `trails`: that of followed detectors.

    `pool`, `later`, `left` (LANES,): detectors that are not followed before the window and behind it, and avalanches
    until the next one with an afterpulse. `held`: avalanches of followed detectors in each block of bins; `special`:
    blocks that have such, or that are not small.
    """

    chain: Scratch
    trails: Trails
    pool: IndexArray
    later: IndexArray
    left: FloatArray
    held: IndexArray
    special: IndexArray


def can_count(sensor: SpadArray, numbers: Numbers, light: Light) -> bool:
    """Whether detectors depend on nothing but their own afterpulses, and beams fit the lanes."""
    real = sensor.nonideal
    alone = max(real.crosstalk_sides, real.crosstalk_corners, real.dead_spread_ns, real.dead_recovery_ns) == 0.0
    fits = numbers.detectors <= MOST_DETECTORS and numbers.bins <= MOST_BINS and numbers.dead > 1
    fits = fits and _most_outside(numbers) <= _ROOM
    return real.afterpulse > 0.0 and alone and fits and light.haze is None


def law_of(sensor: SpadArray, numbers: Numbers) -> Law:
    """The sensor's afterpulses; `UsageError` names a number that is out of range."""
    real = detectors_of(sensor, numbers)
    chance = float(real.chance[8])
    per_log = -1.0 / float(elementary.log1p(-chance))
    return Law(chance, per_log, real.delay, real.slow_delay, real.slow_share, real.warm_up)


def new_after(numbers: Numbers, law: Law) -> After:
    """Work space for one group after another; everything that counts is zero before one and left so."""
    room = _most_outside(numbers)
    pool, later = np.zeros((2, LANES), dtype=np.int64)
    chain = new_scratch(numbers)
    chain.blocks.held[:] = SMALL
    trails = Trails(
        chain.group.rates,
        chain.group.counts,
        np.zeros((numbers.bins + numbers.dead + 1) * LANES, dtype=np.int16),
        room,
        np.zeros(room * LANES, dtype=np.int32),
        np.zeros((law.warm_up + numbers.bins) // numbers.dead + 3, dtype=np.int64),
        np.zeros(2 * BATCH * LANES),
        np.zeros((ROWS + 3) * LANES, dtype=np.int64),
    )
    held, special = np.zeros((2, 2 * len(chain.blocks.held)), dtype=np.int64)
    return After(chain, trails, pool, later, np.zeros(LANES), held, special)


def _most_outside(numbers: Numbers) -> int:
    """Avalanches of a beam, no more than which there can be."""
    return numbers.detectors * ((numbers.bins + numbers.pad) // numbers.dead + 2)


def few_followed(numbers: Numbers, law: Law, per_bin: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether background leaves so many detectors waiting for afterpulses, or fewer, that following these pays."""
    cells = numbers.detectors * (law.warm_up + numbers.bins)
    return np.asarray(law.chance * per_bin * cells <= _MOST_FOLLOWED)


@inlined
def level_of(numbers: Numbers, law: Law, per_bin: float) -> Level:
    """The level of a background: it strikes a cell with an afterpulse to come by `chance` times the probability."""
    dirty = -log_rest(law.chance * fired(per_bin))
    clean = max(per_bin - dirty, 0.0)
    return Level(per_bin, dirty, clean, log1p((numbers.dead - 1) * fired(clean)))


@inlined
def window_of(numbers: Numbers, law: Law, pulses: Pulses, beam: Any) -> Any:
    """The bins that the pool is counted in: the pulses' window, and behind bright ones most of their afterpulses."""
    begin, end = pulse_window(numbers, pulses, beam)
    signal = 0.0
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        signal += pulses.signal[j]
    if numbers.detectors * min(signal, 1.0) * law.chance > _MANY:
        end = min(end + numbers.dead + int(min(2.0 * law.delay, 2.0 * numbers.dead)), numbers.bins)
    return begin, end


@inlined
def due(numbers: Numbers, law: Law, stream: Stream, trails: Trails, lane: int, armed_from: int, waiting: Any) -> Any:
    """Give the avalanche that leaves a detector dead until `armed_from` an afterpulse; how many are waiting then."""
    mean = law.delay
    if law.slow_share > 0.0 and secondary(stream, trails, lane) < law.slow_share:
        mean = law.slow_delay
    delay = waiting_time(stream, trails, lane) * mean
    if delay < numbers.bins - armed_from:
        trails.pending[waiting] = armed_from + int(delay)
        waiting += 1
    return waiting


@inlined
def gap(law: Law, stream: Stream, trails: Trails, lane: int) -> float:
    """How many avalanches without an afterpulse come before the next one with."""
    return float(int(min(waiting_time(stream, trails, lane) * law.per_log, 1e9)))


@inlined
def record(numbers: Numbers, trails: Trails, lane: int, bin_: int) -> None:
    """Write down an avalanche of a followed detector."""
    state = trails.state
    begin, end = state[BEGIN + lane], state[END + lane]
    if bin_ > begin - numbers.dead and bin_ < end:
        trails.counts[(numbers.dead + bin_ - begin) * LANES + lane] += 1
    if (bin_ < begin or bin_ >= end) and bin_ >= -numbers.pad:
        trails.outside[lane * trails.room + state[POINTS + lane]] = bin_
        state[POINTS + lane] += 1
