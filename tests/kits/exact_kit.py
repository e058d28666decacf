"""Echoes of the exact chain, side by side in chunks, and of each beam on its own."""

import numpy as np

from lidarcheck.model import streams
from lidarcheck.model.exact import kernel as kernels
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.long_alone import simulate_each
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.lane_math import LANES
from lidarcheck.scan import Light
from lidarcheck.sensor import Sensor


def cleared_echoes(beams: Light, sensor: Sensor) -> EchoArrays:
    """Room for the beams' echoes, all zero, so that what nobody writes compares equal."""
    echoes = new_echoes(len(beams), sensor.max_echoes)
    for column in echoes:
        column[:] = 0
    return echoes


def side_by_side(beams: Light, sensor: Sensor, chunk: int) -> EchoArrays:
    numbers, echoes, scratch = (
        numbers_of(sensor),
        cleared_echoes(beams, sensor),
        kernels.new_scratch(numbers_of(sensor)),
    )
    stream, keys = streams.new_stream(4, "spads", 2), streams.beam_keys(beams.layer, beams.point)
    per_bin, pulses = beams.background_per_ns * sensor.bin_ns, pulses_of(beams, sensor, numbers)
    for start in range(0, len(beams), chunk):
        rows = np.arange(start, min(start + chunk, len(beams)))
        kernels.simulate_beams(numbers, stream, keys, per_bin, pulses, rows, scratch, echoes)
        assert not scratch.counts.any()
        assert not scratch.group.counts[: numbers.dead * LANES].any()
    return echoes


def on_their_own(beams: Light, sensor: Sensor) -> EchoArrays:
    numbers, echoes, scratch = (
        numbers_of(sensor),
        cleared_echoes(beams, sensor),
        kernels.new_scratch(numbers_of(sensor)),
    )
    stream, keys = streams.new_stream(4, "spads", 2), streams.beam_keys(beams.layer, beams.point)
    per_bin, pulses = beams.background_per_ns * sensor.bin_ns, pulses_of(beams, sensor, numbers)
    simulate_each(numbers, stream, keys, per_bin, pulses, np.arange(len(beams)), scratch, echoes)
    assert not scratch.counts.any()
    return echoes
