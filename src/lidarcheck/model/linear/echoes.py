"""From light to the echoes of a linear detector, chunk by chunk, on several threads."""

from __future__ import annotations

import numpy as np

from lidarcheck.model import streams
from lidarcheck.model.detector_echoes import (
    DetectorEchoes,
    echoes_from,
    gate_of,
    joined,
    new_candidates,
    new_rows,
)
from lidarcheck.model.linear.kernel import Surfaces, detect, new_draws
from lidarcheck.model.linear.numbers import linear_light, linear_numbers
from lidarcheck.model.many_trials import INVERSES, poisson_numbers
from lidarcheck.model.sharing import Progress, share
from lidarcheck.scan import Light
from lidarcheck.sensor import Linear
from lidarcheck.sensor.laws import EchoNumbers

__all__ = ["linear_echoes"]

_CHUNK = 8192
"""Beams a thread takes at a time."""


def linear_echoes(
    light: Light,
    sensor: Linear,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    rounded: bool = True,
) -> DetectorEchoes:
    """The echoes of a linear detector, its draws keyed by seed, frame and beam.

    `light.background_per_ns` is, of this detector, the variance that light from elsewhere adds to the amplitude, in the
    square of its unit: the sensor's own noise is not in it. `rounded`: ranges as they are reported, else before the
    sensor's constant error and its step; what they will be decides in both cases what lies in the gate.
    """
    n = len(light)
    numbers, gate = linear_numbers(sensor, light), gate_of(sensor, rounded)
    seen, stream = linear_light(light, sensor), streams.new_stream(seed, "linear", frame)
    room = _most(light) + 2
    starts = range(0, n, _CHUNK)
    # Light from elsewhere is counted as well: a Poisson number a shot, whose mean is its variance.
    background = np.empty(n if any(feature.law == "background" for feature in sensor.features) else 0)
    background_key = streams.new_stream(seed, "linear background", frame).key
    parts, held = [new_rows(0)] * len(starts), [0] * len(starts)

    def run(start: int) -> None:
        stop = min(start + _CHUNK, n)
        rows = new_rows((stop - start) * min(room, sensor.max_echoes))
        surfaces = Surfaces(np.empty(room), np.empty(room), np.empty(room, dtype=np.int64))
        found = new_candidates(room)
        found_rows = detect(numbers, gate, seen, stream, start, stop, new_draws(), surfaces, found, rows)
        parts[start // _CHUNK], held[start // _CHUNK] = rows, found_rows
        if len(background) > 0:
            some = slice(start, stop)
            mean, beams = numbers.noise2 + seen.ambient[some], seen.beams[some]
            poisson_numbers(mean, background_key, stream.counter[2], beams, INVERSES, background[some])

    share(run, starts, threads, lambda done: progress and progress(min(done * _CHUNK, n), n))
    rows = joined(parts, held)
    about = EchoNumbers(
        rows.amplitude,
        rows.range_m - seen.offset[rows.beam],
        background=background[rows.beam] if len(background) > 0 else None,
        longer_ns=rows.more if numbers.recovery_ns > 0.0 else None,
        fwhm_ns=None if light.shape is None else light.shape.fwhm_ns,
    )
    return echoes_from(rows, about, sensor)


def _most(light: Light) -> int:
    """The most surfaces that a beam may have, the air's among them."""
    pulses = int(np.diff(light.first_pulse).max(initial=0))
    return pulses + (0 if light.haze is None else int(np.diff(light.haze.first_row).max(initial=0)))
