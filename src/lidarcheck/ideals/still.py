"""Where a recording stands still: runs of frames whose rays agree.

Two frames are compared ray by ray. Noise makes neighbouring rays differ each for itself; a sensor or a scene that moves
makes whole surfaces differ alike. So what tells is not how much ranges differ, which no one knows beforehand, but how
alike neighbours differ, and how many rays have another surface.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.formats.assign.cloud import Cloud

__all__ = ["Likeness", "Search", "Stretch", "View", "likeness", "view_of"]

_ALIKE = 0.35
"""Correlation of neighbours' differences from which on it is motion: noise alone has 0."""
_CHANGED, _COMPARED = 0.15, 0.3
"""More rays with another surface, or fewer that can be compared, make another scene."""
_CLIP, _OTHER = 2.0, 6.0
"""Differences count up to so many standard deviations; beyond, a ray meets another surface."""
_MAD = 1.4826
_JUMP_M, _JUMP = 0.1, 0.1
"""Neighbours farther apart than this and that part of the range lie on different surfaces."""
_REACH, _APART_DEG, _APART = 1.5, 2.0, 8
"""Rays are neighbours where no more than so many steps lie between them. The noise of rays that are so far apart, or so
many steps, has nothing in common, where that of neighbours may, since sensors smooth their ranges."""
_SAME_DEG, _EXACT = 1e-9, 0.05
"""Rays nearer to each other than this part of a column's step are the same ray."""
_BAND_DEG = 0.1
"""Without rings rows are told apart by bands of elevation of that width."""
_LEAST_M = 1e-4


@dataclass(frozen=True)
class View:
    """The nearest echo of each ray, in order of line and azimuth; columns of shape (n,).

    `line`: the ring that the file names, else a band of elevations. `step_deg`: the usual distance of columns.
    """

    line: IndexArray
    azimuth_deg: FloatArray
    range_m: FloatArray
    step_deg: float


@dataclass(frozen=True)
class Likeness:
    """How alike neighbours differ between two frames (a correlation), and which part of the rays has changed its
    surface, and could be compared."""

    correlation: float
    changed: float
    compared: float

    @property
    def still(self) -> bool:
        """Whether sensor and scene stand as they stood."""
        return self.compared >= _COMPARED and self.changed <= _CHANGED and self.correlation <= _ALIKE


@dataclass
class Stretch:
    """Frames `first` to `last`, both included, that agree with each other."""

    first: int
    last: int
    anchor: View = field(repr=False)

    def __len__(self) -> int:
        return self.last - self.first + 1


def view_of(cloud: Cloud) -> View:
    """What a frame shows of its rays; nothing need be known of the sensor."""
    xyz = cloud.position
    range_m = np.sqrt((xyz * xyz).sum(axis=1))
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0]))
    named = cloud.layer if cloud.layer is not None else cloud.ring
    if named is None:
        named = np.round(np.rad2deg(np.arcsin(np.clip(xyz[:, 2] / np.maximum(range_m, 1e-9), -1.0, 1.0))) / _BAND_DEG)
    line = named.astype(np.int64)
    known = np.flatnonzero(range_m > 0.0)
    order = known[np.lexsort((range_m[known], azimuth[known], line[known]))]
    line, azimuth, range_m = line[order], azimuth[order], range_m[order]
    apart = np.diff(azimuth)[np.diff(line) == 0]
    apart = apart[apart > _SAME_DEG]
    step = float(np.median(apart)) if len(apart) else 1.0
    # The first of one ray's echoes is the nearest.
    first = np.ones(len(line), dtype=np.bool_)
    first[1:] = (np.diff(line) != 0) | (np.diff(azimuth) > _EXACT * step)
    return View(line[first], azimuth[first], range_m[first], step)


def likeness(one: View, other: View) -> Likeness:
    """How far two frames agree, of the rays of the first."""
    off = _differences(one, other)
    there = np.isfinite(off)
    compared = float(there.mean()) if len(off) else 0.0
    if compared < _COMPARED:
        return Likeness(1.0, 1.0, compared)
    size = np.abs(off[there])
    # Where most ranges are the same to the step, the others say how wide that is.
    usual = float(np.median(size)) or (float(np.median(size[size > 0.0])) if size.any() else 0.0)
    spread = max(_MAD * usual, _LEAST_M)
    near = there & (np.abs(np.nan_to_num(off, nan=np.inf)) <= _OTHER * spread)
    changed = 1.0 - np.count_nonzero(near) / np.count_nonzero(there)
    apart = int(np.clip(round(_APART_DEG / one.step_deg), 1, _APART))
    pair = near[apart:] & near[:-apart] & (one.line[apart:] == one.line[:-apart])
    pair &= one.azimuth_deg[apart:] - one.azimuth_deg[:-apart] <= (apart + _REACH) * one.step_deg
    cut = np.clip(np.where(near, np.nan_to_num(off), 0.0), -_CLIP * spread, _CLIP * spread)
    power = float(np.mean(cut[near] ** 2))
    if not pair.any() or power <= _LEAST_M**2:
        return Likeness(0.0, float(changed), compared)
    return Likeness(float(np.mean((cut[apart:] * cut[:-apart])[pair])) / power, float(changed), compared)


def _differences(one: View, other: View) -> FloatArray:
    """Range of the other frame less that of the first along each ray of the first, NaN where it has none; shape (n,).

    Between two rays of one surface the inverse of the range goes straight over the angle.
    """
    if len(other.line) < 2:
        return np.full(len(one.line), np.nan)
    # Azimuths go from -180 to 180: no line reaches into the next.
    place, key = (view.line * 1000.0 + view.azimuth_deg for view in (other, one))
    right = np.clip(np.searchsorted(place, key), 1, len(place) - 1)
    left = right - 1
    nearest = np.where(np.abs(place[left] - key) < np.abs(place[right] - key), left, right)
    exact = np.abs(place[nearest] - key) <= _EXACT * other.step_deg
    near, far, apart = other.range_m[left], other.range_m[right], place[right] - place[left]
    smooth = np.abs(near - far) <= _JUMP_M + _JUMP * np.minimum(near, far)
    between = (apart <= _REACH * other.step_deg) & (place[left] <= key) & (key <= place[right]) & smooth
    share = np.clip((key - place[left]) / np.maximum(apart, _SAME_DEG), 0.0, 1.0)
    along = np.where(exact, other.range_m[nearest], 1.0 / ((1.0 - share) / near + share / far))
    return np.where(exact | between, along - one.range_m, np.nan)


@dataclass
class Search:
    """A search for the longest run of frames that agree, each with the one before and with the first of the run, so
    that nothing creeps; frames are given to it one by one, in order of time.

    `best`: None as long as no two frames agree. `seen`: frames so far. `alternate`: how many agree with the one before
    the last, but not with the last, as where two sensors take turns.
    """

    best: Stretch | None = None
    seen: int = 0
    alternate: int = 0
    _now: Stretch | None = None
    _before: list[View] = field(default_factory=list)

    def look(self, cloud: Cloud) -> None:
        """The next frame."""
        view = view_of(cloud)
        goes_on = bool(self._before) and self._goes_on(view)
        if self._now is not None and goes_on:
            self._now.last = self.seen
        else:
            self._now = Stretch(self.seen, self.seen, view)
        if len(self._now) > (len(self.best) if self.best is not None else 1):
            self.best = Stretch(self._now.first, self._now.last, self._now.anchor)
        if not goes_on and len(self._before) > 1 and likeness(self._before[-2], view).still:
            self.alternate += 1
        self._before = [*self._before[-1:], view]
        self.seen += 1

    def _goes_on(self, view: View) -> bool:
        assert self._now is not None, "there was a frame before"
        if not likeness(self._before[-1], view).still:
            return False
        return self._now.last == self._now.first or likeness(self._now.anchor, view).still

    @property
    def two_sensors(self) -> bool:
        """Whether most frames are like the one before the last and not like the last."""
        return self.alternate > 0.5 * max(self.seen - 2, 1) and (self.best is None or len(self.best) < 3)
