"""Afterpulses that wait for their bin: a binary heap of whole numbers, the earliest on top.

An entry is due bin x 2^20 + detector: one number orders them, and there is nothing to allocate.
"""

from __future__ import annotations

from lidarcheck.arrays import IndexArray
from lidarcheck.jit import inlined, kernel

__all__ = ["MOST_DETECTORS", "due_bin", "pop", "push"]

_SHIFT = 20
MOST_DETECTORS = 1 << _SHIFT
"""More detectors than that do not fit an entry."""


@kernel
def push(heap: IndexArray, size: IndexArray, due: int, detector: int) -> None:
    """Add an afterpulse of a detector in a bin; `size[0]` counts entries, `size[1]` those that found no room."""
    at = size[0]
    if at == len(heap):
        size[1] += 1
        return
    size[0] = at + 1
    entry = (due << _SHIFT) | detector
    while at > 0:
        above = (at - 1) >> 1
        if heap[above] <= entry:
            break
        heap[at] = heap[above]
        at = above
    heap[at] = entry


@inlined
def due_bin(heap: IndexArray) -> int:
    """The bin of the earliest entry; there must be one."""
    return int(heap[0] >> _SHIFT)


@kernel
def pop(heap: IndexArray, size: IndexArray) -> int:
    """Take out the earliest entry, of which there must be one, and return its detector."""
    detector = heap[0] & (MOST_DETECTORS - 1)
    left = size[0] - 1
    size[0] = left
    entry = heap[left]
    at = 0
    while 2 * at + 1 < left:
        below = 2 * at + 1
        if below + 1 < left and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= entry:
            break
        heap[at] = heap[below]
        at = below
    heap[at] = entry
    return int(detector)
