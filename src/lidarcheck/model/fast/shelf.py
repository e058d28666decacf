"""The libraries of a frame: one where all beams have the same background, else one a level of background."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.fast.draw import EXACT, TABLE
from lidarcheck.model.fast.fill import Source
from lidarcheck.model.fast.grid import LEVEL_BITS, Grid, level_below, level_value, lowest_background
from lidarcheck.model.fast.library import Library, affordable, known_library, library_of, tables_of
from lidarcheck.model.fast.tables import Levels
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import SpadArray

__all__ = ["Shelf", "shelf_of"]

_MOST_LEVELS = 254


class Shelf:
    """Libraries by level; those of a level that no beam has asked for are not there.

    `backgrounds` [avalanches per armed SPAD and ns] (levels,) of the levels `first`, `first + 1` ... or of the single
    library; `of`: any source among them.
    """

    def __init__(self, of: Source, backgrounds: FloatArray, first: int, single: bool) -> None:
        self._of, self._backgrounds, self._first, self._single = of, backgrounds, first, single
        self._lowest = lowest_background(numbers_of(of.sensor), of.sensor.bin_ns)
        self._unfit = np.zeros(len(backgrounds), dtype=np.bool_)
        self.tables = tables_of(of)
        self.libraries: list[Library | None] = [None] * len(backgrounds)

    @property
    def blocks(self) -> int:
        """Blocks of each library."""
        return len(self.tables.before)

    def asked(self) -> npt.NDArray[np.bool_]:
        """Room for what beams ask for; see `Levels.filled`."""
        return np.zeros((len(self.libraries), self.blocks + 1), dtype=np.bool_)

    def levels(self) -> Levels:
        """The libraries as kernels see them now."""
        filled = self.asked()
        words_at = np.zeros(len(self.libraries), dtype=np.int64)
        rates = np.zeros(len(self.libraries))
        for level, library in enumerate(self.libraries):
            filled[level, -1] = library is not None or self._unfit[level]
            if library is not None:
                filled[level, :-1] = library.filled
                words_at[level], rates[level] = library.words.ctypes.data, library.alarms.rate
        alarms = np.zeros((len(rates), 3))
        alarms[:, 0] = rates
        for level in range(len(rates) - 1):
            alarms[level] = self._between(level, rates[level], rates[level + 1])
        return Levels(
            words_at, filled, self._ready(filled[:, -1]), alarms, self._first, self._lowest, LEVEL_BITS, self._single
        )

    def look(self) -> None:
        """Take the libraries that are in memory, so that beams need not ask for them."""
        for level in range(len(self.libraries)):
            self.libraries[level] = known_library(self._source(level))
            self._unfit[level] = not affordable(self._source(level))

    def _ready(self, there: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
        """See `Levels.ready`; `there` (levels,): whether it is known what stands at a level."""
        alone = np.where(there, np.where(self._unfit, EXACT, 0), TABLE).astype(np.uint8)
        after = np.append(alone[1:], alone[-1:])
        both = np.where((alone == TABLE) | (after == TABLE), TABLE, np.maximum(alone, after))
        return np.stack([alone, both.astype(np.uint8)], axis=1)

    def _between(self, level: int, low: float, high: float) -> tuple[float, float, float]:
        """The polynomial of a rate from a level to the next: a power law's at both ends and in the middle."""
        middle, (below, above) = 0.5 * (low + high), self._backgrounds[level : level + 2]
        if min(low, high, below) > 0.0:
            part = float(elementary.log(0.5 * (below + above) / below) / elementary.log(above / below))
            middle = low * float(elementary.power(high / low, part))
        return low, 4.0 * middle - 3.0 * low - high, 2.0 * (low + high) - 4.0 * middle

    def background(self, level: int) -> float:
        """Of a level [avalanches per armed SPAD and ns]."""
        return float(self._backgrounds[level])

    def number(self, level: int) -> int:
        """Of a level among those of all frames."""
        return self._first + level

    def _source(self, level: int) -> Source:
        return self._of._replace(background_per_ns=float(self._backgrounds[level]), seed=self.number(level))

    def fill(self, wanted: npt.NDArray[np.bool_], threads: int | None) -> None:
        """See that what beams asked for is there, or known to be unfit."""
        for level in np.flatnonzero(wanted.any(axis=1)):
            library = self.libraries[level]
            if library is None:
                library = self.libraries[level] = library_of(self._source(int(level)))
                self._unfit[level] = library is None
            if library is not None:
                library.fill(wanted[level, :-1], threads)


def shelf_of(
    sensor: SpadArray, shape: PulseShape | None, background_per_ns: FloatArray, one: Grid, many: Grid
) -> Shelf | None:
    """The libraries for beams of these backgrounds, none empty; None where there can be none.

    `one`: the grid of a single library, `many`: that of each of several.
    """
    least, most = float(background_per_ns.min()), float(background_per_ns.max())
    if least == most:
        source = Source.of(sensor, shape, least, one)
        shelf = Shelf(source, np.array([least]), 0, single=True)
        shelf.libraries[0] = library_of(source)
        return shelf if shelf.libraries[0] is not None else None
    lowest = lowest_background(numbers_of(sensor), sensor.bin_ns)
    first, last = level_below(lowest, least, LEVEL_BITS), level_below(lowest, most, LEVEL_BITS) + 1
    if last - first >= _MOST_LEVELS:
        return None
    backgrounds = np.array([level_value(lowest, level, LEVEL_BITS) for level in range(first, last + 1)])
    source = Source.of(sensor, shape, float(backgrounds[0]), many, seed=first)
    if not affordable(source):
        return None
    shelf = Shelf(source, backgrounds, first, single=False)
    shelf.look()
    return shelf
