"""Every curve that the demonstration can show: means of a quantity over an axis, without and with an effect."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.model.showcase.features import Axis, Features, axes, stray_axes

__all__ = ["CandidateCurve", "Quantity", "candidates"]

_FEWEST = 32
"""Values that a point of a curve must stand for."""
_LEAST = 0.05
"""Part of a quantity's own spread that chance is at least taken to make."""
_PEAK = 0.5
"""PEAK says little that AREA does not: its change must be twice as clear to be shown instead."""
_STRAYS = "echoes that belong to no surface"
_PER_1000 = "per 1000 beams"


@dataclass(frozen=True)
class Quantity:
    """What is averaged: its values of each run and beam, shape (runs, n) without and with; its name and unit.

    With `ratio` the mean is the geometric one, so that a change is a factor. `counted`: 0, 1, ... of something.
    `relative`: how a change is drawn that is small beside the curve itself.
    """

    name: str
    words: str
    unit: str
    before: FloatArray
    after: FloatArray
    ratio: bool = False
    relative: Literal["ratio", "change", ""] = ""
    counted: bool = False
    weight: float = 1.0

    @functools.cached_property
    def largest(self) -> float:
        """The largest value of any run and beam, 0 where there is none."""
        values = np.concatenate([self.before.ravel(), self.after.ravel()])
        return float(values[np.isfinite(values)].max(initial=0.0))

    @functools.cached_property
    def least_noise(self) -> float:
        """A variance below which chance is not believed: frames that agree exactly prove no more than they hold."""
        values = np.concatenate([self.before.ravel(), self.after.ravel()])
        values = values[np.isfinite(values)]
        return max((_LEAST * float(values.std())) ** 2 if len(values) else 0.0, 1e-18)


@dataclass(frozen=True)
class CandidateCurve:
    """A curve on an axis, and by how much its change exceeds chance: chi-square less its degrees of freedom."""

    quantity: Quantity
    axis: Axis
    before: FloatArray
    after: FloatArray
    x: FloatArray
    chi2: float

    @property
    def excess(self) -> float:
        """By how much chi-square is above what chance makes it."""
        return self.chi2 - len(self.x)

    @property
    def merit(self) -> float:
        """What curves are chosen by."""
        return self.excess * self.quantity.weight * self.axis.weight


def candidates(without: Features, with_it: Features) -> Iterator[CandidateCurve]:
    """Every quantity over every axis, the telling ones first; strays also over a range of their own."""
    own = [_compare(_strays(without, with_it, column), axis) for column, axis in stray_axes()]
    yield own[0]
    for quantity in _quantities(without, with_it):
        for axis in axes():
            yield _compare(quantity, axis)
    yield from own[1:]


def _strays(without: Features, with_it: Features, column: str) -> Quantity:
    """Echoes that belong to no surface, from the column of that name: of each beam, or of each of its bins."""
    before, after = (1000.0 * getattr(side, column).reshape(len(side.strays), -1) for side in (without, with_it))
    return Quantity("strays", _STRAYS, _PER_1000, before, after, counted=True)


def _quantities(without: Features, with_it: Features) -> list[Quantity]:
    # Only beams that have their echo in every run: else the mean would change with who is still there.
    kept = np.isfinite(without.area).all(axis=0) & np.isfinite(with_it.area).all(axis=0)

    def of(column: str) -> tuple[FloatArray, FloatArray]:
        before, after = (np.where(kept, getattr(side, column), np.nan) for side in (without, with_it))
        return before, after

    def size(name: str, column: str, unit: str, weight: float = 1.0) -> Quantity:
        before, after = elementary.log(of(column))
        return Quantity(name, name, unit, before, after, ratio=True, relative="ratio", weight=weight)

    scatter = [np.abs(residual[0::2] - residual[1::2]) * (np.sqrt(np.pi) / 2.0) for residual in of("residual_m")]
    detected = [side.detected * 100.0 for side in (without, with_it)]
    return [
        size("AREA", "area", "counts"),
        Quantity(
            "detection", "surfaces that have an echo", "%", detected[0], detected[1], relative="change", counted=True
        ),
        Quantity("range_residual", "range less the true range", "m", *of("residual_m"), relative="change"),
        Quantity("range_scatter", "scatter of the range", "m", scatter[0], scatter[1], relative="ratio"),
        size("PEAK", "peak", "counts", _PEAK),
        size("WIDTH", "width_ns", "ns"),
        _strays(without, with_it, "strays"),
    ]


def _compare(quantity: Quantity, axis: Axis) -> CandidateCurve:
    """Means in each bin without and with the effect, and chi-square of their difference against the frames' noise.

    One noise for the whole curve: with each bin's own, an axis would win by sorting the noise, not the change.
    """
    k = len(axis.at)
    sides = [_means(values, axis.bin, k, quantity.counted) for values in (quantity.before, quantity.after)]
    (before, n_before, *_), (after, n_after, *_) = sides
    drawn = (n_before >= _FEWEST) & (n_after >= _FEWEST)
    before, after, at = before[drawn], after[drawn], axis.at[drawn]
    if not len(at):
        return CandidateCurve(quantity, axis, before, after, at, 0.0)
    squares, values = (sum(part) for part in list(zip(*sides, strict=True))[2:])
    if quantity.counted:  # what never happened in so many beams may happen in the next
        squares, values = squares + quantity.largest**2, values + 1.0
    noise = max(squares / max(values, 1.0), quantity.least_noise)
    chi2 = float(((after - before) ** 2 / (1.0 / n_before[drawn] + 1.0 / n_after[drawn])).sum()) / noise
    if quantity.ratio:
        before, after = elementary.exp(before), elementary.exp(after)
    return CandidateCurve(quantity, axis, before, after, at, chi2)


def _means(
    values: FloatArray, place: npt.NDArray[np.int64], k: int, counted: bool
) -> tuple[FloatArray, FloatArray, float, float]:
    """Of each bin the mean and how many values it is of; then the squares that are chance alone: their sum and number.

    Frames of a beam differ by chance alone. Of what is counted, the spread within a bin is taken.
    """
    inside = np.isfinite(values) & (place >= 0)
    bins = np.broadcast_to(np.where(place >= 0, place, 0), values.shape)
    count = np.bincount(bins[inside], minlength=k).astype(np.float64)
    mean = np.bincount(bins[inside], weights=values[inside], minlength=k) / np.maximum(count, 1.0)
    if counted:
        left = (values - mean[bins])[inside]
        return mean, count, float((left**2).sum()), float(len(left))
    both = inside.all(axis=0)
    return mean, count, float(values[:, both].var(axis=0, ddof=1).sum()), float(both.sum())
