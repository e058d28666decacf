"""Backscatter of the air as kernels see it: avalanches per bin of a profile that what a beam meets may cut short.

The profile consists of cells of constant density, so its rates are a sum of ramps: a row of unit pulses, one a bin,
that ends at x leaves W_k(x) in bin k, which is tabulated. The uncut profile is worked out once, and so is what is left
of it where it ends at a cell's edge; a row then costs the ramp of the cell that it ends in.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulse_form import PHASES, PulseForm
from lidarcheck.model.lane_math import whole_below
from lidarcheck.model.row_order import sort_in_beams
from lidarcheck.scan import Haze, Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["HazeRates", "add_haze", "add_ramp", "haze_end", "haze_rates_of", "uncut_until", "weight_of"]

_ROOM = 1 << 21
"""Numbers that the table of cut profiles may hold; of finer profiles, it holds every second edge, or every third."""


class HazeRates(NamedTuple):
    """The haze of all beams; without any, `begin` and `last` are 0 and the arrays are empty.

    `begin`, `last`: the bins `begin` ... `last - 1` can see it. Beam i has the rows `first[i]` ...
    `first[i + 1] - 1`, in order of their `end` [bins]; `share` is their factor. `whole` (bins,): avalanches per armed
    SPAD in each bin of the uncut profile. `ceiling` (bins + 1,): the most of `whole` from a bin on. `step` [bins]:
    length of a cell; `density` (m,): S per bin of range in a cell. `cut[j]`: what `whole` would be if it ended where
    cell j `stride` begins; its columns are the bins from `before + 1` ahead of that edge's on. `ramps`: see
    `PulseForm`; `before`, `behind`: bins around a pulse that it holds.
    """

    begin: int
    last: int
    first: IndexArray
    end: FloatArray
    share: FloatArray
    whole: FloatArray
    ceiling: FloatArray
    step: float
    density: FloatArray
    cut: FloatArray
    stride: int
    ramps: FloatArray
    before: int
    behind: int


def haze_rates_of(light: Light, form: PulseForm, sensor: SpadArray, numbers: Numbers) -> HazeRates:
    """The light's haze as kernels see it; none where it holds no light."""
    haze, bin_m = light.haze, 0.5 * LIGHT_SPEED_M_PER_NS * sensor.bin_ns
    if haze is None or not (np.any(haze.density_per_m > 0.0) and np.any(haze.row_share > 0.0)):
        return _without_haze(numbers)
    first, end, share = _rows_by_end(haze)
    step, density = haze.step_m / bin_m, haze.density_per_m * bin_m
    factors = share if _one_each(first) else _sums(first, share)
    most = numbers.detectors * float(factors.max())
    before, behind = (int(reach) for reach in form.reach(most * density.sum() * step))
    behind = min(behind, max(numbers.bins, before))
    seen = min(len(density), math.ceil((numbers.bins + before + 1) / step))
    density = np.ascontiguousarray(density[:seen])
    lit = np.flatnonzero(density)
    if len(lit) == 0:
        return _without_haze(numbers)
    stride = seen * (before + behind + 4) // _ROOM + 1
    whole, cut, ramps = _profiles(numbers.bins, form, step, density.tobytes(), before, behind, stride)
    begin = min(max(math.floor(lit[0] * step) - before, 0), numbers.bins)
    last = min(math.floor((lit[-1] + 1) * step) + behind + 1, numbers.bins)
    ceiling = np.append(np.maximum.accumulate(whole[::-1])[::-1], 0.0)
    tables = (step, density, cut, stride, ramps, before, behind)
    return HazeRates(begin, last, first, end / bin_m, share, whole, ceiling, *tables)


def _one_each(first: IndexArray) -> bool:
    """Whether each beam has exactly one row."""
    return np.array_equal(first, np.arange(len(first)))


def _sums(first: IndexArray, share: FloatArray) -> FloatArray:
    """The factors of each beam that sees anything, its rows together."""
    return np.asarray(np.add.reduceat(np.append(share, 0.0), first[:-1])[first[1:] > first[:-1]])


@functools.lru_cache(maxsize=2)
def _profiles(
    bins: int, form: PulseForm, step: float, cells: bytes, before: int, behind: int, stride: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`whole`, `cut` and `ramps` of a profile, whose `density` has these bytes; kept, since the same air
    stands in many frames."""
    density = np.frombuffer(cells)
    ramps = form.ramps(before, behind)
    cut, whole = np.zeros((len(density) // stride + 1, before + behind + 4)), np.zeros(bins)
    _tabulate(step, density.copy(), ramps, before, stride, cut, whole)
    return whole, cut, ramps


def _without_haze(numbers: Numbers) -> HazeRates:
    none, table = np.zeros(0), np.zeros((0, 0))
    return HazeRates(0, 0, np.zeros(0, dtype=np.int64), none, none, none, none, 1.0, none, table, 1, table, 0, 0)


def _rows_by_end(haze: Haze) -> tuple[IndexArray, FloatArray, FloatArray]:
    """`first`, `end` and `share` of the rows that see anything, each beam's in order of their ends."""
    lit = (haze.row_share > 0.0) & (haze.row_end_m > 0.0)
    if lit.all() and _one_each(haze.first_row):
        return haze.first_row.copy(), haze.row_end_m.copy(), haze.row_share.copy()
    first, kept = np.append(0, np.cumsum(lit))[haze.first_row], np.flatnonzero(lit)
    end, share, order = haze.row_end_m[kept], haze.row_share[kept], np.arange(len(kept))
    sort_in_beams(first, end, share, order)
    return first, end[order], share[order]


@inlined
def add_ramp(
    ramps: FloatArray, before: int, at: float, weight: float, origin: int, low: int, high: int, rates: FloatArray
) -> None:
    """Add `weight` W_k(at) to the bins `low` ... `high - 1`; index 0 of `rates` is bin `origin`."""
    middle = whole_below(at)
    position = (at - middle) * PHASES
    phase = int(position)
    above = weight * (position - phase)
    below = weight - above
    nearer, farther = ramps[phase], ramps[phase + 1]
    start = max(middle - before, low)
    stop = min(middle - before + ramps.shape[1], high)
    for k in range(low, min(start, high)):
        rates[k - origin] += weight
    column, bin_ = np.uint64(start - middle + before), np.uint64(start - origin)
    for k in range(np.uint64(max(stop - start, 0))):
        rates[bin_ + k] += below * nearer[column + k] + above * farther[column + k]


@kernel
def _tabulate(
    step: float, density: FloatArray, ramps: FloatArray, before: int, stride: int, cut: FloatArray, whole: FloatArray
) -> None:
    """Fill `cut` and `whole`, cell by cell; `whole` is, at each cell's edge, the profile that ends there."""
    bins = len(whole)
    for cell in range(len(density) + 1):
        begin = cell * step
        low = whole_below(begin) - before - 1
        if cell % stride == 0:
            for column in range(cut.shape[1]):
                if 0 <= low + column < bins:
                    cut[cell // stride, column] = whole[low + column]
        if cell < len(density) and density[cell] > 0.0:
            end = (cell + 1) * step
            high = min(whole_below(end) - before + ramps.shape[1], bins)
            add_ramp(ramps, before, end, density[cell], 0, max(low, 0), high, whole)
            add_ramp(ramps, before, begin, -density[cell], 0, max(low, 0), high, whole)


@inlined
def haze_end(numbers: Numbers, haze: HazeRates, beam: int, faint: float) -> int:
    """The bin from which on a beam's haze is at most `faint` avalanches per armed SPAD and bin; 0 without any haze."""
    if haze.last == 0 or haze.first[beam] == haze.first[beam + 1]:
        return 0
    rows_end = haze.first[beam + 1]
    longest = min(haze.end[rows_end - 1], 2.0 * haze.last)
    weight = 0.0
    for row in range(haze.first[beam], rows_end):
        weight += haze.share[row]
    low, high = haze.begin, min(whole_below(longest) + haze.behind + 1, haze.last)
    while low < high:
        middle = (low + high) // 2
        if weight * haze.ceiling[middle] <= faint:
            high = middle
        else:
            low = middle + 1
    return low if low > haze.begin else 0


@inlined
def weight_of(haze: HazeRates, beam: Any) -> float:
    """The factor of a beam's uncut profile, its rows together, as `add_haze` sums them."""
    weight = 0.0
    for row in range(haze.first[beam + np.uint64(1)] - 1, haze.first[beam] - 1, -1):
        weight += haze.share[row]
    return weight


@inlined
def uncut_until(haze: HazeRates, beam: Any, end: Any) -> Any:
    """The bin before which a beam's haze is the uncut profile, at most `end`."""
    for row in range(haze.first[beam], haze.first[beam + np.uint64(1)]):
        if haze.end[row] < len(haze.density) * haze.step:
            end = min(end, max(_base(haze, _cell(haze, haze.end[row]) // haze.stride), 0))
    return end


@inlined
def _cell(haze: HazeRates, at: float) -> Any:
    """The last cell of a row that ends at `at`."""
    return min(int(at / haze.step), len(haze.density) - 1)


@inlined
def _base(haze: HazeRates, table_row: Any) -> Any:
    """The bin from which on a row of `cut` differs from the uncut profile."""
    return whole_below(table_row * haze.stride * haze.step) - haze.before - 1


@inlined
def _add_scaled(weight: float, whole: FloatArray, low: int, high: int, origin: int, rates: FloatArray) -> None:
    """Add `weight` times `whole` to the bins `low` ... `high - 1`; index 0 of `rates` is bin `origin`."""
    # An unsigned index cannot count from the array's end, which saves the test for it.
    source, bin_ = np.uint64(low), np.uint64(low - origin)
    for k in range(np.uint64(max(high - low, 0))):
        rates[bin_ + k] += weight * whole[source + k]


@kernel
def add_haze(haze: HazeRates, beam: int, begin: int, end: int, rates: FloatArray) -> None:
    """Add the haze's avalanches per armed SPAD to `rates` of the bins `begin` ... `end - 1` (index 0 is `begin`)."""
    profile_end = len(haze.density) * haze.step
    weight = 0.0
    top = min(end, haze.last)
    for row in range(haze.first[beam + 1] - 1, haze.first[beam] - 1, -1):
        share, at = haze.share[row], haze.end[row]
        if at < profile_end:
            whole_end = _add_cut(haze, at, share, begin, end, rates)
            _add_scaled(weight, haze.whole, max(whole_end, begin), top, begin, rates)
            top = min(top, whole_end)
        weight += share
    _add_scaled(weight, haze.whole, max(begin, haze.begin), top, begin, rates)


@inlined
def _add_cut(haze: HazeRates, at: float, share: float, begin: int, end: int, rates: FloatArray) -> Any:
    """Add a row's haze from where its end is felt; returns the bin before which it is the uncut profile."""
    last_cell = _cell(haze, at)
    table_row = last_cell // haze.stride
    first_cell, base = table_row * haze.stride, _base(haze, table_row)
    for k in range(max(base, begin), min(base + haze.cut.shape[1], end)):
        rates[k - begin] += share * haze.cut[table_row, k - base]
    high = min(whole_below(at) - haze.before + haze.ramps.shape[1], end)
    for cell in range(first_cell, last_cell + 1):
        density = share * haze.density[cell]
        low = max(base, begin)
        add_ramp(haze.ramps, haze.before, min((cell + 1) * haze.step, at), density, begin, low, high, rates)
        add_ramp(haze.ramps, haze.before, cell * haze.step, -density, begin, low, high, rates)
    return base
