"""Where the library has its nodes: signal, position of the pulse within a bin, and how many samples each holds.

Signal: `nodes` steps between a power of two and the next, even in S, so that a signal's own bits name its node. Below
the lowest power of two the steps are even from S = 0 on. A block is what is filled and stored at once: one octave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulse_form import PulseForm

__all__ = ["DEFAULT_GRID", "Grid", "Span", "lowest_octave", "node_signals", "octaves", "spans"]

_FAINT = 0.25
"""Primary avalanches of all detectors below which S is faint: steps from there down to no light are even in S."""
_TOP = 20
"""Beyond S = 2^20 beams go through the exact chain."""
_MARGIN = 4
"""Bins of background on either side of the window that a sample sees."""


class Grid(NamedTuple):
    """Powers of two: signal steps an octave, positions within a bin, samples of each (signal, position)."""

    signal_bits: int = 6
    phase_bits: int = 4
    sample_bits: int = 9

    @property
    def nodes(self) -> int:
        """Signals of a block: its steps and both ends."""
        return (1 << self.signal_bits) + 1

    @property
    def shape(self) -> tuple[int, int, int]:
        """Signals, positions and samples of a block."""
        return self.nodes, 1 << self.phase_bits, 1 << self.sample_bits


DEFAULT_GRID = Grid()


class Span(NamedTuple):
    """The bins that a block's samples see: `before` whole bins before the pulse's, `length` in all."""

    before: int
    length: int


def lowest_octave(numbers: Numbers) -> int:
    """The power of two below which signals are faint."""
    return int(elementary.log2(_FAINT / numbers.detectors) // 1.0)


def octaves(numbers: Numbers) -> range:
    """Exponents of the blocks; the first block is that of faint signals, below the lowest octave."""
    return range(lowest_octave(numbers) - 1, _TOP)


def node_signals(numbers: Numbers, grid: Grid, block: int) -> FloatArray:
    """S of a block's nodes, shape (nodes,)."""
    steps = np.arange(grid.nodes) / (grid.nodes - 1)
    lowest = lowest_octave(numbers)
    if block == 0:
        return np.asarray(steps * 2.0**lowest)
    return np.asarray((1.0 + steps) * 2.0 ** (lowest + block - 1))


def spans(numbers: Numbers, form: PulseForm) -> list[Span]:
    """The span of each block: the window that its brightest pulse can matter in, and some background around it."""
    brightest = numbers.detectors * 2.0 ** (np.array(octaves(numbers)) + 1.0)
    found = []
    for reach, reach_behind in zip(*form.reach(brightest), strict=True):
        before = int(reach) + _MARGIN
        found.append(Span(before, before + int(reach_behind) + 1 + numbers.on + _MARGIN))
    return found
