"""From light to each beam's echoes: the exact chain, compiled, detector by detector, or on a GPU."""

from __future__ import annotations

import functools
from collections.abc import Callable

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
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["chain_echoes"]

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
    echoes = new_echoes(n, sensor.max_echoes)
    beams = streams.beam_keys(light.layer, light.point)
    per_bin = light.background_per_ns * sensor.bin_ns
    pulses = pulses_of(light, sensor, numbers, among)
    one_background = n == 0 or per_bin.min() == per_bin.max()
    order = np.arange(n) if one_background else np.argsort(per_bin, kind="stable")
    if device == "cuda":
        _refuse_disturbed(sensor)
        from lidarcheck.model.cuda.simulate import simulate_on_cuda

        simulate_on_cuda(numbers, streams.new_stream(seed, "spads", frame), beams, per_bin, pulses, order, echoes)
        return echoes

    follow = _follower(sensor, numbers, light) if sensor.nonideal.any else None
    chunks = _chunks(sensor, light, order, seed, frame)
    beams_done = np.cumsum([len(rows) for _, rows in chunks])
    idle: dict[int, list[kernel.Scratch]] = {threshold: [] for threshold, _ in chunks}

    def run(chunk: int) -> None:
        threshold, rows = chunks[chunk]
        asked, stream = numbers._replace(threshold=threshold), streams.new_stream(seed, "spads", frame)
        if follow is not None:
            follow(asked, stream, beams, per_bin, pulses, rows, echoes)
            return
        try:
            scratch = idle[threshold].pop()
        except IndexError:
            scratch = kernel.new_scratch(asked)
        kernel.simulate_beams(asked, stream, beams, per_bin, pulses, rows, scratch, echoes)
        idle[threshold].append(scratch)

    share(run, range(len(chunks)), threads, lambda done: progress and progress(int(beams_done[done - 1]), n))
    return echoes


def _chunks(
    sensor: SpadArray, light: Light, order: npt.NDArray[np.int64], seed: int, frame: int
) -> list[tuple[int, npt.NDArray[np.int64]]]:
    """What threads take at a time: a threshold and beams of `order` that have it."""
    parts = [(sensor.threshold, order)]
    if sensor.nonideal.threshold_dither > 0.0:
        drawn = streams.uniforms(seed, "threshold", frame, light.layer, light.point)[order, 0]
        higher = drawn < sensor.nonideal.threshold_dither
        parts = [(sensor.threshold, order[~higher]), (sensor.threshold + 1, order[higher])]
    return [(threshold, rows[at : at + _CHUNK]) for threshold, rows in parts for at in range(0, len(rows), _CHUNK)]


def _refuse_disturbed(sensor: SpadArray) -> None:
    if sensor.nonideal.any:
        what = "crosstalk, afterpulsing and a dead time that varies are followed detector by detector, not on a GPU"
        raise UsageError(what, fix="use the device cpu")
    if sensor.nonideal.threshold_dither > 0.0:
        raise UsageError("a threshold between two whole numbers is not simulated on a GPU", fix="use the device cpu")


def _follower(sensor: SpadArray, numbers: Numbers, light: Light) -> Callable[..., None]:
    """`simulate_chunk` for SPADs that disturb each other or themselves: counted where one thing alone does so, else
    one by one."""
    from lidarcheck.model.afterpulses import law as afterpulses
    from lidarcheck.model.afterpulses.simulate import simulate_chunk as with_afterpulses
    from lidarcheck.model.clusters import law as clusters
    from lidarcheck.model.clusters.simulate import simulate_chunk as with_clusters
    from lidarcheck.model.detectors import simulate as detectors
    from lidarcheck.model.detectors.array import detectors_of

    one_by_one = functools.partial(detectors.simulate_chunk, detectors_of(sensor, numbers))
    if afterpulses.can_count(sensor, numbers, light):
        return functools.partial(with_afterpulses, afterpulses.law_of(sensor, numbers), one_by_one, {})
    if clusters.can_count(sensor, numbers, light):
        return functools.partial(with_clusters, clusters.law_of(sensor, numbers), one_by_one, {})
    return one_by_one
