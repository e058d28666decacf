"""Rows of a beam in order of what they meet, in compiled code."""

from __future__ import annotations

from typing import Any

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel

__all__ = ["sort_in_beams"]


@inlined
def _before(i: int, j: int, distance_m: FloatArray, signal: FloatArray) -> Any:
    return distance_m[i] < distance_m[j] or (distance_m[i] == distance_m[j] and signal[i] < signal[j])


@kernel
def sort_in_beams(first: IndexArray, distance_m: FloatArray, signal: FloatArray, order: IndexArray) -> None:
    """Sort each beam's rows `order[first[b]:first[b + 1]]` by (distance, signal); equal ones stay in their order.

    One by one into those before: beams have few rows, which come nearly in order.
    """
    for beam in range(len(first) - 1):
        for place in range(first[beam] + 1, first[beam + 1]):
            row, at = order[place], place
            while at > first[beam] and _before(row, order[at - 1], distance_m, signal):
                order[at] = order[at - 1]
                at -= 1
            order[at] = row
