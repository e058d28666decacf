"""The misfit of a bloom: measured against simulated means over the offsets from the target, in standard deviations.

Cells are the offsets of each target; in each, the share of beams that show an echo at the target's range, and the mean
features of the largest such echo, are compared, each over its standard deviation of one beam. The spreads are those of
the measurement, so that the number does not depend on which model it was begun with.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.number.beside import Beside
from lidarcheck.calibration.number.number import Number, Residual
from lidarcheck.calibration.number.seen import Seen
from lidarcheck.formats.table import counted
from lidarcheck.inference.observed.echo_view import Slot

__all__ = ["DETECTED", "Means", "Misfit", "means_of"]

DETECTED = "detected"
_LEAST_SHARE_SD = 0.05
"""One beam in four hundred says no more of a share."""
_ENOUGH = 60
"""Degrees of freedom that a cell's spread is taken from, those of the offsets beside it included."""
_FEW_LINES = 5
"""Of fewer lines each beam is a block of its own: a jackknife over three columns tells of nothing."""
_ALIKE = (0.2, 0.5)
"""Correlation of neighbouring lines from which on two, and three of them, are one block."""


@dataclass(frozen=True)
class Means:
    """What is seen in each cell: beams `n` (cells,), `share` of them with an echo, echoes `hits` and their mean `value`
    (cells, features)."""

    n: FloatArray
    share: FloatArray
    hits: FloatArray
    value: FloatArray


@dataclass(frozen=True)
class Sums:
    """What some seeds, or one measurement, show of each beam: echoes `hits` (n,) and their summed `total` (n, features)
    in `seeds` simulations, the `first` of which is kept."""

    hits: FloatArray
    total: FloatArray
    seeds: int
    first: Seen

    @classmethod
    def of(cls, seen: Sequence[Seen]) -> Sums:
        """Over all of them."""
        hits = np.array([one.hit for one in seen]).sum(axis=0).astype(np.float64)
        total = np.array([np.where(one.hit[:, None], one.value, 0.0) for one in seen]).sum(axis=0)
        return cls(hits, total, len(seen), seen[0])


def means_of(sums: Sums, cell: IndexArray, cells: int) -> Means:
    """The means over all beams of a cell."""
    n, hits = _sums(cell, np.full(len(cell), float(sums.seeds)), cells), _sums(cell, sums.hits, cells)
    total = np.zeros((cells, sums.total.shape[1]))
    for j, column in enumerate(sums.total.T):
        total[:, j] = _sums(cell, column, cells)
    return Means(n, hits / np.maximum(n, 1.0), hits, total / np.maximum(hits, 1.0)[:, None])


def _sums(number: IndexArray, value: FloatArray, count: int) -> FloatArray:
    """Of the values of each number, shape (count,)."""
    return np.asarray(np.bincount(number, value, count), dtype=np.float64)


class Misfit:
    """A measurement beside its targets, ready to be compared: `seen` is what was measured of the beams. `spread`: of
    one beam in each cell, (cells, 1 + features), where the measurement itself does not show it."""

    def __init__(
        self, beside: Beside, slots: Sequence[Slot], seen: Seen, key: str, spread: FloatArray | None = None
    ) -> None:
        self.beside, self.slots, self.seen = beside, tuple(slots), seen
        pairs = np.column_stack([beside.target, np.round(beside.offset, 6)])
        self.cells, cell = np.unique(pairs, axis=0, return_inverse=True)
        self.cell: IndexArray = cell.ravel()
        self.measured = self.means([seen])
        self.spread = self._spreads() if spread is None else spread
        shown = self.measured.hits > 0
        self.beams = float(self.measured.n[shown].sum()) or float(len(beside))
        self.scale = hashlib.sha256(
            b"".join([key.encode(), beside.key.tobytes(), beside.at_m.tobytes(), beside.offset.tobytes()])
        ).hexdigest()

    @property
    def names(self) -> tuple[str, ...]:
        """What is compared: the share of beams with an echo, and the features."""
        return (DETECTED, *(slot.name for slot in self.slots))

    def squares(self, shown: Means, measured: Means | None = None) -> FloatArray:
        """The mean squares by name, shape (1 + features,)."""
        off, weight = self._off(shown, measured or self.measured)
        return np.asarray((weight * off**2).sum(axis=0) / self.beams)

    def value(self, shown: Means, measured: Means | None = None) -> float:
        """The root of the mean square over all that is compared."""
        return float(np.sqrt(self.squares(shown, measured).mean()))

    def means(self, seen: Sequence[Seen]) -> Means:
        """What is seen in each cell, with all seeds together."""
        return means_of(Sums.of(seen), self.cell, len(self.cells))

    def number(self, seen: Sequence[Seen], *, simulated: str, sample: str) -> Number:
        """The number of what a model shows with some seeds."""
        sums = Sums.of(seen)
        shown = means_of(sums, self.cell, len(self.cells))
        value, parts = self.value(shown), np.sqrt(self.squares(shown))
        return Number(
            "misfit", value, self._floor(seen, shown), dict(zip(self.names, parts.tolist(), strict=True)), sample,
            value - self._contributions(sums, shown), self._blocks[1], self.scale, simulated,
            about=self._lacking(), residual=self.residual(shown),
        )  # fmt: skip

    def expected(self, shown: Means, *, floor: float, simulated: str) -> Number:
        """The number of what a model is expected to show."""
        parts = np.sqrt(self.squares(shown))
        return Number(
            "misfit", self.value(shown), floor, dict(zip(self.names, parts.tolist(), strict=True)), "expected",
            np.zeros(0), self._blocks[1], self.scale, simulated, exact=False, residual=self.residual(shown),
        )  # fmt: skip

    def residual(self, shown: Means) -> Residual:
        """What the number is made of, cell by cell."""
        m, features = self.measured, len(self.slots)
        counts = [(m.n, shown.n), *[(m.hits, shown.hits)] * features]
        known = np.column_stack([(a > 0.0) & (b > 0.0) for a, b in counts]) & np.isfinite(self.spread)
        chance = np.column_stack([np.sqrt(1.0 / np.maximum(a, 1.0) + 1.0 / np.maximum(b, 1.0)) for a, b in counts])
        off = np.where(known, self._off(shown, m)[0], np.nan)
        return Residual(
            self.cells[:, 1],
            dict(zip(self.names, off.T, strict=True)),
            dict(zip(self.names, chance.T, strict=True)),
        )

    def _off(self, shown: Means, measured: Means) -> tuple[FloatArray, FloatArray]:
        """How far each cell is off, and what it weighs, shape (cells, 1 + features) each."""
        share = (measured.share - shown.share) / self.spread[:, 0]
        value = (measured.value - shown.value) / self.spread[:, 1:]
        # So many echoes as both have, of as many beams.
        both = np.minimum(measured.hits, shown.share * measured.n)
        weight = np.column_stack([measured.n, *[both] * value.shape[1]])
        return np.column_stack([share, value]), weight

    def _floor(self, seen: Sequence[Seen], shown: Means) -> float:
        """What the model leaves where it is right: of each seed against the others."""
        if len(seen) < 2:
            return float("nan")
        each = [self.means([one]) for one in seen]
        return float(np.sqrt(np.mean([self.squares(_without(shown, one), one).mean() for one in each])))

    def _spreads(self) -> FloatArray:
        """The standard deviation of one beam in each cell, shape (cells, 1 + features)."""
        m, cells = self.measured, len(self.cells)
        share = (m.hits + 1.0) / (m.n + 2.0)
        spread = [np.maximum(np.sqrt(share * (1.0 - share)), _LEAST_SHARE_SD)]
        for j, slot in enumerate(self.slots):
            off = np.where(self.seen.hit, self.seen.value[:, j] - m.value[self.cell, j], 0.0)
            squares = _sums(self.cell, off**2, cells)
            spread.append(np.maximum(self._pooled(squares, np.maximum(m.hits - 1.0, 0.0), m.value[:, j]), slot.floor))
        return np.column_stack(spread)

    def _pooled(self, squares: FloatArray, freedom: FloatArray, value: FloatArray) -> FloatArray:
        """The root of the mean square of each cell and as many beside it as it takes, of one target, (cells,).

        Where no cell has two echoes, of the differences from each to the next.
        """
        found = np.zeros(len(squares))
        for target in np.unique(self.cells[:, 0]):
            rows = np.flatnonzero(self.cells[:, 0] == target)
            own, of = squares[rows], freedom[rows]
            if of.sum() < _ENOUGH:
                there = self.measured.hits[rows] > 0
                steps = np.diff(value[rows][there])
                found[rows] = np.sqrt(0.5 * np.mean(steps**2)) if len(steps) else 0.0
                continue
            sums, counts = (np.concatenate([[0.0], np.cumsum(a)]) for a in (own, of))
            low, high = np.arange(len(rows)), np.arange(1, len(rows) + 1)
            while True:
                short = counts[high] - counts[low] < _ENOUGH
                if not short.any():
                    break
                low, high = np.where(short, np.maximum(low - 1, 0), low), np.where(short, high + 1, high)
                high = np.minimum(high, len(rows))
            found[rows] = np.sqrt((sums[high] - sums[low]) / (counts[high] - counts[low]))
        return found

    @cached_property
    def _blocks(self) -> tuple[IndexArray, str]:
        """The block of each beam, and what they are called: by what was measured alone."""
        line = self.beside.line
        count = int(line.max()) + 1
        if count < _FEW_LINES:
            return np.arange(len(line)), f"beams, as the target has {counted(count, 'line')}"
        size = 1 + sum(self._correlation() > least for least in _ALIKE)
        frame = np.array([self.beside.frame[line == k][0] for k in range(count)])
        first = np.searchsorted(frame, frame)  # blocks hold lines of one frame
        block = np.unique(np.column_stack([frame, (np.arange(count) - first) // size]), axis=0, return_inverse=True)[1]
        block = block.ravel()
        words = "lines" if size == 1 else f"{size} lines each, as neighbours correlate"
        return np.asarray(block[line]), f"{int(block.max()) + 1} blocks: {words}"

    def _correlation(self) -> float:
        """Of the same cell in neighbouring lines of a frame, over all features; 0 where there are too few."""
        m, line = self.measured, self.beside.line
        off = np.where(self.seen.hit[:, None], (self.seen.value - m.value[self.cell]) / self.spread[self.cell, 1:], 0.0)
        mean = off.sum(axis=1) / max(off.shape[1], 1)
        table = np.zeros((int(line.max()) + 1, len(self.cells)))
        table[line, self.cell] = mean
        frame = np.array([self.beside.frame[line == k][0] for k in range(len(table))])
        pairs = np.flatnonzero(frame[1:] == frame[:-1])
        both = (table[pairs] != 0.0) & (table[pairs + 1] != 0.0)
        if both.sum() < 10 * _ENOUGH:
            return 0.0
        product = float((table[pairs] * table[pairs + 1])[both].mean())
        # Residuals about a mean of n lines are of themselves correlated by -1 / (n - 1).
        bias = 1.0 / max(len(table) - 1, 1)
        return product / float(table[table != 0.0].var()) + bias

    def _contributions(self, sums: Sums, shown: Means) -> FloatArray:
        """What each block adds to the value's error, shape (blocks,): the infinitesimal jackknife, measured and
        simulated beams together."""
        block, m = self._blocks[0], self.measured
        off, weight = self._off(shown, m)
        value = max(self.value(shown), 1e-9)
        slope = weight * off / self.spread / (self.beams * off.shape[1] * value)
        total = self._influence(Sums.of([self.seen]), m, slope) - self._influence(sums, shown, slope)
        blocks = int(block.max()) + 1
        # Blocks that are left out in turn differ the less the fewer there are: what a jackknife puts right again.
        return np.asarray(_sums(block, total, blocks) * np.sqrt(blocks / max(blocks - 1.0, 1.0)))

    def _influence(self, sums: Sums, means: Means, slope: FloatArray) -> FloatArray:
        """What each beam of one side adds, shape (n,); `means`: over all beams of that side."""
        of, hits, n = self.cell, means.hits[self.cell], means.n[self.cell]
        share = slope[of, 0] * (sums.hits - sums.seeds * means.share[of]) / n
        beams = _sums(self.cell, (sums.hits > 0.0).astype(np.float64), len(self.cells))[of]
        off = (sums.total - sums.hits[:, None] * means.value[of]) * _put_right(beams)[:, None]
        off = np.where((beams <= 1.0)[:, None], self._alone(sums, means), off)
        return np.asarray(share + (slope[of, 1:] * off).sum(axis=1) / np.maximum(hits, 1.0))

    def _alone(self, sums: Sums, means: Means) -> FloatArray:
        """The same of beams that are alone in their cells, (n, features): a measured one is its own mean, so that only
        its spread says how far it may be off; of simulations the first stands for all."""
        if sums.seeds == 1:
            return np.where(np.isfinite(self.spread[self.cell, 1:]), self.spread[self.cell, 1:], 0.0)
        off = np.where(sums.first.hit[:, None], sums.first.value - means.value[self.cell], 0.0)
        return np.asarray(off * np.sqrt(sums.seeds) * _put_right(np.array([sums.seeds], dtype=np.float64)))

    def _lacking(self) -> str:
        return "" if self.slots else "by the share of echoes alone: the measured scan has no feature of the sensor"


def _put_right(n: FloatArray) -> FloatArray:
    """How much farther from the true mean than from their own n values are."""
    return np.asarray(np.sqrt(n / np.maximum(n - 1.0, 1.0)))


def _without(together: Means, one: Means) -> Means:
    """The means of all but one of the seeds."""
    n, hits = together.n - one.n, together.hits - one.hits
    total = together.value * together.hits[:, None] - one.value * one.hits[:, None]
    return Means(n, hits / np.maximum(n, 1.0), hits, total / np.maximum(hits, 1.0)[:, None])
