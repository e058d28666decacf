"""Rows of a beam in order of what they meet, in compiled code."""

from __future__ import annotations

from typing import Any

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel

__all__ = ["sort_in_beams"]


@inlined
def _before(i: int, j: int, key: FloatArray, then: FloatArray) -> Any:
    if key[i] != key[j]:
        return key[i] < key[j]
    return then[i] < then[j] or (then[i] == then[j] and i < j)


@kernel
def sort_in_beams(first: IndexArray, key: FloatArray, then: FloatArray, order: IndexArray) -> None:
    """Sort each beam's rows `order[first[b]:first[b + 1]]` by two keys, (rows,) each, then by row.

    Shell's method: most beams have few rows, which come nearly in order, but a histogram's zone may have thousands.
    """
    for beam in range(len(first) - 1):
        low, high = first[beam], first[beam + 1]
        gap = 1
        while gap < (high - low) // 3:
            gap = 3 * gap + 1
        while gap > 0:
            for place in range(low + gap, high):
                row, at = order[place], place
                while at >= low + gap and _before(row, order[at - gap], key, then):
                    order[at] = order[at - gap]
                    at -= gap
                order[at] = row
            gap //= 3
