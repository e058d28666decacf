"""The fast path of a frame in haze: histories by background and by the part of the haze that a beam sees."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model import streams
from lidarcheck.model.detection import by_threshold, chain_echoes
from lidarcheck.model.detector_echoes import fixed
from lidarcheck.model.exact.abreast import MOST_BINS, MOST_DETECTORS
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.haze_rates import HazeRates, weight_of
from lidarcheck.model.exact.listing import scan_of
from lidarcheck.model.exact.numbers import Numbers, numbers_of
from lidarcheck.model.exact.pulse_form import form_of
from lidarcheck.model.exact.pulses import Pulses, pulses_of
from lidarcheck.model.fast.alarms import Alarms
from lidarcheck.model.fast.beams import Task
from lidarcheck.model.fast.draw import TABLE, alarm_rate_of, ask, beam_key, level_of, step_of
from lidarcheck.model.fast.grid import level_value
from lidarcheck.model.fast.histories import HISTORIES, LEAST, Histories, histories_of
from lidarcheck.model.fast.join import CHUNK, join_beams, new_work
from lidarcheck.model.fast.set_off import can_count, law_of
from lidarcheck.model.fast.shelf import Shelf
from lidarcheck.model.fast.tables import Levels
from lidarcheck.model.sharing import share
from lidarcheck.model.streams import philox, unit
from lidarcheck.scan import Light, Scan, light_of_beams
from lidarcheck.sensor import SpadArray

__all__ = ["can_join", "hazy_echoes", "is_hazy"]

_MORE_LOST = 1e3
"""So many times the light that the exact chain cuts off pulses may be cut off, without tails that come late."""
_EXACT = -1
"""Whose histories beams draw that go through the exact chain."""
_LOWEST, _HIGHEST, _BITS = -4, 4, 3
"""Powers of two between which parts of the haze have histories, and levels between one and the next, as a power."""
_SAME = 1e-9
"""Of a step between levels: shares of sub-beams do not add up to 1 to the last bit."""


def is_hazy(light: Light) -> bool:
    """Whether the air sends any light back."""
    haze = light.haze
    return haze is not None and bool(np.any(haze.density_per_m > 0.0) and np.any(haze.row_share > 0.0))


def can_join(sensor: SpadArray) -> bool:
    """Whether histories can be drawn for the sensor, and windows behind them."""
    numbers = numbers_of(sensor)
    return can_count(sensor) and numbers.detectors <= MOST_DETECTORS and numbers.bins <= MOST_BINS


def hazy_echoes(light: Light, sensor: SpadArray, shelf: Shelf, task: Task) -> Scan | None:
    """The echoes of light with haze; None where the exact chain must run for the whole frame."""
    numbers, among = numbers_of(sensor), functools.partial(share, threads=task.threads)
    pulses = pulses_of(light, sensor, numbers, among)
    if len(pulses.haze.share) == 0:
        return None
    parts = _parts_of(light, pulses.haze)
    chosen, rate = _choose_all(light, pulses.haze, parts, shelf, task)
    law, echoes = law_of(sensor, numbers), new_echoes(len(light), sensor.max_echoes)
    columns: tuple[Any, ...] = (
        streams.new_stream(task.seed, "fast haze", task.frame),
        streams.beam_keys(light.layer, light.point),
        fixed(light.background_per_ns * sensor.bin_ns),
        rate,
        pulses,
        _nearer(light, sensor, pulses),
    )
    chunks: list[tuple[Numbers, Histories, Alarms, IndexArray]] = []
    for threshold, beams in by_threshold(sensor, light, np.argsort(chosen, kind="stable"), task.seed, task.frame):
        edges = np.searchsorted(chosen[beams], np.arange(len(shelf.libraries) * parts.many + 1))
        seen = numbers._replace(threshold=threshold)
        for number in np.flatnonzero(np.diff(edges)):
            rows, (k, part) = beams[edges[number] : edges[number + 1]], divmod(int(number), parts.many)
            library, weight = shelf.libraries[k], level_value(_LOWEST, part + parts.first, _BITS)
            per_bin, draws = shelf.background(k) * sensor.bin_ns, shelf.number(k) << 16 | part + parts.first
            histories = histories_of(seen, law, pulses.haze, weight, per_bin, parts.size, draws, among)
            if histories is None or library is None:
                chosen[rows] = _EXACT
            else:
                chunks += [
                    (seen, histories, library.alarms, rows[at : at + CHUNK]) for at in range(0, len(rows), CHUNK)
                ]
    idle: list[Any] = []

    def run(chunk: int) -> None:
        seen, histories, alarms, rows = chunks[chunk]
        try:
            work = idle.pop()
        except IndexError:
            work = new_work(numbers)
        arguments: tuple[Any, ...] = (seen, law, histories, alarms, task.key, *columns, rows, work, echoes)
        join_beams(*arguments)
        idle.append(work)

    share(run, range(len(chunks)), task.threads)
    _run_exactly(light, sensor, chosen == _EXACT, task, echoes)
    return scan_of(echoes, light, sensor, task.rounded, among)


def _nearer(light: Light, sensor: SpadArray, pulses: Pulses) -> IndexArray:
    """What a reach of the exact chain may be cut to [bins]."""
    form = form_of(light.shape, sensor, sensor.bin_ns)
    reach = np.arange(int(max(pulses.reach.max(initial=0), pulses.reach_behind.max(initial=0), pulses.haze.behind)) + 1)
    less = 2.0 * form.sigma**2 * float(elementary.log(_MORE_LOST)) if form.tail_share == 0.0 else 0.0
    return np.asarray(np.ceil(np.sqrt(np.maximum(reach**2 - less, 0.0))), dtype=np.int64)


def _run_exactly(
    light: Light, sensor: SpadArray, chosen: npt.NDArray[np.bool_], task: Task, echoes: EchoArrays
) -> None:
    """Put the echoes of the chosen beams in their rows, by the exact chain."""
    rows = np.flatnonzero(chosen)
    if not len(rows):
        return
    some = light_of_beams(light, chosen)
    found = chain_echoes(some, sensor, seed=task.seed, frame=task.frame, threads=task.threads)
    columns: list[npt.NDArray[Any]] = list(echoes)
    for column, values in zip(columns, found, strict=True):
        column[rows] = values


class _Parts(NamedTuple):
    """The part of the haze that each beam sees, `weight` (n_beams,), and its levels: `first` and how `many` up to the
    last; `size`: how many histories there are of each."""

    weight: FloatArray
    first: int
    many: int
    size: int


def _parts_of(light: Light, haze: HazeRates) -> _Parts:
    weight, there = np.empty(len(light)), np.zeros(((_HIGHEST - _LOWEST) << _BITS) + 2, dtype=np.bool_)
    _weigh(haze, weight, there)
    levels = np.flatnonzero(there)
    if len(levels) == 0:
        return _Parts(weight, 0, 1, LEAST)
    size = max(HISTORIES // max(len(levels) - 1, 1), LEAST) // LEAST * LEAST
    return _Parts(weight, int(levels[0]), int(levels[-1] - levels[0]) + 1, size)


def _choose_all(
    light: Light, haze: HazeRates, parts: _Parts, shelf: Shelf, task: Task
) -> tuple[IndexArray, FloatArray]:
    """Whose histories each beam draws, by background and part of the haze, `_EXACT` where none will do; and the clumps
    a bin that background makes by itself."""
    chosen, rate = np.empty(len(light), dtype=np.int64), np.empty(len(light))
    while True:
        levels, wanted = shelf.levels(), shelf.asked()
        columns: tuple[Any, ...] = (light.layer, light.point, light.background_per_ns, parts.weight)
        arguments: tuple[Any, ...] = (levels, task.key, *columns, parts.first, parts.many, chosen, rate, wanted)
        _choose(*arguments)
        if not wanted.any():
            return chosen, rate
        shelf.fill(wanted, task.threads)


@inlined
def _is_fair(weight: float) -> bool:
    """Whether there are histories of that part of the haze."""
    return weight == 0.0 or (weight >= 2.0**_LOWEST and weight < 2.0**_HIGHEST)


@kernel
def _weigh(haze: HazeRates, weight: FloatArray, there: npt.NDArray[np.bool_]) -> None:
    """The part of the haze that each beam sees, its rows together, and the levels on either side."""
    for row in range(len(weight)):
        weight[row] = weight_of(haze, np.uint64(row))
        if _is_fair(weight[row]):
            level, above = step_of(weight[row], _LOWEST, _BITS)
            there[level] = there[level] or above < 1.0 - _SAME
            there[level + 1] = there[level + 1] or above > _SAME


@inlined
def _nearest(level: Any, above: float, word: Any) -> Any:
    """A level or the next, by nearness."""
    return level + (1 if above > _SAME and (above > 1.0 - _SAME or unit(word) < above) else 0)


@kernel
def _choose(
    levels: Levels,
    key: tuple[Any, Any, Any],
    layer: npt.NDArray[np.int32],
    point: npt.NDArray[np.int32],
    background: FloatArray,
    weight: FloatArray,
    first: int,
    many: int,
    chosen: IndexArray,
    rate: FloatArray,
    wanted: npt.NDArray[np.bool_],
) -> None:
    """The level of each beam and its part of the haze, drawn by nearness to the two on either side."""
    for row in range(len(layer)):
        i = np.uint64(row)
        around, seen = 0.0 if levels.single else background[i], weight[i]
        level, above = level_of(levels, around)
        rate[i] = alarm_rate_of(levels, level, above)
        ready = levels.ready[level, 1 if above > 0.0 else 0]
        if ready == TABLE:
            ask(levels, level, above, wanted)
        part, over = step_of(seen, _LOWEST, _BITS)
        fair = ready == 0 and _is_fair(seen)
        if fair and (above > 0.0 or over > 0.0):
            word, _, other, _ = philox(key[0], key[1], 0, beam_key(layer[i], point[i]), key[2], 0)
            level += 1 if unit(other) < above else 0
            part = _nearest(part, over, word)
        chosen[i] = level * many + part - first if fair else _EXACT
