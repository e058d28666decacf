"""Echoes that background alone makes away from the pulse, where they are rare: how often, and what they look like.

Detectors are independent renewal processes in their steady state, so the law of the numbers that are ON in a bin and in
the one before is multinomial, and the rate at which runs above the threshold begin is a sum. A typical beginning is
drawn from that law; forwards and backwards from it the chain runs on, which is the same process both ways. Runs come
in clumps, since a count just below the threshold may rise again: what is met at each of its n runs is kept with 1 / n.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model import streams
from lidarcheck.model.exact.echoes import find_echoes, new_echoes
from lidarcheck.model.exact.numbers import Numbers

__all__ = ["Alarms", "alarm_rate", "alarms_of"]

_SEED = 0
_CLUMPS = 4096
_DEAD_TIMES = 4
"""Bins that are followed on either side of a beginning, in dead times."""
_JUMPS = 13
"""Avalanches in the bin of a beginning beyond what it takes; more do not happen where alarms are rare."""
_ROOM = 16


class Alarms(NamedTuple):
    """Clumps of echoes: `rate` of clumps a bin; clump i has the echoes `first[i]` ... `first[i + 1] - 1`, the centre of
    each as seen from the clump's bin."""

    rate: float
    first: IndexArray
    centre: FloatArray
    width: npt.NDArray[np.int32]
    area: npt.NDArray[np.int32]
    peak: npt.NDArray[np.int32]


def alarm_rate(numbers: Numbers, per_bin: float) -> float:
    """Echoes a bin that background of `per_bin` makes by itself, on average."""
    if per_bin <= 0.0 or numbers.detectors <= numbers.threshold:
        return 0.0
    return float(_beginnings(numbers, per_bin)[1].sum())


def _beginnings(numbers: Numbers, per_bin: float) -> tuple[IndexArray, FloatArray]:
    """The ways to rise above the threshold and their chances: detectors ON in both bins, new, and gone; (m, 3)."""
    from scipy.special import gammaln, xlog1py, xlogy

    share = _steady(numbers, per_bin)
    both, new, gone = np.meshgrid(
        np.arange(numbers.threshold + 1),
        np.arange(numbers.threshold + 1 + _JUMPS),
        np.arange(numbers.threshold + 1),
        indexing="ij",
    )
    room = numbers.threshold - both
    rises = (new > room) & (new <= room + _JUMPS) & (gone <= room) & (both + new + gone <= numbers.detectors)
    ways = np.stack([both[rises], new[rises], gone[rises]], axis=1)
    others = numbers.detectors - ways.sum(axis=1)
    log = gammaln(numbers.detectors + 1.0) - gammaln(ways + 1.0).sum(axis=1) - gammaln(others + 1.0)
    log += xlogy(ways[:, 0], (numbers.on - 1) * share) + xlogy(ways[:, 1] + ways[:, 2], share)
    log += xlog1py(others, -(numbers.on + 1) * share)
    return ways, elementary.exp(log)


def _steady(numbers: Numbers, per_bin: float) -> float:
    """Chance that a detector avalanches in a given bin."""
    chance = -elementary.expm1(-per_bin)
    return float(chance / (1.0 + (numbers.dead - 1) * chance))


def alarms_of(numbers: Numbers, per_bin: float) -> Alarms:
    """The clumps of a background whose alarms are rare."""
    rate = alarm_rate(numbers, per_bin)
    if rate <= 0.0:
        none = np.empty(0, dtype=np.int32)
        return Alarms(0.0, np.zeros(1, dtype=np.int64), np.empty(0), none, none, none)
    counts, begins, draw = _traces(numbers, per_bin)
    echoes = new_echoes(_CLUMPS, _ROOM)
    # `find_echoes` looks back over the ON time only, so that any padding of at least that will do.
    seen = numbers._replace(pad=numbers.on)
    for i in range(_CLUMPS):
        find_echoes(seen, counts[i], 0, counts.shape[1] - numbers.on, i, echoes)
    often = 1.0 / np.maximum(echoes.held, 1)
    kept = np.flatnonzero(draw < often)
    inside = np.arange(_ROOM) < echoes.held[kept, None]
    first = np.concatenate([[0], np.cumsum(echoes.held[kept], dtype=np.int64)])
    centre = echoes.centre[kept][inside] - (begins - numbers.on)
    width, area, peak = (column[kept][inside] for column in (echoes.width, echoes.area, echoes.peak))
    return Alarms(rate * float(often.mean()), first, centre, width, area, peak)


def _traces(numbers: Numbers, per_bin: float) -> tuple[IndexArray, int, FloatArray]:
    """Avalanches around beginnings, (clumps, bins), the bin where runs begin, and a further draw of each clump."""
    ways, chances = _beginnings(numbers, per_bin)
    dead, on = numbers.dead, numbers.on
    reach = _DEAD_TIMES * dead
    begins = reach + dead
    columns = 2 + numbers.threshold + dead + 2 * reach
    draws = streams.uniforms(_SEED, "fast alarms", 0, np.zeros(_CLUMPS), np.arange(_CLUMPS), columns).T
    total = np.cumsum(chances)
    both, new, gone = ways[np.minimum(np.searchsorted(total, draws[0] * total[-1], "right"), len(ways) - 1)].T
    counts = np.zeros((_CLUMPS, begins + reach + 1), dtype=np.int64)
    counts[:, begins], counts[:, begins - on] = new, gone
    for number in range(numbers.threshold):
        age = 1 + (draws[2 + number] * (on - 1)).astype(np.int64)
        np.add.at(counts, (np.arange(_CLUMPS), begins - age), number < both)
    rest, at, share = numbers.detectors - both - new - gone, 2 + numbers.threshold, _steady(numbers, per_bin)
    for age in range(on + 1, dead):
        counts[:, begins - age] = _binomial(draws[at], rest, share / (1.0 - age * share))
        rest = rest - counts[:, begins - age]
        at += 1
    chance = float(-elementary.expm1(-per_bin))
    for k in range(1, reach + 1):
        for to, window in (
            (begins + k, slice(begins + k - dead + 1, begins + k)),
            (begins - dead - k + 1, slice(begins - dead - k + 2, begins - k + 1)),
        ):
            armed = numbers.detectors - counts[:, window].sum(axis=1)
            counts[:, to] = _binomial(draws[at], armed, chance)
            at += 1
    return counts, begins, draws[1]


def _binomial(uniform: FloatArray, trials: IndexArray, chance: float) -> IndexArray:
    """Binomial numbers by inversion, shape (n,)."""
    from scipy.special import bdtr

    found = np.zeros(len(uniform), dtype=np.int64)
    open_ = np.flatnonzero(trials > 0)
    while len(open_):
        above = uniform[open_] >= bdtr(found[open_].astype(np.float64), trials[open_], chance)
        open_ = open_[above]
        found[open_] += 1
        open_ = open_[found[open_] < trials[open_]]
    return found
