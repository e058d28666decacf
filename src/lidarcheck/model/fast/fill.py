"""Filling the library: the exact chain, run for every sample of a block."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.fast.grid import Grid, Span, node_signals
from lidarcheck.model.fast.words import pack
from lidarcheck.scan import Light, PulseShape
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["Block", "Source", "fill_block"]


_FIRST_LAYER = 1 << 20
"""Beams that no sensor has: their draws are nobody else's."""
_POINTS = 960
"""How samples are numbered as beams: another number would draw other samples."""
_INSIDE = 1e-9
"""Bins that a pulse stands behind the beginning of its bin, so that rounding cannot put it before."""


class Source(NamedTuple):
    """What a library is of: the sensor behind its detector effects, the laser's pulse, the background, the nodes.

    `seed`: of its samples. They are the same for every user: what differs from run to run is which of them a beam
    draws. Libraries that stand in for each other have different ones, so that together they hold more.
    """

    sensor: SpadArray
    shape: PulseShape | None
    background_per_ns: float
    grid: Grid
    seed: int = 0

    @classmethod
    def of(
        cls, sensor: SpadArray, shape: PulseShape | None, background_per_ns: float, grid: Grid, seed: int = 0
    ) -> Source:
        """Without the numbers of the sensor that its echoes depend on only before or behind the library."""
        plain = replace(sensor, signal_at_1m=0.0, peak_saturation=1, time_offset_ns=0.0, range_resolution_m=0.0)
        return cls(plain, shape, background_per_ns, grid, seed)


class Block(NamedTuple):
    """The samples of one octave: `words` (nodes * phases * samples,) and, for those with several echoes or with
    numbers too large for a word, tables of `held` (m,) and per echo (m, max_echoes)."""

    words: npt.NDArray[np.uint64]
    held: npt.NDArray[np.int32]
    centre: FloatArray
    width: npt.NDArray[np.int32]
    area: npt.NDArray[np.int32]
    peak: npt.NDArray[np.int32]


def fill_block(source: Source, block: int, span: Span, threads: int | None) -> Block:
    """Run the exact chain on all samples of a block, in a trace that is just their span; the same on every machine."""
    nodes, phases, samples = source.grid.shape
    signal = np.repeat(node_signals(numbers_of(source.sensor), source.grid, block), phases * samples)
    centre = np.tile(np.repeat(np.arange(phases) / phases, samples), nodes) + span.before
    bin_m = 0.5 * LIGHT_SPEED_M_PER_NS * source.sensor.bin_ns
    n = len(signal)
    layer, point = np.divmod(np.arange(n), _POINTS)
    light = Light(
        layer=layer + _FIRST_LAYER,
        point=point,
        background_per_ns=np.full(n, source.background_per_ns),
        first_pulse=np.arange(n + 1),
        pulse_range_m=(centre + _INSIDE) * bin_m,
        pulse_signal=signal,
        shape=source.shape,
    )
    # The gate is for the readout: a library knows pulses, not where they are.
    short = replace(source.sensor, min_range_m=0.0, max_range_m=(span.length - 0.5) * bin_m)
    return _packed(chain_echoes(light, short, seed=source.seed, frame=block, threads=threads), centre)


def _packed(echoes: EchoArrays, centre: FloatArray) -> Block:
    words, many = pack(echoes, centre)
    held = echoes.held[many]
    used = np.arange(echoes.centre.shape[1]) < held[:, None]
    away = np.where(used, echoes.centre[many], centre[many, None]) - centre[many, None]
    return Block(words, held, away, *(np.where(used, column[many], 0) for column in echoes[2:]))
