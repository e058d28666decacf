"""What avalanches set off beside them and later, counted: a detector that is asked for is armed as often as any.

The exact chain must know which detectors avalanche, and beams in haze ask for hundreds of them. Here each avalanche
tries what it would try there, a neighbour or an afterpulse, as often and at the same times. But whether a neighbour is
there and armed is drawn from how many are, as if they lay anywhere, and so is whether an afterpulse finds its detector
armed once that may have been dead again. docs/performance.md says by how much that is off.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, ShortArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.detectors.array import detectors_of
from lidarcheck.model.exact.abreast import ARMED, COUNT, RESERVE, Abreast, draw_counts
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_draws import BATCH, ROWS, begin_draws, secondary, waiting_time
from lidarcheck.model.lane_math import LANES, exp, log
from lidarcheck.model.rows import add_row, clear_row, fire_row, lowest, spend_row
from lidarcheck.model.streams import Stream
from lidarcheck.sensor import SpadArray

__all__ = ["After", "Law", "can_count", "law_of", "new_after", "run_setting_off", "start_lane", "tail_of", "wait_for"]

_LANES: Any = np.uint64(LANES)
_FIRST, _ONE = np.uint64(0), np.uint64(1)
_MOST_CHILDREN, _MOST_LATER = 0.12, 0.1
"""Neighbours and afterpulses of an avalanche, on average, up to which detectors may be taken to lie anywhere."""
_LATE = 256
"""What an afterpulse counts whose detector may have been dead again: both kinds are in one number."""
_LOST = 0.2
"""Afterpulses of a beam's pulses that may come behind its window, on average."""


class Law(NamedTuple):
    """What an avalanche may set off: `chance` (9,), `quiet` (10,), `delay`, `slow_delay` [bins] and `slow_share` as in
    `Detectors`; `any_`: whether there is anything. `per_log`: -1 / log(quiet[0]). `near`: the part of the tries that
    meet a neighbour at all; `nearer`: the same of avalanches that were set off, whose own parent is dead. `warm_up`
    [bins]: after which the state before is forgotten.
    """

    any_: bool
    chance: FloatArray
    quiet: FloatArray
    per_log: float
    near: float
    nearer: float
    delay: float
    slow_delay: float
    slow_share: float
    warm_up: int


class After(NamedTuple):
    """Work space of a group of beams; flat, a row of `LANES` for each bin of a window.

    `due`: afterpulses that come in a bin, `_LATE` for each that needs its detector armed again; `late` (bins,): the
    lanes that have any. `left`: avalanches of a lane that set off nothing before the next that tries to. `trail`
    (LANES, 1 + 2 * room): how many afterpulses an avalanche of a history has set off, and of each the bin of the
    avalanche and twice its own, and one more where its detector may be dead; none where there is no room.
    """

    due: ShortArray
    late: WordArray
    left: FloatArray
    trail: npt.NDArray[np.int32]
    draws: FloatArray
    state: IndexArray


def can_count(sensor: SpadArray) -> bool:
    """Whether what avalanches set off may be counted: nothing else varies, and it is not much."""
    real = sensor.nonideal
    fixed_dead_time = max(real.dead_spread_ns, real.dead_recovery_ns) == 0.0
    few = real.crosstalk_sides + real.crosstalk_corners <= _MOST_CHILDREN and real.afterpulse <= _MOST_LATER
    return fixed_dead_time and few


@functools.lru_cache(maxsize=16)
def law_of(sensor: SpadArray, numbers: Numbers) -> Law:
    """What the sensor's avalanches set off."""
    real = detectors_of(sensor, numbers)
    tries = float(real.chance[:8].sum())
    quiet = float(real.quiet[0])
    near = nearer = 0.0
    if tries > 0.0:
        chance = np.zeros((numbers.detectors, numbers.detectors))
        of, side = np.nonzero(real.neighbour >= 0)
        chance[of, real.neighbour[of, side]] = real.chance[side]
        twice = chance @ chance
        # A neighbour's neighbour that is the avalanche itself, or that the avalanche has set off, is dead.
        grandchildren = twice.sum() - np.trace(twice) - (twice * chance).sum()
        near = float(chance.sum()) / numbers.detectors / tries
        nearer = float(grandchildren / chance.sum()) / tries if near > 0.0 else 0.0
    per_log = -1.0 / float(elementary.log1p(quiet - 1.0)) if quiet < 1.0 else 0.0
    delays = (real.delay, real.slow_delay, real.slow_share)
    return Law(quiet < 1.0, real.chance, real.quiet, per_log, near, nearer, *delays, real.warm_up)


def new_after(bins: int, room: int) -> After:
    """Work space for windows of so many bins; `room`: afterpulses of a history that are written down."""
    return After(
        np.zeros((bins + 1) * LANES, dtype=np.int16),
        np.zeros(bins + 1, dtype=np.uint64),
        np.zeros(LANES),
        np.zeros((LANES, 1 + 2 * room), dtype=np.int32),
        np.zeros(2 * BATCH * LANES),
        np.zeros(ROWS * LANES, dtype=np.int64),
    )


@inlined
def _gap(law: Law, stream: Stream, after: After, lane: Any) -> float:
    """How many avalanches that set off nothing come before the next one that tries to."""
    return float(int(min(waiting_time(stream, after, lane) * law.per_log, 1e9)))


@inlined
def start_lane(law: Law, stream: Stream, after: After, lane: Any, key: Any) -> None:
    """Begin with a beam or history, which streams know by its `key`."""
    begin_draws(after, lane, key)
    after.left[lane] = _gap(law, stream, after, lane)
    after.trail[lane, 0] = 0


@inlined
def wait_for(after: After, lane: Any, bin_: Any, late: Any) -> None:
    """Let an afterpulse come in a bin of the window; `late`: whether its detector may be dead then."""
    after.due[np.uint64(bin_) * _LANES + np.uint64(lane)] += _LATE if late else 1
    after.late[bin_] |= _ONE << np.uint64(lane)


@kernel
def tail_of(law: Law, numbers: Numbers, avalanches: float) -> int:
    """Bins behind so many avalanches in which most of their afterpulses come."""
    pulses = min(avalanches, float(numbers.detectors)) * law.chance[8]
    fast, slow = pulses * (1.0 - law.slow_share), pulses * law.slow_share
    longest = law.delay * log(fast / _LOST) if fast > _LOST else 0.0
    longest = max(longest, law.slow_delay * log(slow / _LOST)) if slow > _LOST else longest
    return numbers.dead + int(longest) + 1 if longest > 0.0 else 0


@kernel
def _trail(numbers: Numbers, law: Law, stream: Stream, group: Abreast, after: After, lane: Any, k: int) -> None:
    """Give an avalanche of bin `k` an afterpulse."""
    slow = law.slow_share > 0.0 and secondary(stream, after, lane) < law.slow_share
    delay = waiting_time(stream, after, lane) * (law.slow_delay if slow else law.delay)
    armed_from, length = k + numbers.dead, group.length[lane]
    if delay < length - armed_from:
        due, late, rate = armed_from + int(delay), delay >= numbers.dead, 0.0
        if not late:
            for j in range(armed_from, due):
                rate += group.rates[j * LANES + lane]
        if late or secondary(stream, after, lane) < exp(-min(rate, 600.0)):
            wait_for(after, lane, due, late)
            held = after.trail[lane, 0]
            if 2 * held + 2 < after.trail.shape[1]:
                after.trail[lane, 2 * held + 1], after.trail[lane, 2 * held + 2] = k, 2 * due + (1 if late else 0)
                after.trail[lane, 0] = held + 1


@kernel
def _set_off(numbers: Numbers, law: Law, stream: Stream, group: Abreast, after: After, mask: Any, k: Any) -> None:
    """What avalanches of bin `k` set off in the lanes of a mask, in which one tries to."""
    state, others = group.state, 1.0 / max(numbers.detectors - 1, 1)
    while mask != 0:
        lane = lowest(mask)
        mask &= mask - _ONE
        armed: Any = np.int64(state[ARMED + lane])
        fired: Any = np.int64(state[COUNT + lane])
        own = fired
        while after.left[lane] < 0.0:
            # Those that were set off are the last ones.
            child = -after.left[lane] - 1.0 < fired - own
            share = (law.nearer if child else law.near) * others
            first, draw = 0, law.quiet[0] + (1.0 - law.quiet[0]) * secondary(stream, after, lane)
            while first < 9 and draw >= law.quiet[first]:
                survival, event = 1.0, first
                while event < 8:
                    survival *= 1.0 - law.chance[event]
                    if survival <= draw:
                        break
                    event += 1
                if event == 8:
                    _trail(numbers, law, stream, group, after, lane, k)
                elif secondary(stream, after, lane) < share * (armed - fired):
                    fired += 1
                    after.left[lane] -= 1.0
                first = event + 1
                draw = secondary(stream, after, lane)
            after.left[lane] += 1.0 + _gap(law, stream, after, lane)
        state[COUNT + lane] = fired


@kernel
def _come(numbers: Numbers, stream: Stream, group: Abreast, after: After, k: Any) -> None:
    """Let the afterpulses of bin `k` come where their detectors are armed."""
    state, mask = group.state, after.late[k]
    after.late[k] = np.uint64(0)
    while mask != 0:
        lane = lowest(mask)
        mask &= mask - _ONE
        armed: Any = np.int64(state[ARMED + lane])
        fired: Any = np.int64(state[COUNT + lane])
        at = np.uint64(k) * _LANES + lane
        due = np.int64(after.due[at])
        after.due[at] = 0
        for number in range(due % _LATE + due // _LATE):
            of = armed if number < due % _LATE else numbers.detectors
            if secondary(stream, after, lane) * of < armed - fired:
                fired += 1
        state[COUNT + lane] = fired


@kernel
def run_setting_off(
    numbers: Numbers, law: Law, stream: Stream, group: Abreast, after: After, bins: int, inverse: FloatArray
) -> None:
    """`run_abreast` where avalanches set off others; lanes have been started, nothing waits behind their windows."""
    counts, state = group.counts, group.state
    for lane in range(_LANES):
        state[ARMED + lane] = numbers.detectors - group.dead[lane]
    window, first_draw = np.uint64(numbers.dead) * _LANES, np.uint64(RESERVE * LANES)
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        add_row(state, ARMED, counts, bin_)
        some = draw_counts(group, bin_, first_draw + bin_, inverse, numbers.detectors)
        if not some:
            clear_row(state, COUNT)
        if after.late[k] != 0:
            _come(numbers, stream, group, after, np.int64(k))
            some = True
        if some:
            trying = spend_row(after.left, _FIRST, state, COUNT)
            if trying != 0:
                _set_off(numbers, law, stream, group, after, trying, np.int64(k))
            fire_row(state, ARMED, state, COUNT, counts, window + bin_)
        else:
            clear_row(counts, window + bin_)
