"""Which shots are lost, as the threshold of a linear detector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import BoolArray
from lidarcheck.ideals.repeats.amplitude import Amplitudes
from lidarcheck.ideals.repeats.groups import Groups, gap_m, grouped
from lidarcheck.ideals.repeats.laws.foretold import Lost, fitted_threshold
from lidarcheck.ideals.repeats.laws.work import THRESHOLD, Work
from lidarcheck.ideals.repeats.neighbours import of_surfaces
from lidarcheck.ideals.repeats.response import LinearResponse

__all__ = ["fit_loss"]

_FEWEST_SEEN = 200


def fit_loss(work: Work, coarse: bool) -> None:
    """Threshold, and the width where amplitudes do not tell it, from hits and misses."""
    if THRESHOLD not in work.free or work.feature is None:
        return
    if not work.seen.fired_known:
        _as_seen(work, "the beams that were fired are not known")
        return
    sensor, seen = work.sensor, work.seen
    response, amplitudes = LinearResponse(sensor), seen.amplitudes(work.feature, sensor)
    gaps = gap_m(response, sensor, amplitudes.value, seen.path_m)
    groups = grouped(seen, amplitudes, gaps, work.use, half=True)
    width = None
    if coarse:
        width = float(np.median(groups.high - groups.low)) if len(groups) else 1.0
    reach = 10.0 * (width or float(response.amplitude_sd(np.array([sensor.threshold]))[0]))
    place = np.full(len(seen.rays), np.nan)
    place[groups.ray[groups.main]] = groups.path_m[groups.main]
    chosen = groups.main & ~groups.two[groups.ray] & (groups.amplitude < sensor.threshold + reach)
    chosen &= of_surfaces(seen.rays, place)[groups.ray]
    found = fitted_threshold(_lost(groups, amplitudes, chosen, work), response, sensor.threshold, width=width)
    if found is None:
        _as_seen(work, "too few shots were lost")
        return
    threshold, low, high, wide = found
    least = None if coarse else _least_seen(groups, amplitudes, chosen)
    if least is not None and least[1] > threshold:
        # No shot is seen below the threshold: of very many the least lies just above it.
        threshold, low, high = least[1], least[0], least[2]
    work.put(THRESHOLD, threshold, ends=(low, high))
    if coarse and "signal_at_1m" in work.free and work.feature.law == "calibrated_reflectivity":
        _in_noise(work, wide)


def _as_seen(work: Work, why: str) -> None:
    """The threshold with which the fit began, about the least amplitude seen: it may be any below."""
    work.put(THRESHOLD, work.sensor.threshold, ends=(0.0, work.sensor.threshold))
    work.note(f"{why}: the threshold is the least amplitude seen, and may lie lower")


def _least_seen(groups: Groups, amplitudes: Amplitudes, chosen: BoolArray) -> tuple[float, float, float] | None:
    """The least amplitude of these surfaces' echoes but a thousandth of them, and what would be rounded to it: low end,
    value, high end; None of few."""
    rows = groups.used[(groups.group >= 0) & chosen[np.maximum(groups.group, 0)]]
    if len(rows) < _FEWEST_SEEN:
        return None
    at = rows[np.argpartition(amplitudes.value[rows], 3 + len(rows) // 1000)[3 + len(rows) // 1000]]
    least = float(amplitudes.value[rows].min())
    low, value, high = (float(column[at]) for column in (amplitudes.low, amplitudes.value, amplitudes.high))
    return min(low, least), value, max(high, 2.0 * value - least)


def _in_noise(work: Work, width: float) -> None:
    """A unit of amplitudes in which the loss law is as wide as the sensor's noise: values alone do not tell it."""
    unit = work.sensor.noise / width
    old = work.fitted[THRESHOLD]
    work.sensor = replace(work.sensor, signal_at_1m=work.sensor.signal_at_1m * unit)
    work.put(THRESHOLD, old.value * unit, ends=(old.low * unit, old.high * unit))


def _lost(groups: Groups, amplitudes: Amplitudes, chosen: BoolArray, work: Work) -> Lost:
    number = np.where(chosen, np.cumsum(chosen) - 1, -1)
    of = np.where(groups.group >= 0, number[np.maximum(groups.group, 0)], -1)
    rows = np.flatnonzero(of >= 0)
    used = groups.used[rows]
    stepped = work.feature is not None and work.feature.step > 0.0
    value = amplitudes.value[used]
    low, high = (amplitudes.low[used], amplitudes.high[used]) if stepped else (value, value)
    return Lost(groups.fired[groups.ray[chosen]], groups.hits[chosen], of[rows], value, low, high)
