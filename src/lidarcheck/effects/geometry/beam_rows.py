"""Which rows of the ideal scan stand behind each beam of the light, and what their surfaces return."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Material

__all__ = ["BeamRows", "by_material"]

_DIGITS = 9


class BeamRows(NamedTuple):
    """The rows of each beam: beam i has `row[first[i]]` ... `row[first[i + 1] - 1]`, as they stand in the ideal scan.

    `first` (n_beams + 1,); `row` and `share`, the part of the beam's light that the row stands for, (n_rows,).
    `row` is None where row i is all that beam i has.
    """

    first: IndexArray
    row: IndexArray | None
    share: FloatArray

    @classmethod
    def of(cls, light: Light, ideal: IdealScan, share: FloatArray | None = None) -> BeamRows:
        """The rows behind the beams of `light`; `UsageError` where these are not the ideal scan's, in order."""
        share = ideal.shares() if share is None else share
        if ideal.in_order and light.layer is ideal.layer and light.point is ideal.point:
            return cls(_one_each(len(ideal)), None, share)
        key, of_light = (one.layer.astype(np.int64) << 32 | one.point for one in (ideal, light))
        row = np.arange(len(key))
        if np.any(key[1:] < key[:-1]):
            row = np.argsort(key, kind="stable")
            key, share = key[row], share[row]
        begin = np.flatnonzero(np.concatenate([[True], key[1:] > key[:-1]])) if len(key) else row
        if not np.array_equal(key[begin], of_light):
            fix = "let each light effect hand on all beams that it is given, in their order"
            raise UsageError("the light has other beams than the ideal scan", fix=fix)
        return cls(np.append(begin, len(key)), row, share)

    def of_each(self, column: FloatArray) -> FloatArray:
        """What a column of the ideal scan, (n,), says of each row, shape (n_rows,)."""
        return column if self.row is None else column[self.row]

    def total(self, values: FloatArray) -> FloatArray:
        """The sum of `values` (n_rows,) over the rows of each beam, shape (n_beams,), to a billionth.

        Rounded, so that the rows' order cannot matter, and equal mixtures are equal numbers: detectors keep tables for
        each number that they meet.
        """
        count = np.diff(self.first)
        if self.row is None or bool(np.all(count == 1)):
            return values
        total = np.zeros(len(count))
        filled = count > 0
        if filled.any():
            total[filled] = np.add.reduceat(values, self.first[:-1][filled])
        return np.round(total, _DIGITS)

    def reaching(self, beam: IndexArray, range_m: FloatArray, row_end_m: FloatArray) -> FloatArray:
        """The part of those beams' light that gets as far as `range_m`, (m,), to a billionth.

        `row_end_m` (n_rows,): how far each row reaches.
        """
        if self.row is None:
            share = np.where(row_end_m[beam] > range_m, self.share[beam], 0.0)
            return np.round(share, _DIGITS).astype(np.float64)
        count = np.diff(self.first)[beam]
        row = spread(self.first[beam], count)
        place = np.repeat(np.arange(len(beam)), count)
        share = np.where(row_end_m[row] > range_m[place], self.share[row], 0.0)
        return np.round(np.bincount(place, weights=share, minlength=len(beam)), _DIGITS).astype(np.float64)


def spread(begin: IndexArray, count: IndexArray) -> IndexArray:
    """The whole numbers `begin[i]` ... `begin[i] + count[i] - 1`, one stretch behind the other."""
    end = np.cumsum(count)
    return np.arange(int(count.sum())) + np.repeat(begin - end + count, count)


def by_material(
    ideal: IdealScan, materials: Mapping[int, Material], value: Callable[[Material], float], missing: float
) -> FloatArray:
    """`value` of each row's material, `missing` where a row meets nothing or a material without an entry; (n,)."""
    # One look-up by number instead of a sort: rows are many, materials few.
    known = {number: value(material) for number, material in materials.items() if -(2**31) <= number < 2**31}
    if not known or len(ideal) == 0:
        return np.full(len(ideal), missing)
    low, high = min(known), max(known)
    if high - low > 1_000_000:
        ids, place = np.unique(ideal.material_id, return_inverse=True)
        values = np.array([known.get(int(number), missing) for number in ids])[place]
    else:
        # Its first and its last entry stand for all numbers beyond.
        table = np.full(high - low + 3, missing)
        for number, at in known.items():
            table[number - low + 1] = at
        values = table.take(ideal.material_id.astype(np.int64) - (low - 1), mode="clip")
    return np.where(ideal.distance_m > 0.0, values, missing)


@functools.lru_cache(maxsize=1)
def _one_each(beams: int) -> IndexArray:
    """`first` of beams of one row each; kept, since frames are alike."""
    first = np.arange(beams + 1)
    first.flags.writeable = False
    return first
