"""The fast path of a frame: draw, resolve what is special, write the table of echoes; all in parallel over beams."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.report import report_of, room_for, scan_of_table
from lidarcheck.model.fast.beams import CHUNK, DrawnBeams, Task, in_order, pick_pulses, signals
from lidarcheck.model.fast.draw import EXACT, draw_beams
from lidarcheck.model.fast.grid import DEFAULT_GRID, LEVEL_GRID
from lidarcheck.model.fast.hazy import can_join, hazy_echoes, is_hazy
from lidarcheck.model.fast.shelf import Shelf, shelf_of
from lidarcheck.model.fast.special import new_found, resolve
from lidarcheck.model.fast.tables import SeveralPulses
from lidarcheck.model.fast.words import CODE_AT, CODE_BITS, SPECIAL
from lidarcheck.model.fast.write import write_echoes
from lidarcheck.model.light import material_tables
from lidarcheck.model.sharing import share
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Light, Scan, light_of_beams
from lidarcheck.sensor import Beams, SpadArray

__all__ = ["fast_echoes", "fast_frame"]

IntArray = npt.NDArray[np.int64]

_CODE = np.uint64((1 << CODE_AT + CODE_BITS) - 1)
_EXACT_WORD = np.uint64(SPECIAL | EXACT << CODE_AT)


def fast_frame(ideal: IdealScan, model: Model, sensor: SpadArray, task: Task) -> Scan | None:
    """The echoes of a frame whose light no effect changes; None where it is no plain frame of the sensor's own beams.

    `sensor`: the model's, behind the detector effects. The range equation, the draw and the table are done chunk by
    chunk, without a `Light` in between.
    """
    tables = material_tables(model)
    if tables is None or ideal.share is not None or len(ideal) == 0:
        return None
    background_per_ns = model.sensor.background_per_ns
    shelf = shelf_of(sensor, None, np.array([background_per_ns]), DEFAULT_GRID, LEVEL_GRID)
    if shelf is None:
        return None
    signal = np.empty(len(ideal))
    beams = DrawnBeams.of(ideal.layer, ideal.point, ideal.distance_m, signal)

    def prepare(start: int, stop: int) -> bool:
        columns = (ideal.distance_m, ideal.incidence_deg, ideal.material_id)
        odd = signals(*columns, *tables, signal, start, stop)
        return odd == 0 and in_order(ideal.layer, ideal.point, ideal.beams.layers, ideal.beams.points, start, stop)

    if not _draw(beams, shelf, task, prepare):
        return None
    light = functools.partial(_light_of_rows, beams, background_per_ns, ideal.beams)
    return _finish(beams, shelf, light, sensor, task, ideal.beams)


def fast_echoes(light: Light, sensor: SpadArray, task: Task) -> Scan | None:
    """The echoes of any light: of beams whose pulses each see bins of their own from libraries, else by the exact
    chain. None where nothing is gained."""
    layer, point, hazy = light.layer, light.point, is_hazy(light)
    if (
        len(light) == 0
        or (hazy and not can_join(sensor))
        or min(layer.min(), point.min()) < 0
        or layer.max() >= light.beams.layers
        or point.max() >= light.beams.points
    ):
        return None
    shelf = shelf_of(sensor, light.shape, light.background_per_ns, DEFAULT_GRID, LEVEL_GRID)
    if shelf is None:
        return None
    if hazy:
        return hazy_echoes(light, sensor, shelf, task)
    beams = _beams_of(light, task)
    _draw(beams, shelf, task)
    return _finish(beams, shelf, functools.partial(_light_of_some, light), sensor, task, light.beams)


def _beams_of(light: Light, task: Task) -> DrawnBeams:
    """The beams of any light; their pulses, where each has just one, are those of the light."""
    n, background = len(light), light.background_per_ns
    if len(light.pulse_signal) == n and np.array_equal(light.first_pulse, np.arange(n + 1)):
        return DrawnBeams.of(light.layer, light.point, light.pulse_range_m, light.pulse_signal, background)
    pulses = SeveralPulses(light.first_pulse, light.pulse_range_m, light.pulse_signal)
    range_m, signal = np.zeros(n), np.zeros(n)

    def pick(start: int) -> None:
        pick_pulses(pulses, start, min(start + CHUNK, n), range_m, signal)

    if len(light.pulse_signal):
        share(pick, range(0, n, CHUNK), task.threads)
    return DrawnBeams.of(light.layer, light.point, range_m, signal, background, pulses)


def _light_of_rows(beams: DrawnBeams, background_per_ns: float, own: Beams, rows: IntArray) -> Light:
    """The light of some beams of a frame of one background."""
    return Light(
        layer=beams.layer[rows],
        point=beams.point[rows],
        background_per_ns=np.full(len(rows), background_per_ns),
        first_pulse=np.arange(len(rows) + 1),
        pulse_range_m=beams.range_m[rows],
        pulse_signal=beams.signal[rows],
        beams=own,
    )


def _light_of_some(light: Light, rows: IntArray) -> Light:
    """The light of some of its beams, rows in their order."""
    chosen = np.zeros(len(light), dtype=np.bool_)
    chosen[rows] = True
    return light_of_beams(light, chosen)


def _draw(beams: DrawnBeams, shelf: Shelf, task: Task, prepare: Callable[[int, int], bool] | None = None) -> bool:
    """Let all beams draw, filling the blocks they ask for; False where `prepare` turned a chunk down."""
    fair = np.ones(len(beams.plain), dtype=np.bool_)

    def run(start: int) -> None:
        low, high = beams.bounds(start)
        chunk = start // CHUNK
        fair[chunk] = prepare is None or prepare(low, high)
        if fair[chunk]:
            columns = (beams.layer, beams.point, beams.range_m, beams.signal, beams.background, beams.pulses)
            where = (low, high, beams.drawn, beams.special)
            arguments: tuple[Any, ...] = (shelf.tables, levels, task.key, *columns, *where, wanted)
            beams.plain[chunk], beams.odd[chunk] = draw_beams(*arguments)

    while True:
        levels, wanted = shelf.levels(), shelf.asked()
        share(run, range(0, len(beams), CHUNK), task.threads, _told(task, len(beams), 0))
        if not fair.all():
            return False
        if not wanted.any():
            return True
        shelf.fill(wanted, task.threads)


def _told(task: Task, beams: int, half: int) -> Callable[[int], object]:
    """Tell `progress` of the chunks of the first or the second half of the work."""
    progress = task.progress
    if progress is None:
        return lambda chunks: None
    return lambda chunks: progress((min(chunks * CHUNK, beams) + half * beams) // 2, beams)


def _finish(
    beams: DrawnBeams,
    shelf: Shelf,
    light: Callable[[IntArray], Light],
    sensor: SpadArray,
    task: Task,
    own: Beams,
) -> Scan:
    """The table of echoes of beams that have drawn. `light`: of some, for the exact chain; `own`: the sensor's."""
    special = beams.listed()
    echoes = _special_echoes(beams, special, shelf, light, sensor, task)
    behind = np.concatenate([[0], np.cumsum(beams.odd)])
    held = np.concatenate([[0], np.cumsum(echoes.held)])
    first = np.concatenate([[0], np.cumsum(beams.plain + np.diff(held[behind]))])
    columns = room_for(int(first[-1]))
    report = report_of(sensor, task.rounded, own)
    places = (beams.drawn, echoes, beams.layer, beams.point, beams.range_m)

    def run(start: int) -> None:
        chunk = start // CHUNK
        write_echoes(*places, *beams.bounds(start), first[chunk], behind[chunk], report, columns)

    share(run, range(0, len(beams), CHUNK), task.threads, _told(task, len(beams), 1))
    return scan_of_table(columns, own, sensor, task.rounded)


def _special_echoes(
    beams: DrawnBeams,
    special: IntArray,
    shelf: Shelf,
    light: Callable[[IntArray], Light],
    sensor: SpadArray,
    task: Task,
) -> EchoArrays:
    """The echoes of the special beams, a row each, in their order."""
    echoes = new_echoes(len(special), sensor.max_echoes)
    exact = np.flatnonzero((beams.drawn[special] & _CODE) == _EXACT_WORD)
    if len(exact):
        found = chain_echoes(light(special[exact]), sensor, seed=task.seed, frame=task.frame, threads=task.threads)
        columns: list[npt.NDArray[Any]] = list(echoes)
        for column, values in zip(columns, found, strict=True):
            column[exact] = values
    levels = shelf.levels()
    for number, library in enumerate(shelf.libraries):
        if library is None:
            continue
        what: tuple[Any, ...] = (shelf.tables, levels, number, library.words, library.samples, library.alarms)

        def run(start: int, what: tuple[Any, ...] = what) -> None:
            stop = min(start + CHUNK, len(special))
            columns = (beams.layer, beams.point, beams.range_m, beams.background, beams.pulses, beams.drawn)
            arguments: tuple[Any, ...] = (*what, task.key, *columns, special, start, stop, new_found(), echoes)
            resolve(*arguments)

        share(run, range(0, len(special), CHUNK), task.threads)
    return echoes
