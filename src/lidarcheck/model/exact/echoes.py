"""Echoes: what stands out of a trace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.numbers import Numbers

__all__ = ["EchoArrays", "add_echoes", "find_echoes", "keep", "new_echoes"]


class EchoArrays(NamedTuple):
    """Echoes of each beam: `held` (n,), how many; per echo (n, max_echoes) centre [bins], width, area, peak."""

    held: npt.NDArray[np.int32]
    centre: FloatArray
    width: npt.NDArray[np.int32]
    area: npt.NDArray[np.int32]
    peak: npt.NDArray[np.int32]


def new_echoes(beams: int, room: int) -> EchoArrays:
    """Room for the echoes of that many beams, and of two at least, none held yet."""
    # A single row is of C's order as well: numba would take it for another type, and compile every kernel once more.
    beams = max(beams, 2)
    # First echoes stand together: memory for second and third ones, which are rare, is hardly touched.
    return EchoArrays(
        held=np.zeros(beams, dtype=np.int32),
        centre=np.empty((beams, room), order="F"),
        width=np.empty((beams, room), dtype=np.int32, order="F"),
        area=np.empty((beams, room), dtype=np.int32, order="F"),
        peak=np.empty((beams, room), dtype=np.int32, order="F"),
    )


@kernel
def keep(echoes: EchoArrays, beam: int, centre: float, width: int, area: int, peak: int) -> None:
    """Add an echo, later than those kept so far; where there is no room, the one of smallest area goes."""
    room = echoes.area.shape[1]
    held = echoes.held[beam]
    if held == room:
        smallest = 0
        for j in range(1, room):
            if echoes.area[beam, j] <= echoes.area[beam, smallest]:
                smallest = j
        if area <= echoes.area[beam, smallest]:
            return
        for j in range(smallest, room - 1):
            echoes.centre[beam, j] = echoes.centre[beam, j + 1]
            echoes.width[beam, j] = echoes.width[beam, j + 1]
            echoes.area[beam, j] = echoes.area[beam, j + 1]
            echoes.peak[beam, j] = echoes.peak[beam, j + 1]
        held -= 1
    echoes.centre[beam, held] = centre
    echoes.width[beam, held] = width
    echoes.area[beam, held] = area
    echoes.peak[beam, held] = peak
    echoes.held[beam] = held + 1


@inlined
def add_echoes(numbers: Numbers, counts: IndexArray, begin: int, end: int, beam: int, echoes: EchoArrays) -> int:
    """The same beside those of earlier bins, which are kept."""
    on = 0
    for k in range(begin - numbers.on + 1, begin):
        on += counts[numbers.pad + k]
    bins = end - begin
    first = np.uint64(numbers.pad + begin)
    leaving = np.uint64(numbers.pad + begin - numbers.on + 1)
    width = area = peak = moment = 0
    last = on
    for j in range(np.uint64(bins)):
        on += counts[first + j]
        last = on
        if on > numbers.threshold:
            width += 1
            area += on
            moment += on * np.int64(j)
            peak = max(peak, on)
        if width > 0 and (on <= numbers.threshold or np.int64(j) == bins - 1):
            keep(echoes, beam, begin + 0.5 + moment / area, width, area, peak)
            width = area = peak = moment = 0
        on -= counts[leaving + j]
    return last


@inlined
def find_echoes(numbers: Numbers, counts: IndexArray, begin: int, end: int, beam: int, echoes: EchoArrays) -> int:
    """The beam's echoes, those of the bins `begin` ... `end - 1`: maximal runs with more than `threshold` detectors ON.

    Returns the detectors ON in the last bin, or still ON in bin `begin` where there is none.
    """
    echoes.held[beam] = 0
    return add_echoes(numbers, counts, begin, end, beam, echoes)
