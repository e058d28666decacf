"""The fast path of a frame in haze: histories where beams are alike, the exact chain for others."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model import streams
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.detector_echoes import fixed
from lidarcheck.model.exact.abreast import MOST_BINS, MOST_DETECTORS
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.haze_rates import HazeRates
from lidarcheck.model.exact.listing import scan_of
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulse_form import form_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.fast.beams import Task
from lidarcheck.model.fast.draw import TABLE, alarm_rate_of, ask, beam_key, level_of
from lidarcheck.model.fast.histories import histories_of
from lidarcheck.model.fast.join import join_beams, new_work
from lidarcheck.model.fast.shelf import Shelf
from lidarcheck.model.fast.tables import Levels
from lidarcheck.model.sharing import share
from lidarcheck.model.streams import philox, unit
from lidarcheck.scan import Light, Scan, light_of_beams
from lidarcheck.sensor import NonIdeal, SpadArray

__all__ = ["can_join", "hazy_echoes", "is_hazy"]

_CHUNK = 8192
_MORE_LOST = 1e3
"""So many times the light that the exact chain cuts off pulses may be cut off, without tails that come late."""
_EXACT = 255
"""The level of beams that go through the exact chain."""


def is_hazy(light: Light) -> bool:
    """Whether the air sends any light back."""
    haze = light.haze
    return haze is not None and bool(np.any(haze.density_per_m > 0.0) and np.any(haze.row_share > 0.0))


def can_join(sensor: SpadArray) -> bool:
    """Whether histories can be drawn for the sensor, and windows behind them."""
    numbers = numbers_of(sensor)
    return sensor.nonideal == NonIdeal() and numbers.detectors <= MOST_DETECTORS and numbers.bins <= MOST_BINS


def hazy_echoes(light: Light, sensor: SpadArray, shelf: Shelf, task: Task) -> Scan | None:
    """The echoes of light with haze; None where the exact chain must run for the whole frame."""
    numbers, among = numbers_of(sensor), functools.partial(share, threads=task.threads)
    pulses = pulses_of(light, sensor, numbers, among)
    if len(pulses.haze.share) == 0:
        return None
    weight = float(np.partition(pulses.haze.share, len(pulses.haze.share) // 2)[len(pulses.haze.share) // 2])
    level, rate = _levels_of(light, pulses.haze, weight, shelf, task)
    echoes = new_echoes(len(light), sensor.max_echoes)
    beams = streams.beam_keys(light.layer, light.point)
    per_bin = fixed(light.background_per_ns * sensor.bin_ns)
    order = np.argsort(level, kind="stable")
    edges = np.searchsorted(level[order], np.arange(len(shelf.libraries) + 1))
    form = form_of(light.shape, sensor, sensor.bin_ns)
    reach = np.arange(int(max(pulses.reach.max(initial=0), pulses.reach_behind.max(initial=0), pulses.haze.behind)) + 1)
    less = 2.0 * form.sigma**2 * float(elementary.log(_MORE_LOST)) if form.tail_share == 0.0 else 0.0
    nearer = np.ceil(np.sqrt(np.maximum(reach**2 - less, 0.0))).astype(np.int64)
    idle: list[Any] = []
    for k, library in enumerate(shelf.libraries):
        rows = order[edges[k] : edges[k + 1]]
        if library is None or len(rows) == 0:
            continue
        histories = histories_of(
            numbers, pulses.haze, weight, shelf.background(k) * sensor.bin_ns, shelf.number(k), among
        )
        if histories is None:
            level[rows] = _EXACT
            continue
        what: tuple[Any, ...] = (numbers, histories, library.alarms, task.key)

        def run(start: int, rows: IndexArray = rows, what: tuple[Any, ...] = what) -> None:
            try:
                work = idle.pop()
            except IndexError:
                work = new_work(numbers)
            stream = streams.new_stream(task.seed, "fast haze", task.frame)
            columns: tuple[Any, ...] = (stream, beams, per_bin, rate, pulses, nearer, rows)
            arguments: tuple[Any, ...] = (*what, *columns, start, min(start + _CHUNK, len(rows)), work, echoes)
            join_beams(*arguments)
            idle.append(work)

        share(run, range(0, len(rows), _CHUNK), task.threads)
    _run_exactly(light, sensor, level == _EXACT, task, echoes)
    return scan_of(echoes, light, sensor, task.rounded, among)


def _run_exactly(
    light: Light, sensor: SpadArray, chosen: npt.NDArray[np.bool_], task: Task, echoes: EchoArrays
) -> None:
    """Put the echoes of the chosen beams in their rows, by the exact chain."""
    if not chosen.any():
        return
    some = light_of_beams(light, chosen)
    found = chain_echoes(some, sensor, seed=task.seed, frame=task.frame, threads=task.threads)
    columns: list[npt.NDArray[Any]] = list(echoes)
    for column, values in zip(columns, found, strict=True):
        column[chosen] = values


def _levels_of(
    light: Light, haze: HazeRates, weight: float, shelf: Shelf, task: Task
) -> tuple[npt.NDArray[np.uint8], FloatArray]:
    """The level that each beam draws, `_EXACT` for beams that are not like the others; clumps of background a bin."""
    level, rate = np.empty(len(light), dtype=np.uint8), np.empty(len(light))
    while True:
        levels, wanted = shelf.levels(), shelf.asked()
        columns: tuple[Any, ...] = (light.layer, light.point, light.background_per_ns, haze, weight)
        arguments: tuple[Any, ...] = (levels, task.key, *columns, level, rate, wanted)
        _choose(*arguments)
        if not wanted.any():
            return level, rate
        shelf.fill(wanted, task.threads)


@kernel
def _choose(
    levels: Levels,
    key: tuple[Any, Any, Any],
    layer: npt.NDArray[np.int32],
    point: npt.NDArray[np.int32],
    background: FloatArray,
    haze: HazeRates,
    weight: float,
    chosen: npt.NDArray[np.uint8],
    rate: FloatArray,
    wanted: npt.NDArray[np.bool_],
) -> None:
    """The level of each beam, drawn by nearness to the two on either side of its background."""
    for row in range(len(layer)):
        i = np.uint64(row)
        around = 0.0 if levels.single else background[i]
        level, above = level_of(levels, around)
        rate[i] = alarm_rate_of(levels, level, above)
        one = haze.first[i + np.uint64(1)] - haze.first[i] == 1 and haze.share[haze.first[i]] == weight
        ready = levels.ready[level, 1 if above > 0.0 else 0]
        if ready == TABLE:
            ask(levels, level, above, wanted)
        one = one and ready == 0
        if above > 0.0:
            _, _, word, _ = philox(key[0], key[1], 0, beam_key(layer[i], point[i]), key[2], 0)
            level += 1 if unit(word) < above else 0
        chosen[i] = level if one else _EXACT
