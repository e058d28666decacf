"""Where a list of rows is cut, so that no beam stands in one part twice.

A row that repeats an earlier one says that a cut lies between the two. The cuts are as few as these repeats allow; each
may lie anywhere in a window of rows, and is placed where the order of the rows turns back to its beginning.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, IndexArray

__all__ = ["Repeats", "cuts_of", "in_order", "repeats_of"]

MOST_PARTS_A_REPEAT = 4
"""Parts at most, as a multiple of how often the commonest beam stands in the list. Of many beams one shows an echo in a
quarter of the frames at least, however dim the scene; rows that were shuffled, or echoes beside each other, fall into
very many parts."""


class Repeats(NamedTuple):
    """`previous` (n,): the row before with the same key, -1 for none; `most`: rows of the commonest key."""

    previous: IndexArray
    most: int


class _Windows(NamedTuple):
    """The first and the last place, shape (n_cuts,), at which each cut can lie: before that row."""

    first: IndexArray
    last: IndexArray


def in_order(*columns: npt.NDArray[Any]) -> bool:
    """Whether rows ascend by the columns, the first one slowest, so that none stands there twice: a plain frame, told
    without a key or a sort."""
    *slower, fastest = columns
    after: BoolArray = fastest[1:] > fastest[:-1]
    for column in reversed(slower):
        after &= column[1:] == column[:-1]
        after |= column[1:] > column[:-1]
    return bool(after.all())


def repeats_of(key: npt.NDArray[Any]) -> Repeats:
    """Which rows repeat the key of an earlier one."""
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    previous = np.full(len(key), -1, dtype=np.int64)
    previous[order[1:][same]] = order[:-1][same]
    starts = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
    return Repeats(previous, int(np.diff(starts).max(initial=0)))


def cuts_of(
    repeats: Repeats, orders: Sequence[npt.NDArray[Any]], allowed: BoolArray | None = None
) -> IndexArray | None:
    """The rows before which the list is cut, ascending; None where the list does not say where.

    `orders` (n,) each: numbers along which rows may run, as the beam's; the first that turns back once in every window
    places the cuts. `allowed` (n,): before which rows a cut may lie, all by default.
    """
    previous = repeats.previous
    windows = _windows(previous)
    if len(windows.first) + 1 > MOST_PARTS_A_REPEAT * repeats.most:
        return None
    places = [np.arange(first, last + 1) for first, last in zip(*windows, strict=True)]
    if allowed is not None:
        places = [place[allowed[place]] for place in places]
    if any(len(place) == 0 for place in places):
        return None
    if all(len(place) == 1 for place in places):
        return _valid(np.concatenate(places), previous)
    for order in orders:
        turns = _turns(order)
        chosen = [place if len(place) == 1 else place[turns[place]] for place in places]
        if all(len(place) == 1 for place in chosen):
            return _valid(np.concatenate(chosen), previous)
    return None


def _windows(previous: IndexArray) -> _Windows:
    """As few cuts as separate all repeats, each as late and as early as it can lie."""
    n = len(previous)
    repeats = np.flatnonzero(previous >= 0)
    following = np.full(n + 1, n, dtype=np.int64)
    following[previous[repeats]] = repeats
    next_cut = np.minimum.accumulate(following[::-1])[::-1]
    last_cut = np.concatenate([[0], np.maximum.accumulate(previous) + 1])
    late, at = [], int(next_cut[0])
    while at < n:
        late.append(at)
        at = int(next_cut[at])
    early, at = [], int(last_cut[n])
    while at > 0:
        early.append(at)
        at = int(last_cut[at])
    return _Windows(np.array(early[::-1], dtype=np.int64), np.array(late, dtype=np.int64))


def _turns(order: npt.NDArray[Any]) -> BoolArray:
    """Before which rows the numbers step against the way that most of them go, shape (n,)."""
    steps = np.diff(order)
    up, down = steps > 0, steps < 0
    against = down if np.count_nonzero(up) >= np.count_nonzero(down) else up
    return np.concatenate([[False], against])


def _valid(cuts: IndexArray, previous: IndexArray) -> IndexArray | None:
    """The cuts, if they separate all repeats."""
    repeats = np.flatnonzero(previous >= 0)
    between = np.searchsorted(cuts, repeats, "right") - np.searchsorted(cuts, previous[repeats], "right")
    return cuts if bool((between > 0).all()) else None
