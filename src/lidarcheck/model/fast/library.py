"""A library of echoes: filled where beams ask for it, kept on disk and while the process runs."""

from __future__ import annotations

import collections
import threading
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulse_form import form_of
from lidarcheck.model.fast import store
from lidarcheck.model.fast import words as w
from lidarcheck.model.fast.alarms import Alarms, alarm_rate, alarms_of
from lidarcheck.model.fast.draw import Tables
from lidarcheck.model.fast.fill import Block, Source, fill_block
from lidarcheck.model.fast.grid import lowest_octave, spans
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, NonIdeal, SpadArray

__all__ = ["Library", "Samples", "affordable", "library_of"]

_MOST_DETECTORS, _MOST_THRESHOLD, _MOST_BINS = 4095, 100, 256
_MOST_ALARMS = 1e-2
"""Echoes of background alone a beam; beyond, they are no rare events."""
_KEPT = 8
"""Libraries that stay in memory, each of some ten megabytes."""
_libraries: collections.OrderedDict[Source, Library] = collections.OrderedDict()
_guard = threading.Lock()


class Samples(NamedTuple):
    """Samples that no word holds, of all blocks: those of block b from row `first[b]` on; see `Block`."""

    first: npt.NDArray[np.int64]
    held: npt.NDArray[np.int32]
    centre: npt.NDArray[np.float64]
    width: npt.NDArray[np.int32]
    area: npt.NDArray[np.int32]
    peak: npt.NDArray[np.int32]


class Library:
    """Samples of one sensor, pulse and background on a grid of signal and position within a bin."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._numbers = numbers_of(source.sensor)
        self._spans = spans(self._numbers, form_of(source.shape, source.sensor, source.sensor.bin_ns))
        nodes, phases, samples = source.grid.shape
        self._size = nodes * phases * samples
        # Memory is only taken up by the blocks that are filled.
        self._words = np.empty(len(self._spans) * self._size, dtype=np.uint64)
        self._filled = np.zeros(len(self._spans), dtype=np.bool_)
        self._blocks: list[Block | None] = [None] * len(self._spans)
        self._filling = threading.Lock()
        self.alarms: Alarms = alarms_of(self._numbers, source.background_per_ns * source.sensor.bin_ns)
        self.samples = self._tabulate()

    @property
    def blocks(self) -> int:
        """Blocks that there may be."""
        return len(self._spans)

    def tables(self, number: int = 0) -> Tables:
        """What kernels draw from; `number`: which of the frame's libraries it is."""
        sensor, grid = self._source.sensor, self._source.grid
        return Tables(
            words=self._words,
            filled=self._filled,
            before=np.array([span.before for span in self._spans]),
            length=np.array([span.length for span in self._spans]),
            lowest=lowest_octave(self._numbers),
            bins=self._numbers.bins,
            bins_per_m=2.0 / (LIGHT_SPEED_M_PER_NS * sensor.bin_ns),
            alarms=self.alarms.rate,
            signal_bits=grid.signal_bits,
            phase_bits=grid.phase_bits,
            sample_bits=grid.sample_bits,
            number=number,
        )

    def fill(self, wanted: npt.NDArray[np.bool_], threads: int | None = None) -> None:
        """See that the wanted blocks are there, shape (blocks,): from disk, else by the exact chain."""
        with self._filling:
            for block in np.flatnonzero(wanted & ~self._filled):
                self._take(int(block), self._stored(int(block)) or self._new(int(block), threads))
            self.samples = self._tabulate()

    def _take(self, block: int, samples: Block) -> None:
        self._words[block * self._size : (block + 1) * self._size] = samples.words
        self._blocks[block] = samples._replace(words=samples.words[:0])
        self._filled[block] = True

    def _new(self, block: int, threads: int | None) -> Block:
        samples = fill_block(self._source, block, self._spans[block], threads)
        store.save(store.path_of(self._source, block), samples._asdict())
        return samples

    def _stored(self, block: int) -> Block | None:
        """A block from disk; None where its file is missing or is none of ours."""
        arrays = store.load(store.path_of(self._source, block))
        if arrays is None or set(arrays) != set(Block._fields):
            return None
        samples = Block(**arrays)
        rows, room = len(samples.held), self._source.sensor.max_echoes
        sound = samples.words.shape == (self._size,) and samples.words.dtype == np.uint64
        tables = (samples.centre, samples.width, samples.area, samples.peak)
        sound &= all(table.shape == (rows, room) for table in tables) and samples.held.shape == (rows,)
        if not sound or (rows and not 0 <= samples.held.min() <= samples.held.max() <= room):
            return None
        many = samples.words[(samples.words & np.uint64(w.KIND)) == w.MANY] >> np.uint64(w.ROW_AT)
        return samples if len(many) == 0 or many.max() < rows else None

    def _tabulate(self) -> Samples:
        room = self._source.sensor.max_echoes
        whole = np.empty((0, room), dtype=np.int32)
        none = Block(self._words[:0], whole[:, 0], np.empty((0, room)), whole, whole, whole)
        blocks = [block or none for block in self._blocks]
        first = np.concatenate([[0], np.cumsum([len(block.held) for block in blocks])])
        return Samples(first, *(np.concatenate(columns) for columns in list(zip(*blocks, strict=True))[1:]))


def affordable(source: Source) -> bool:
    """Whether a library can stand in for the exact chain: see docs/performance.md."""
    sensor = source.sensor
    numbers = numbers_of(sensor)
    if sensor.nonideal != NonIdeal() or numbers.dead <= numbers.on or numbers.threshold > _MOST_THRESHOLD:
        return False
    if numbers.detectors > _MOST_DETECTORS:
        return False
    lengths = [span.length for span in spans(numbers, form_of(source.shape, sensor, sensor.bin_ns))]
    shortest_m = 0.5 * LIGHT_SPEED_M_PER_NS * sensor.bin_ns * (min(lengths) - 0.5)
    if max(lengths) > _MOST_BINS or shortest_m < SpadArray.bounds["max_range_m"].low:
        return False
    return alarm_rate(numbers, source.background_per_ns * sensor.bin_ns) * numbers.bins <= _MOST_ALARMS


def library_of(source: Source) -> Library | None:
    """The library of a source, None where there can be none; the last few stay in memory."""
    with _guard:
        if source in _libraries:
            _libraries.move_to_end(source)
            return _libraries[source]
        if not affordable(source):
            return None
        library = _libraries[source] = Library(source)
        while len(_libraries) > _KEPT:
            _libraries.popitem(last=False)
        return library
