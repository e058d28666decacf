"""All KPIs of a comparison in every exchange, from the tallies of its frames."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.kpi.chance.draws import (
    blooming_draws,
    difference_draws,
    means_apart,
    mixed,
    moments_draws,
    ratio_draws,
    scatters_apart,
)
from lidarcheck.kpi.chance.exchange import Drawn
from lidarcheck.kpi.chance.rows import Tallies
from lidarcheck.kpi.chance.tallies import Histogram
from lidarcheck.kpi.overlap import RADIUS_M
from lidarcheck.kpi.percentiles import LEVELS

__all__ = ["drawn_of"]

FEWEST_IN_BLOCK, FEWEST_IN_FRAME = 20, 100
"""Rows a side that make a unit count for a KPI: a median or a share of fewer is chance alone."""
_NEVER = "an exchange of the sides says nothing of it"
_COUNTS = "counting alone makes it about 1, and a distance above 0"
_NOTHING = np.full(1, np.nan)


def drawn_of(tallies: Tallies, signs: FloatArray, *, by_frame: bool) -> Iterator[Drawn]:
    """Each KPI of a comparison's table; `signs` (n_draws, units); `by_frame`: a unit is a frame."""
    return _Family(tallies, signs, FEWEST_IN_FRAME if by_frame else FEWEST_IN_BLOCK).drawn()


class _Family:
    def __init__(self, tallies: Tallies, signs: FloatArray, fewest: int) -> None:
        self.tallies, self.signs, self.fewest = tallies, signs, fewest

    def drawn(self) -> Iterator[Drawn]:
        yield from self._counted("echoes")
        for name, histogram in self.tallies.features.items():
            yield from self._feature(name, histogram)
        if self.tallies.histogram:
            for kpi in ("histogram_residual", "histogram_distance"):
                yield Drawn(kpi, self.tallies.histogram, _NOTHING, 0, _COUNTS)
        yield from self._counted("detection_probability", "false_alarms")
        for of, histogram in self.tallies.decades.items():
            yield self._median("walk_offset", of, histogram)
        yield from self._readout()
        yield from self._ghost()
        for axis, sums in self.tallies.blooming.items():
            held = sums.all(self.tallies.units)
            yield Drawn("blooming_profile", axis, blooming_draws(held, self.signs), self._enough(held[..., 0].sum(2)))
        yield self._median("paired_range", "median", self.tallies.paired, half=True)
        for kpi, of in (("paired_range", "spread"), ("overlap", f"within {RADIUS_M:g} m"), ("chamfer", "")):
            yield Drawn(kpi, of, _NOTHING, 0, _NEVER)

    def _enough(self, rows: FloatArray) -> int:
        """Units with enough rows on either side; `rows` (2, units)."""
        return int((rows >= self.fewest).all(axis=0).sum())

    def _counted(self, *names: str) -> Iterator[Drawn]:
        for (kpi, of), sums in self.tallies.counts.items():
            if kpi not in names:
                continue
            held = sums.all(self.tallies.units)
            hits, trials = held[..., 0], held[..., 1] if held.shape[2] > 1 else None
            # Of what is counted, none on one side is no lack of rows.
            rows = np.broadcast_to(hits.max(axis=0), hits.shape) if trials is None else trials
            yield Drawn(kpi, of, difference_draws(hits, trials, self.signs), self._enough(rows))

    def _feature(self, name: str, histogram: Histogram) -> Iterator[Drawn]:
        levels = {f"percentile_{level}": level / 100.0 for level in LEVELS}
        names = ("dvm_bias", "dvm_scatter", "wasserstein", "ks", "energy", "js", *levels)
        if not histogram.frames:
            yield from (Drawn(kpi, name, _NOTHING, 0) for kpi in names)
            return
        value, counts = histogram.filled(self.tallies.units)
        two, units = mixed(value, counts, self.signs), self._enough(counts.sum(axis=2))
        found = {} if two is None else two.distances(histogram.js_edges)
        if two is not None:
            found |= zip(levels, two.percentiles_apart([*levels.values()]), strict=True)
        yield from (Drawn(kpi, name, found.get(kpi, _NOTHING), units) for kpi in names)

    def _median(self, kpi: str, of: str, histogram: Histogram, *, half: bool = False) -> Drawn:
        """A difference of medians; `half`: the simulated side mirrors the measured, and the median is that alone."""
        if not histogram.frames:
            return Drawn(kpi, of, _NOTHING, 0)
        value, counts = histogram.filled(self.tallies.units)
        two = mixed(value, counts, self.signs)
        units = self._enough(counts.sum(axis=2))
        if two is None:
            return Drawn(kpi, of, _NOTHING, units)
        return Drawn(kpi, of, two.quantiles(1.0, 0.5) if half else two.medians_apart(), units)

    def _readout(self) -> Iterator[Drawn]:
        for angle, sums in self.tallies.directions.items():
            held = sums.all(self.tallies.units)
            units = self._enough(held[..., 0])
            yield Drawn("direction_bias", angle, means_apart(held[..., :2], self.signs), units)
            yield Drawn("direction_scatter", angle, scatters_apart(held, self.signs), units)
        for axis, sums in self.tallies.positions.items():
            held = sums.all(self.tallies.units)
            yield Drawn(f"position_bias_{axis}", "", means_apart(held, self.signs), self._enough(held[..., 0]))
        for number, sums in self.tallies.numbers.items():
            hits, echoes = (one.all(self.tallies.units)[..., 0] for one in (sums, self.tallies.numbered))
            draws = difference_draws(hits, echoes, self.signs)
            yield Drawn("echo_number_share", str(number), draws, self._enough(echoes))

    def _ghost(self) -> Iterator[Drawn]:
        if not self.tallies.ghost:
            return
        target, ghost = (self.tallies.ghost[name].all(self.tallies.units) for name in ("target", "ghost"))
        seen, signs = self._enough(ghost[..., 0]), self.signs
        on_target = self._enough(target[..., 0])
        yield Drawn("ghost", "count_ratio", difference_draws(ghost[..., 0], target[..., 0], signs), on_target)
        for column, of in enumerate(self.tallies.ghost_names, start=1):
            pick = [0, column]
            yield Drawn("ghost", of, ratio_draws(ghost[..., pick], target[..., pick], signs), seen)
        yield self._median("ghost", "range_ratio", self.tallies.ghost_range)
        moments = [0, 3, 4, 5, 6]
        yield Drawn("ghost", "size_ratio", moments_draws(ghost[..., moments], target[..., moments], signs), seen)
