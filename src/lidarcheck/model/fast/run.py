"""The fast path of a frame: draw, resolve what is special, write the table of echoes; all in parallel over beams."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.report import report_of, room_for, scan_of_table
from lidarcheck.model.fast.beams import CHUNK, DrawnBeams, Task
from lidarcheck.model.fast.draw import EXACT, draw_beams, in_order, signals
from lidarcheck.model.fast.fill import Source
from lidarcheck.model.fast.grid import DEFAULT_GRID
from lidarcheck.model.fast.library import Library, library_of
from lidarcheck.model.fast.special import new_found, resolve
from lidarcheck.model.fast.words import CODE_AT, CODE_BITS, KIND, ONE, SPECIAL
from lidarcheck.model.fast.write import write_echoes
from lidarcheck.model.light import material_tables
from lidarcheck.model.sharing import share
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Light, Scan, light_of_beams
from lidarcheck.sensor import Beams, SpadArray

__all__ = ["fast_echoes", "fast_frame"]

IntArray = npt.NDArray[np.int64]
ColumnArray = npt.NDArray[np.int32]

_MOST_LIBRARIES = 8
"""Backgrounds of a frame that get a library each; a frame of more goes through the exact chain."""
_CODE = np.uint64((1 << CODE_AT + CODE_BITS) - 1)
_EXACT_WORD = np.uint64(SPECIAL | EXACT << CODE_AT)


def fast_frame(ideal: IdealScan, model: Model, sensor: SpadArray, task: Task) -> Scan | None:
    """The echoes of a frame whose light no effect changes; None where it is no plain frame of the sensor's own beams.

    `sensor`: the model's, behind the detector effects. The range equation, the draw and the table are done chunk by
    chunk, without a `Light` in between.
    """
    tables = material_tables(model)
    source = Source.of(sensor, None, model.sensor.background_per_ns, DEFAULT_GRID)
    library = library_of(source)
    if library is None or tables is None or ideal.share is not None or len(ideal) == 0:
        return None
    beams = DrawnBeams.of(ideal.layer, ideal.point, ideal.distance_m, np.empty(len(ideal)))

    def prepare(start: int, stop: int) -> bool:
        columns = (ideal.distance_m, ideal.incidence_deg, ideal.material_id)
        odd = signals(*columns, *tables, beams.signal, start, stop)
        return odd == 0 and in_order(ideal.layer, ideal.point, ideal.beams.layers, ideal.beams.points, start, stop)

    if not _draw(beams, library, 0, task, prepare):
        return None
    background_per_ns = model.sensor.background_per_ns
    return _finish(
        beams,
        [library],
        lambda rows: _light_of_rows(beams, rows, background_per_ns, ideal.beams),
        sensor,
        task,
        ideal.beams,
    )


def fast_echoes(light: Light, sensor: SpadArray, task: Task) -> Scan | None:
    """The echoes of any light: beams of one pulse from a library, all others through the exact chain.

    None where nothing is gained.
    """
    layer, point = light.layer, light.point
    if (
        len(light) == 0
        or min(layer.min(), point.min()) < 0
        or layer.max() >= light.beams.layers
        or point.max() >= light.beams.points
    ):
        return None
    groups = _groups(light, sensor)
    if not groups:
        return None
    beams = DrawnBeams.of(layer, point, *_single_pulses(light))
    for number, (rows, library) in enumerate(groups):
        _draw_rows(beams, rows, library, number, task)
    libraries = [library for _, library in groups]
    return _finish(
        beams,
        libraries,
        lambda rows: light_of_beams(light, np.isin(np.arange(len(light)), rows)),
        sensor,
        task,
        light.beams,
    )


def _light_of_rows(beams: DrawnBeams, rows: IntArray, background_per_ns: float, own: Beams) -> Light:
    """The light of some beams."""
    return Light(
        layer=beams.layer[rows],
        point=beams.point[rows],
        background_per_ns=np.full(len(rows), background_per_ns),
        first_pulse=np.arange(len(rows) + 1),
        pulse_range_m=beams.range_m[rows],
        pulse_signal=beams.signal[rows],
        beams=own,
    )


def _groups(light: Light, sensor: SpadArray) -> list[tuple[IntArray | None, Library]]:
    """Beams that may draw, by background, each with its library; None for the rows of all beams."""
    if light.haze is not None:
        return []
    single = np.diff(light.first_pulse) <= 1
    everyone = bool(single.all())
    background = light.background_per_ns if everyone else light.background_per_ns[single]
    if len(background) == 0:
        return []
    one = bool(background.min() == background.max())
    values = background[:1] if one else np.unique(background)
    if len(values) > _MOST_LIBRARIES:
        return []
    groups: list[tuple[IntArray | None, Library]] = []
    for value in values:
        library = library_of(Source.of(sensor, light.shape, float(value), DEFAULT_GRID))
        if library is not None:
            whole = everyone and one
            groups.append((None if whole else np.flatnonzero(single & (light.background_per_ns == value)), library))
    return groups


def _single_pulses(light: Light) -> tuple[FloatArray, FloatArray]:
    """Range and S of each beam's first pulse, 0 where it has none."""
    has = np.diff(light.first_pulse) > 0
    if len(light.pulse_signal) == len(light) and has.all():
        return light.pulse_range_m, light.pulse_signal
    range_m, signal = np.zeros(len(light)), np.zeros(len(light))
    first = light.first_pulse[:-1][has]
    range_m[has], signal[has] = light.pulse_range_m[first], light.pulse_signal[first]
    return range_m, signal


def _draw_rows(beams: DrawnBeams, rows: IntArray | None, library: Library, number: int, task: Task) -> None:
    """Let some beams draw from a library; where these are not all, the others go through the exact chain so far."""
    if rows is None:
        _draw(beams, library, number, task)
        return
    if number == 0:
        beams.drawn[:] = _EXACT_WORD
    part = DrawnBeams.of(beams.layer[rows], beams.point[rows], beams.range_m[rows], beams.signal[rows])
    _draw(part, library, number, task)
    beams.drawn[rows] = part.drawn
    kind = beams.drawn & np.uint64(KIND)
    special = np.flatnonzero(kind == SPECIAL)
    edges = np.append(np.arange(0, len(beams), CHUNK), len(beams))
    beams.plain[:] = np.diff(np.searchsorted(np.flatnonzero(kind == ONE), edges))
    places = np.searchsorted(special, edges)
    beams.odd[:] = np.diff(places)
    for start, low, high in zip(edges[:-1], places[:-1], places[1:], strict=True):
        beams.special[start : start + high - low] = special[low:high]


def _draw(
    beams: DrawnBeams, library: Library, number: int, task: Task, prepare: Callable[[int, int], bool] | None = None
) -> bool:
    """Let all beams draw, filling the blocks they ask for; False where `prepare` turned a chunk down."""
    wanted = np.zeros(library.blocks, dtype=np.bool_)
    fair = np.ones(len(beams.plain), dtype=np.bool_)

    def run(start: int) -> None:
        low, high = beams.bounds(start)
        chunk = start // CHUNK
        fair[chunk] = prepare is None or prepare(low, high)
        if fair[chunk]:
            columns = (beams.layer, beams.point, beams.range_m, beams.signal)
            found = draw_beams(tables, task.key, *columns, low, high, beams.drawn, beams.special, wanted)
            beams.plain[chunk], beams.odd[chunk] = found

    while True:
        tables = library.tables(number)
        share(run, range(0, len(beams), CHUNK), task.threads, _told(task, len(beams), 0))
        if not fair.all():
            return False
        if not wanted.any():
            return True
        library.fill(wanted, task.threads)
        wanted[:] = False


def _told(task: Task, beams: int, half: int) -> Callable[[int], object]:
    """Tell `progress` of the chunks of the first or the second half of the work."""
    progress = task.progress
    if progress is None:
        return lambda chunks: None
    return lambda chunks: progress((min(chunks * CHUNK, beams) + half * beams) // 2, beams)


def _finish(
    beams: DrawnBeams,
    libraries: list[Library],
    light: Callable[[IntArray], Light],
    sensor: SpadArray,
    task: Task,
    own: Beams,
) -> Scan:
    """The table of echoes of beams that have drawn. `light`: of some, for the exact chain; `own`: the sensor's."""
    special = beams.listed()
    echoes = _special_echoes(beams, special, libraries, light, sensor, task)
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
    libraries: list[Library],
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
    for number, library in enumerate(libraries):
        what: tuple[Any, ...] = (library.tables(number), library.samples, library.alarms)

        def run(start: int, what: tuple[Any, ...] = what) -> None:
            stop = min(start + CHUNK, len(special))
            where = (beams.layer, beams.point, beams.range_m, beams.drawn, special, start, stop)
            arguments: tuple[Any, ...] = (*what, task.key, *where, new_found(), echoes)
            resolve(*arguments)

        share(run, range(0, len(special), CHUNK), task.threads)
    return echoes
