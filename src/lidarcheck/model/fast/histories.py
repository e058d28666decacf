"""Histories of haze: what the light that the air scatters makes of a beam's detectors, before anything else comes back.

In the same air and under the same background beams differ only in where the haze ends and in what is behind it. So its
avalanches and echoes are drawn once, for many beams without an end, and kept. `join.py` lets a beam go on from one.
"""

from __future__ import annotations

import collections
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.abreast import RESERVE, Abreast, new_abreast, run_abreast
from lidarcheck.model.exact.binomial import inverses
from lidarcheck.model.exact.haze_rates import HazeRates
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.fast.set_off import After, Law, new_after, run_setting_off, start_lane
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.sharing import Share
from lidarcheck.model.streams import Stream, fill_twice_abreast, new_stream

__all__ = ["FIELDS", "HISTORIES", "LEAST", "Histories", "histories_of", "last_bin"]

HISTORIES, LEAST = 16384, 4096
"""Of one air and background, or of each part of the haze where beams see many; beams share them, which adds 1/16384 of
a beam's variance to that of a frame's mean."""
_WARM_UP = 4
"""Dead times of background before bin 0."""
_FAINT = 0.01
"""Detectors ON by haze, on average, below which a history ends."""
FIELDS, _ROOM = 5, 6
"""Numbers of an echo, and the most echoes of a history."""
_MORE = 16
"""Room for afterpulses beyond twice their mean."""
_MOST_COUNT = 255
_CHUNK = 1024
_BYTES = 1 << 29
"""Of what is kept."""
_kept: collections.OrderedDict[tuple[object, ...], Histories | None] = collections.OrderedDict()
_guard = threading.Lock()


class Histories(NamedTuple):
    """Avalanches `counts` (n, bins) from bin `start` on to `end`, and the echoes from bin 0 on.

    `echoes` (n, 1 + room * 5): how many, and of each the first bin, the one behind the last, area, first moment
    and peak; in one piece, since each beam fetches another history's. `trail` (n, 1 + room * 2): how many afterpulses,
    and of each the bin of the avalanche and twice its own, see `After`.
    """

    start: int
    end: int
    counts: npt.NDArray[np.uint8]
    echoes: npt.NDArray[np.int32]
    trail: npt.NDArray[np.int32]


def last_bin(numbers: Numbers, haze: HazeRates, weight: float) -> int:
    """The bin from which on haze of that weight is faint, and a dead time has passed."""
    bright = np.flatnonzero(weight * haze.ceiling[:-1] * numbers.detectors * numbers.on > _FAINT)
    end = (int(bright[-1]) + 1 if len(bright) else 0) + numbers.dead + numbers.on
    return min(end, numbers.bins)


def histories_of(
    numbers: Numbers, law: Law, haze: HazeRates, weight: float, per_bin: float, size: int, seed: int, among: Share
) -> Histories | None:
    """So many histories of a haze and a background of `per_bin`; None where one holds too much to keep.

    `weight`: the part of the haze. `seed`: each level has draws of its own.
    """
    of_bins = per_bin + weight * haze.whole[: last_bin(numbers, haze, weight)]
    of_law = [one.tobytes() if isinstance(one, np.ndarray) else one for one in law]
    key = (numbers, *of_law, per_bin, of_bins.tobytes(), size, seed)
    with _guard:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
    found = _simulated(numbers, law, per_bin, of_bins, size, seed, among)
    with _guard:
        _kept[key] = found
        while len(_kept) > 1 and sum(part.nbytes for one in _kept.values() if one for part in one[2:]) > _BYTES:
            _kept.popitem(last=False)
    return found


def _simulated(
    numbers: Numbers, law: Law, per_bin: float, of_bins: FloatArray, size: int, seed: int, among: Share
) -> Histories | None:
    start = -_WARM_UP * numbers.dead
    lead = max(law.warm_up + start, 0) if law.any_ else 0
    rates = np.concatenate([np.full(lead - start, per_bin), of_bins])
    room = int(2.0 * law.chance[8] * numbers.detectors * rates.sum()) + _MORE if law.any_ else 0
    counts = np.empty((size, len(rates) - lead), dtype=np.uint8)
    echoes = np.zeros((size, 1 + FIELDS * _ROOM), dtype=np.int32)
    trail = np.zeros((size, 1 + 2 * room), dtype=np.int32)
    found = Histories(start, len(of_bins), counts, echoes, trail)
    group_of: Callable[[], Abreast] = lambda: new_abreast(numbers._replace(bins=len(rates)))  # noqa: E731
    fits = np.ones(size // _CHUNK, dtype=np.bool_)

    def run(at: int) -> None:
        stream = new_stream(0, "fast histories", seed)
        inverse, after = inverses(numbers.detectors), new_after(len(rates), room)
        space: tuple[Any, ...] = (group_of(), after, inverse, found)
        fits[at // _CHUNK] = _simulate(numbers, law, stream, rates, at, at + _CHUNK, *space)

    among(run, range(0, size, _CHUNK))
    return found if fits.all() else None


@kernel
def _simulate(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    rates: FloatArray,
    start: int,
    stop: int,
    group: Abreast,
    after: After,
    inverse: FloatArray,
    found: Histories,
) -> bool:
    """The histories `start` ... `stop - 1`; False where a count does not fit."""
    bins, kept = len(rates), found.counts.shape[1]
    fits: Any = True
    for low in range(start, stop, LANES):
        group.counts[: numbers.dead * LANES] = 0
        for lane in range(LANES):
            group.key[lane] = np.uint64(low + lane)
            group.dead[lane], group.length[lane] = 0, bins
            for k in range(bins):
                group.rates[k * LANES + lane] = rates[k]
        fill_twice_abreast(stream, group.key, (RESERVE + bins + 7) // 8, group.words, group.draws)
        if law.any_:
            for lane in range(LANES):
                start_lane(law, stream, after, lane, group.key[lane])
            run_setting_off(numbers, law, stream, group, after, bins, inverse)
        else:
            run_abreast(numbers, group, bins, inverse)
        for lane in range(LANES):
            for k in range(kept):
                count = np.int64(group.counts[(numbers.dead + bins - kept + k) * LANES + lane])
                fits = fits and count <= _MOST_COUNT
                found.counts[low + lane, k] = count
            _find_echoes(numbers, found, low + lane)
            fits = fits and _keep_trail(after, lane, bins - found.end, found.trail[low + lane])
    return bool(fits)


@kernel
def _keep_trail(after: After, lane: int, zero: int, trail: npt.NDArray[np.int32]) -> bool:
    """Write down a lane's afterpulses, bins counted from `zero`; False where there was no more room."""
    of = after.trail[lane]
    trail[0] = of[0]
    for j in range(of[0]):
        trail[2 * j + 1], trail[2 * j + 2] = of[2 * j + 1] - zero, of[2 * j + 2] - 2 * zero
    return len(trail) == 1 or 2 * of[0] + 1 < len(trail)


@kernel
def _find_echoes(numbers: Numbers, found: Histories, h: int) -> None:
    """Write down the echoes of a history from bin 0 on."""
    counts, echoes, zero = found.counts[h], found.echoes[h], -found.start
    most = len(echoes) // FIELDS
    on: Any = 0
    held, width, area, moment, peak = 0, 0, 0, 0, 0
    for k in range(zero - numbers.on + 1, zero):
        on += np.int64(counts[k])
    for bin_ in range(found.end):
        on += np.int64(counts[zero + bin_])
        if on > numbers.threshold:
            width, area, moment, peak = width + 1, area + on, moment + on * bin_, max(peak, on)
        if width > 0 and (on <= numbers.threshold or bin_ == found.end - 1) and held < most:
            last = bin_ + 1 if on > numbers.threshold else bin_
            at = 1 + FIELDS * held
            echoes[at], echoes[at + 1], echoes[at + 2] = last - width, last, area
            echoes[at + 3], echoes[at + 4] = moment, peak
            held += 1
        if on <= numbers.threshold:
            width = area = moment = peak = 0
        on -= np.int64(counts[zero + bin_ - numbers.on + 1])
    echoes[0] = held
