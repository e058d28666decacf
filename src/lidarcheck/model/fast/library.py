"""A library of echoes: filled where beams ask for it, kept on disk and while the process runs."""

from __future__ import annotations

import collections
import functools
import threading
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulse_form import form_of
from lidarcheck.model.fast import store
from lidarcheck.model.fast import words as w
from lidarcheck.model.fast.alarms import Alarms, alarm_rate
from lidarcheck.model.fast.disturbed import alarms_by
from lidarcheck.model.fast.fill import Block, Source, fill_block
from lidarcheck.model.fast.grid import LOST_AVALANCHES, Span, lowest_octave, spans
from lidarcheck.model.fast.tables import Tables
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["Library", "Samples", "affordable", "known_library", "library_of", "tables_of"]

_MOST_DETECTORS, _MOST_THRESHOLD, _MOST_BINS = 4095, 100, 256
_MOST_ALARMS = 0.5
"""Clumps of echoes of background alone a beam; beyond, two of them meet too often."""
_KEPT, _KEPT_BYTES = 8, 1 << 29
"""Libraries that stay in memory, and more as long as all together are no larger."""
_MOST_PULSES = 8
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
        self._spans = _spans_of(source)
        nodes, phases, samples = source.grid.shape
        self._size = nodes * phases * samples
        # Memory is only taken up by the blocks that are filled.
        self._words = np.empty(len(self._spans) * self._size, dtype=np.uint64)
        self._filled = np.zeros(len(self._spans), dtype=np.bool_)
        self._blocks: list[Block | None] = [None] * len(self._spans)
        self._filling = threading.Lock()
        self.alarms: Alarms = alarms_by(source)
        self.samples = self._tabulate()

    @property
    def blocks(self) -> int:
        """Blocks that there may be."""
        return len(self._spans)

    @property
    def fits(self) -> bool:
        """Whether echoes of background alone are rare enough."""
        return self.alarms.rate * self._numbers.bins <= _MOST_ALARMS

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """Which blocks are there, shape (blocks,)."""
        return self._filled

    @property
    def words(self) -> npt.NDArray[np.uint64]:
        """All words, shape (blocks * nodes * phases * samples,), of which those of filled blocks are set."""
        return self._words

    @property
    def bytes(self) -> int:
        """What the filled blocks take up."""
        return int(np.count_nonzero(self._filled)) * self._size * self._words.itemsize

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


def tables_of(source: Source) -> Tables:
    """What the libraries of a sensor and a pulse have in common, whatever the background."""
    sensor, grid = source.sensor, source.grid
    numbers, of_blocks = numbers_of(sensor), _spans_of(source)
    return Tables(
        before=np.array([span.before for span in of_blocks]),
        length=np.array([span.length for span in of_blocks]),
        lowest=lowest_octave(numbers),
        bins=numbers.bins,
        bins_per_m=2.0 / (LIGHT_SPEED_M_PER_NS * sensor.bin_ns),
        signal_bits=grid.signal_bits,
        phase_bits=grid.phase_bits,
        sample_bits=grid.sample_bits,
        gap=max(numbers.dead - numbers.on, 0),
        dark=LOST_AVALANCHES / numbers.detectors,
        most_pulses=_MOST_PULSES,
    )


def _spans_of(source: Source) -> list[Span]:
    form = form_of(source.shape, source.sensor, source.sensor.bin_ns)
    return spans(numbers_of(source.sensor), form, source.sensor)


@functools.lru_cache(maxsize=1024)
def affordable(source: Source) -> bool:
    """Whether a library can stand in for the exact chain: see docs/performance.md."""
    sensor = source.sensor
    numbers = numbers_of(sensor)
    if numbers.dead <= numbers.on or numbers.threshold > _MOST_THRESHOLD or numbers.detectors > _MOST_DETECTORS:
        return False
    lengths = [span.length for span in _spans_of(source)]
    shortest_m = 0.5 * LIGHT_SPEED_M_PER_NS * sensor.bin_ns * (min(lengths) - 0.5)
    if max(lengths) > _MOST_BINS or shortest_m < SpadArray.bounds["max_range_m"].low:
        return False
    return alarm_rate(numbers, source.background_per_ns * sensor.bin_ns) * numbers.bins <= _MOST_ALARMS


def known_library(source: Source) -> Library | None:
    """The library of a source if it is in memory and fits."""
    with _guard:
        library = _libraries.get(source)
    return library if library is not None and library.fits else None


def library_of(source: Source) -> Library | None:
    """The library of a source, None where there can be none; the last few stay in memory."""
    with _guard:
        if source in _libraries:
            _libraries.move_to_end(source)
        elif affordable(source):
            _libraries[source] = Library(source)
            while len(_libraries) > _KEPT and sum(library.bytes for library in _libraries.values()) > _KEPT_BYTES:
                _libraries.popitem(last=False)
        else:
            return None
        library = _libraries[source]
    return library if library.fits else None
