"""Where the library has its nodes: signal, position of the pulse within a bin, and how many samples each holds.

Signal: `nodes` steps between a power of two and the next, even in S, so that a signal's own bits name its node. Below
the lowest power of two the steps are even from S = 0 on. A block is what is filled and stored at once: one octave.

Background, where beams of a frame differ in it: levels likewise, each with a library of its own; below the lowest power
of two there is one step, down to no background.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulse_form import PulseForm
from lidarcheck.sensor import SpadArray

__all__ = [
    "DEFAULT_GRID",
    "LEVEL_BITS",
    "LEVEL_GRID",
    "LOST_AVALANCHES",
    "Grid",
    "Span",
    "level_below",
    "level_value",
    "lowest_background",
    "lowest_octave",
    "node_signals",
    "octaves",
    "spans",
]

_FAINT = 0.25
"""Primary avalanches of all detectors below which S is faint: steps from there down to no light are even in S."""
_TOP = 20
"""Beyond S = 2^20 beams go through the exact chain."""
_MARGIN = 4
"""Bins of background on either side of the window that a sample sees."""
LEVEL_BITS = 3
"""Levels of background between a power of two and the next, as a power of two."""
_DARK = 0.0625
"""Avalanches of background among the detectors that are ON at a time, below which there is but one step."""
LOST_AVALANCHES = 1e-6
"""Of a beam's avalanches so many do not matter, as in the exact chain."""
_LOST = 0.02
"""Afterpulses of a pulse that come behind its span, on average."""


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
LEVEL_GRID = Grid(sample_bits=7)
"""Of each level: a beam draws from two of them."""


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


def lowest_background(numbers: Numbers, bin_ns: float) -> int:
    """The power of two [avalanches per armed SPAD and ns] below which backgrounds are hardly any."""
    return int(elementary.log2(_DARK / (numbers.detectors * numbers.on * bin_ns)) // 1.0)


def level_value(lowest: int, level: int, bits: int) -> float:
    """What a level is of; `lowest`: the power of two of level 1; `bits`: levels an octave, as a power of two."""
    octave, step = divmod(level - 1, 1 << bits)
    return 0.0 if level == 0 else float(2.0 ** (lowest + octave) * (1.0 + step / (1 << bits)))


def level_below(lowest: int, value: float, bits: int) -> int:
    """The highest level of no more than that value."""
    if value < 2.0**lowest:
        return 0
    fraction, exponent = math.frexp(value)
    return ((exponent - 1 - lowest) << bits) + int((2.0 * fraction - 1.0) * (1 << bits)) + 1


def spans(numbers: Numbers, form: PulseForm, sensor: SpadArray) -> list[Span]:
    """The span of each block: the window that its brightest pulse can matter in, and some background around it."""
    brightest = numbers.detectors * 2.0 ** (np.array(octaves(numbers)) + 1.0)
    found = []
    for reach, reach_behind, light in zip(*form.reach(brightest), brightest, strict=True):
        before = int(reach) + _MARGIN
        after = _afterwards(sensor, min(float(light), float(numbers.detectors)))
        found.append(Span(before, before + int(reach_behind) + 1 + numbers.on + _MARGIN + after))
    return found


def _afterwards(sensor: SpadArray, avalanches: float) -> int:
    """Bins in which so many avalanches have afterpulses; 0 where there are none."""
    real = sensor.nonideal
    if real.afterpulse == 0.0:
        return 0
    pulses = avalanches * real.afterpulse / (1.0 - real.afterpulse)
    ways = (
        (1.0 - real.afterpulse_slow_share, real.afterpulse_ns),
        (real.afterpulse_slow_share, real.afterpulse_slow_ns),
    )
    longest_ns = max(delay_ns * float(elementary.log(max(pulses * share / _LOST, 1.0))) for share, delay_ns in ways)
    return sensor.dead_bins + math.ceil(longest_ns / sensor.bin_ns) if pulses > _LOST else 0
