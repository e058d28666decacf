"""The surfaces of each ray: groups of ranges that come again from repeat to repeat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.ideals.repeats.amplitude import Amplitudes
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.ideals.repeats.response import Response
from lidarcheck.sensor import Sensor

__all__ = ["Groups", "gap_m", "grouped", "jump_m"]

_LEAST_GAP_M = 0.1
_SIGMAS = 6.0
_JUMP = 0.1


@dataclass(frozen=True)
class Groups:
    """Surfaces, a row each, in order of (ray, range); columns of shape (n,).

    `hits`: repeats that saw it. `median_m`: of its ranges, spread over their step. `path_m`: their mean as reported.
    `amplitude`, `amplitude_var`: mean and unbiased variance (NaN below two hits); `range_var` likewise. `low`, `high`:
    means of what would be rounded to the values. `capped`: every value is the largest that the sensor reports. `main`:
    the commonest of its ray. `group`: of each of the observations used, -1 where it is of no surface.
    Per ray, shape (rays,): `fired`, in how many repeats; `seen`, in how many with any echo; `two`: it may meet two
    surfaces; `row`: its commonest surface, -1 without one.
    """

    ray: IndexArray
    hits: IndexArray
    median_m: FloatArray
    path_m: FloatArray
    range_var: FloatArray
    amplitude: FloatArray
    amplitude_var: FloatArray
    low: FloatArray
    high: FloatArray
    capped: BoolArray
    main: BoolArray
    used: IndexArray
    group: IndexArray
    fired: IndexArray
    seen: IndexArray
    two: BoolArray
    row: IndexArray

    def __len__(self) -> int:
        return len(self.ray)


def jump_m(range_m: FloatArray) -> FloatArray:
    """By how much the range next to a ray of this range must differ to be another surface's."""
    return _LEAST_GAP_M + _JUMP * range_m


def gap_m(response: Response, sensor: Sensor, amplitude: FloatArray, path_m: FloatArray) -> FloatArray:
    """How far apart two ranges of one ray must lie to be of two surfaces; never more than makes two echoes."""
    signal = response.signal_of(np.where(np.isfinite(amplitude), amplitude, np.inf))
    weakest = response.signal_of(np.zeros(1))[0]
    sigma = response.range_sd_m(np.clip(signal, max(weakest, 1e-9), 1e12), path_m)
    scatter = _SIGMAS * np.nan_to_num(sigma) + 2.0 * sensor.range_resolution_m
    return np.asarray(np.minimum(_LEAST_GAP_M + scatter, np.maximum(sensor.separation_m, scatter)))


def grouped(
    seen: Observations,
    amplitudes: Amplitudes,
    gaps_m: FloatArray,
    use: BoolArray,
    hidden: BoolArray | None = None,
    *,
    half: bool = False,
) -> Groups:
    """The surfaces by the frames of `use`, shape (frames,). `hidden` (frames, rays): rays that a person stands before.

    `gaps_m`: `gap_m` of each observation. `half`: what half of the repeats saw is a surface too.
    """
    rays, frames = len(seen.rays), seen.frames
    fired = seen.fired & use[:, None]
    take = use[seen.frame]
    if hidden is not None:
        fired = fired & ~hidden
        take = take & ~hidden[seen.frame, seen.ray]
    used = np.flatnonzero(take & fired[seen.frame, seen.ray])
    ray, place, frame = seen.ray[used], seen.spread_m[used], seen.frame[used]
    begins = np.ones(len(used), dtype=np.bool_)
    if len(used):
        wide = np.maximum(gaps_m[used][1:], gaps_m[used][:-1])
        begins[1:] = (ray[1:] != ray[:-1]) | (np.diff(place) > wide)
    group = np.cumsum(begins) - 1
    starts = np.flatnonzero(begins)
    by = np.zeros((len(starts), frames), dtype=np.bool_)
    by[group, frame] = True
    hits, of = by.sum(axis=1), ray[starts]
    count = fired.sum(axis=0)
    surface = (2 * hits + half > count[of]) & (count[of] >= 2)
    row, main = _commonest(of, hits, surface, rays)
    two = _may_be_two(by, of, hits, surface, row, rays)
    number = np.where(surface, np.cumsum(surface) - 1, -1)
    moments = _moments(seen, amplitudes, used, group, starts, surface)
    any_echo = np.zeros((frames, rays), dtype=np.bool_)
    any_echo[frame, ray] = True
    return Groups(
        ray=of[surface],
        hits=hits[surface],
        main=main[surface],
        used=used,
        group=number[group],
        fired=count,
        seen=any_echo.sum(axis=0),
        two=two,
        row=np.where(row >= 0, number[np.maximum(row, 0)], -1) if len(starts) else row,
        **moments,
    )


def _commonest(of: IndexArray, hits: IndexArray, surface: BoolArray, rays: int) -> tuple[IndexArray, BoolArray]:
    """The group that each ray sees most often, the nearer of two that are as common; -1 where it has no surface."""
    row = np.full(rays, -1, dtype=np.int64)
    order = np.flatnonzero(surface)
    order = order[np.lexsort((order, -hits[order]))][::-1]
    row[of[order]] = order
    main = np.zeros(len(of), dtype=np.bool_)
    main[row[row >= 0]] = True
    return row, main


def _may_be_two(
    by: BoolArray, of: IndexArray, hits: IndexArray, surface: BoolArray, row: IndexArray, rays: int
) -> BoolArray:
    """Rays that may meet two surfaces, shape (rays,): ranges that are no surface's take its place, or come again."""
    others = np.flatnonzero(~surface & (row[of] >= 0)) if len(of) else np.zeros(0, dtype=np.int64)
    together = (by[others] & by[row[of[others]]]).any(axis=1)
    two = np.zeros(rays, dtype=np.bool_)
    two[of[others[~together | (hits[others] >= 2)]]] = True
    return two


def _moments(
    seen: Observations, amplitudes: Amplitudes, used: IndexArray, group: IndexArray, starts: IndexArray,
    surface: BoolArray,
) -> dict[str, Any]:  # fmt: skip
    """What the ranges and amplitudes of each surface come to."""
    n = len(starts)
    count = np.bincount(group, minlength=n).astype(np.float64)
    ends = np.append(starts[1:], len(used))
    place = seen.spread_m[used]
    lower, upper = starts + (ends - starts - 1) // 2, starts + (ends - starts) // 2
    median = 0.5 * (place[lower] + place[upper]) if n else np.zeros(0)

    def mean(column: FloatArray) -> FloatArray:
        return np.bincount(group, column[used], n) / count

    def variance(column: FloatArray, middle: FloatArray) -> FloatArray:
        off = np.bincount(group, (column[used] - middle[group]) ** 2, n)
        return np.where(count > 1, off / np.maximum(count - 1.0, 1.0), np.nan)

    path, amplitude = mean(seen.path_m), mean(amplitudes.value)
    found = {
        "median_m": median,
        "path_m": path,
        "range_var": variance(seen.path_m, path),
        "amplitude": amplitude,
        "amplitude_var": variance(amplitudes.value, amplitude),
        "low": mean(amplitudes.low),
        "high": mean(amplitudes.high),
        "capped": np.bincount(group, amplitudes.capped[used], n) >= count,
    }
    return {name: column[surface] for name, column in found.items()}
