"""From light to each beam's echoes: the exact chain, compiled, detector by detector, or on a GPU."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.model import streams
from lidarcheck.model.exact import kernel
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.numbers import Numbers, numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.fidelity import Device
from lidarcheck.model.sharing import Progress, share
from lidarcheck.model.way import Spaces, Way
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["by_threshold", "chain_echoes"]

_CHUNK = 8192
"""Beams a thread takes at a time: small enough to share the work evenly, large enough to forget the taking."""


def chain_echoes(
    light: Light,
    sensor: SpadArray,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    device: Device = "cpu",
) -> EchoArrays:
    """The echoes of each beam as the exact chain finds them, before they are put into a table."""
    n, among = len(light), functools.partial(share, threads=threads)
    numbers = numbers_of(sensor)
    room = new_echoes(n, sensor.max_echoes)
    echoes = EchoArrays._make(column[:n] for column in room)
    beams = streams.beam_keys(light.layer, light.point)
    per_bin = light.background_per_ns * sensor.bin_ns
    pulses = pulses_of(light, sensor, numbers, among)
    one_background = n == 0 or per_bin.min() == per_bin.max()
    order = np.arange(n) if one_background else np.argsort(per_bin, kind="stable")
    if device == "cuda":
        _refuse_disturbed(sensor)
        from lidarcheck.model.cuda.simulate import simulate_on_cuda

        simulate_on_cuda(numbers, streams.new_stream(seed, "spads", frame), beams, per_bin, pulses, order, room)
        return echoes

    spaces = Spaces(*_ways(sensor, numbers, light))
    parts = by_threshold(sensor, light, order, seed, frame)
    chunks = [(threshold, rows[at : at + _CHUNK]) for threshold, rows in parts for at in range(0, len(rows), _CHUNK)]
    beams_done = np.cumsum([len(rows) for _, rows in chunks])

    def run(chunk: int) -> None:
        threshold, rows = chunks[chunk]
        stream = streams.new_stream(seed, "spads", frame)
        spaces.simulate(numbers._replace(threshold=threshold), stream, beams, per_bin, pulses, rows, room)

    share(run, range(len(chunks)), threads, lambda done: progress and progress(int(beams_done[done - 1]), n))
    return echoes


def by_threshold(
    sensor: SpadArray, light: Light, order: npt.NDArray[np.int64], seed: int, frame: int
) -> list[tuple[int, npt.NDArray[np.int64]]]:
    """Each threshold, and the beams of `order` that have it."""
    if sensor.nonideal.threshold_dither <= 0.0:
        return [(sensor.threshold, order)]
    drawn = streams.uniforms(seed, "threshold", frame, light.layer, light.point)[order, 0]
    higher = drawn < sensor.nonideal.threshold_dither
    return [(sensor.threshold, order[~higher]), (sensor.threshold + 1, order[higher])]


def _refuse_disturbed(sensor: SpadArray) -> None:
    if sensor.nonideal.any:
        what = "crosstalk, afterpulsing and a dead time that varies are followed detector by detector, not on a GPU"
        raise UsageError(what, fix="use the device cpu")
    if sensor.nonideal.threshold_dither > 0.0:
        raise UsageError("a threshold between two whole numbers is not simulated on a GPU", fix="use the device cpu")


def _ways(sensor: SpadArray, numbers: Numbers, light: Light) -> list[Way]:
    """SPADs that disturb each other or themselves are counted where one thing alone does so, else followed singly."""
    if not sensor.nonideal.any:
        return [Way((), kernel.new_scratch, kernel.simulate_beams)]
    from lidarcheck.model.afterpulses import simulate as afterpulses
    from lidarcheck.model.clusters import simulate as clusters
    from lidarcheck.model.detectors import simulate as one_by_one

    counted = [way for way in (afterpulses.way(sensor, numbers, light), clusters.way(sensor, numbers, light)) if way]
    return [*counted, one_by_one.way(sensor, numbers)]
