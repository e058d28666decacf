"""Filling the library: the exact chain, run for every sample of a block."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model import kernel, streams
from lidarcheck.model.echoes import Echoes, new_echoes
from lidarcheck.model.fast.grid import Grid, Span, node_signals
from lidarcheck.model.fast.words import pack
from lidarcheck.model.numbers import Numbers, numbers_of
from lidarcheck.model.pulses import Pulses, pulses_of
from lidarcheck.model.share import share
from lidarcheck.scan import Light, PulseShape
from lidarcheck.sensor import Sensor

__all__ = ["Block", "Source", "fill_block"]

FloatArray = npt.NDArray[np.float64]

_SEED = 0
"""The library is the same for every user: what differs from run to run is which sample a beam draws."""
_CHUNK = 8192


class Source(NamedTuple):
    """What a library is of: the sensor behind its detector effects, the laser's pulse, the background, the nodes."""

    sensor: Sensor
    shape: PulseShape | None
    background_per_ns: float
    grid: Grid


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
    """Run the exact chain on all samples of a block; the same on every machine."""
    sensor = source.sensor
    numbers = numbers_of(sensor)._replace(bins=span.length)
    nodes, phases, samples = source.grid.shape
    signal = np.repeat(node_signals(numbers, source.grid, block), phases * samples)
    centre = np.tile(np.repeat(np.arange(phases) / phases, samples), nodes) + span.before
    n = len(signal)
    beams = np.uint64(block) << np.uint64(40) | np.arange(n, dtype=np.uint64)
    per_bin = np.full(n, source.background_per_ns * sensor.bin_ns)
    pulses = _pulses(source, numbers, centre, signal)
    echoes = new_echoes(n, sensor.max_echoes)
    order = np.arange(n)

    def run(start: int) -> None:
        stream = streams.new_stream(_SEED, "fast library")
        part = order[start : start + _CHUNK]
        kernel.simulate_beams(numbers, stream, beams, per_bin, pulses, part, kernel.new_scratch(numbers), echoes)

    share(run, range(0, n, _CHUNK), threads)
    return _packed(echoes, centre)


def _pulses(source: Source, numbers: Numbers, centre: FloatArray, signal: FloatArray) -> Pulses:
    n = len(signal)
    beam, zeros = np.zeros(n, dtype=np.int32), np.zeros(n)
    light = Light(beam, beam, zeros, np.arange(n + 1), zeros, signal, shape=source.shape)
    return pulses_of(light, source.sensor, numbers)._replace(centre=centre)


def _packed(echoes: Echoes, centre: FloatArray) -> Block:
    words, many = pack(echoes, centre)
    away = echoes.centre[many] - centre[many, None]
    return Block(words, echoes.held[many], away, echoes.width[many], echoes.area[many], echoes.peak[many])
