"""Some hundred summaries of what scans show: each a number that is about standard normal where nothing is missing.

A summary is a feature (was the surface detected, its echo's range, AREA, PEAK, WIDTH, their spreads, other echoes)
over a bin of a covariate. Measured and simulated scans go through the same sums, so that whatever biases them biases
both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.expectation import (
    CLIP,
    SCATTERS,
    SPREAD_CLIP,
    Expected,
    across_steps,
    expectation,
    pose_weights,
)
from lidarcheck.inference.observed.extra_echoes import FalseEchoes, sides_of_surface
from lidarcheck.inference.observed.kernels import add_up, write_residuals, write_scatter
from lidarcheck.inference.observed.observations import FEATURES, Observations
from lidarcheck.inference.observed.strata import Division, divisions, fine_divisions
from lidarcheck.inference.observed.summary import Summary
from lidarcheck.workers.threads import mapped

__all__ = ["Expected", "Summaries", "Summary", "compressed", "expectation"]


_LINEAR = 4.0
"""Up to about so many standard deviations a summary counts as it is, beyond by the logarithm of its size."""
_STATISTICS = (
    *FEATURES,
    "range scatter along columns",
    "range scatter along layers",
    "area scatter",
    "width scatter",
    "detected",
)
_MEANS, _SCATTERED, _FINE_MEANS, _SPREADS = (0, 1, 2, 3, 8), (4, 5, 6, 7), (0, 1, 8), (0, 1, 8)
"""The statistics that are summed up over all covariates, over some, over the finest, and over columns of beams."""
_COLUMN = "from column to column"
_SCATTER_OVER = ("all", "range", "amplitude", "material", "point", "frame", "edge")
"""Covariates over which scatter is looked at; the means go over all."""
_MOST_SQUARE = 25.0
"""A column counts at most five standard deviations: one that is hit by chance is no spread."""
_EXTRAS = ("echoes in front", "echoes behind", "echoes without a surface")


def compressed(z: FloatArray, linear: float = _LINEAR) -> FloatArray:
    """c asinh(z / c): near zero z itself, beyond c (`linear`) its logarithm, so that a form that is wrong by a fifth
    stays near."""
    return np.asarray(linear * np.arcsinh(z / linear))


class _Sums(NamedTuple):
    """The bin of each beam in each division, counted through all of these, (divisions, n), -1 for none; their names."""

    labels: npt.NDArray[np.int32]
    bins: tuple[tuple[str, str], ...]

    def of(self, values: FloatArray, columns: Sequence[int] | IndexArray) -> FloatArray:
        """The sums of some columns of `values` (n, k) over the bins, shape (bins, columns)."""
        total = np.zeros((len(self.bins), len(columns)))
        add_up(self.labels, values, np.array(columns), total)
        return total


class Summaries:
    """Turns observations of frames into summaries, relative to what a model shows of the same frames."""

    def __init__(
        self,
        beams: BeamTable,
        base: Sequence[Observations],
        fresh: Iterable[Observations],
        materials: Mapping[int, str],
        *,
        location: bool = True,
        rates: bool = True,
        amplitude: bool = True,
    ) -> None:
        """`base`: what the model shows with some seeds, of which each beam's expectation is taken; `fresh`: with
        others, of which the summaries' own means and spreads are taken. Without `location` those of mean residuals and
        mean amplitudes are left out, without `rates` those of losses and of further echoes, without `amplitude` those
        of surfaces' amplitudes."""
        self.beams = beams
        self.expected = expectation(beams, base)
        coarse = divisions(beams, self.expected.log_area, materials)
        self._coarse = _sums(coarse)
        self._scattered = _sums([d for d in coarse if d.covariate in _SCATTER_OVER])
        self._fine = _sums(fine_divisions(beams))
        self._lines = _lines(beams, next(d for d in coarse if d.covariate == "point"))
        self._in_column = np.array([covariate == _COLUMN for covariate, _ in self._lines.bins])
        self._pose = pose_weights(beams, self.expected)
        self._strays = FalseEchoes(beams, base)
        names = [
            *_named([_STATISTICS[j] for j in _MEANS], self._coarse),
            *_named([_STATISTICS[j] for j in _SCATTERED], self._scattered),
            *_named([_STATISTICS[j] for j in _FINE_MEANS], self._fine),
            *self._line_names(),
            *_named(_EXTRAS, self._coarse),
            *self._strays.names,
        ]
        left_out = {"location": not location, "rate": not rates, "spread": False}
        told = [amplitude or one.feature not in ("area", "area scatter") for one in names]
        self._kept = np.flatnonzero(
            [tells and not left_out[_kind_of(one)] for one, tells in zip(names, told, strict=True)]
        )
        self.names = [names[i] for i in self._kept]
        values = np.array(mapped(self._sum, across_steps(beams, self.expected, fresh)))
        self._centre = values.mean(axis=0)
        counted = np.array([name.feature in (*_EXTRAS, "other echoes") for name in self.names])
        # Counts of rare echoes are Poisson; one more than expected is no surprise where none was seen.
        least = np.where(counted, np.sqrt(np.maximum(self._centre, 0.0) + 1.0), 1.0)
        self._scale = np.maximum(least, values.std(axis=0))
        self.fresh = np.array([compressed((z - self._centre) / self._scale) for z in values])

    def __len__(self) -> int:
        return len(self.names)

    def plain(self, observations: Observations) -> FloatArray:
        """The summaries in standard deviations from the model's mean, shape (n_summaries,)."""
        return np.asarray((self._sum(observations) - self._centre) / self._scale)

    def of(self, observations: Observations) -> FloatArray:
        """The compressed summaries, shape (n_summaries,)."""
        return compressed(self.plain(observations))

    def _sum(self, observations: Observations) -> FloatArray:
        """The summaries before they are standardised, in the order of `names`."""
        value, weight = _statistics(observations, self.expected)
        counts = self._extra_counts(observations)
        parts = [
            _means(value, weight, self._coarse, _MEANS),
            _means(value, weight, self._scattered, _SCATTERED),
            _means(value, weight, self._fine, _FINE_MEANS),
            self._along_lines(observations, value, weight),
            self._coarse.of(counts, range(len(_EXTRAS))).T.ravel(),
            self._strays.counts(observations),
        ]
        return np.concatenate(parts)[self._kept]

    def _along_lines(self, observations: Observations, value: FloatArray, weight: FloatArray) -> FloatArray:
        """Range residuals along the slope of the surfaces, where the beams look beside where they should, over strips
        and frames; and by how much sums over columns of beams spread, those of the residuals and of other echoes."""
        slope = self._pose
        table = np.column_stack(
            [value[:, :1] * slope, weight[:, :1] * slope**2, value[:, _SPREADS], weight[:, _SPREADS]]
        )
        total = self._lines.of(table, range(table.shape[1]))
        posed = total[:, :2] / np.sqrt(total[:, 2:4] + 1e-3)
        columns, found = self._in_column, list[float]()
        for axis in range(2):
            found += [*posed[~columns, axis], _unevenness(posed[columns, axis])]
        even = total[columns, 4:7] / np.sqrt(total[columns, 7:10] + 1.0)
        found += [_unevenness(even[:, j]) for j in range(len(_SPREADS))]
        lone = observations.extra_beam[observations.extra_side < 0]
        count = np.bincount(self._lines.labels[-1, lone] - int(np.argmax(columns)), minlength=int(columns.sum()))
        found.append(float((count**2 - count).sum() / np.sqrt(len(count) + count.sum() ** 2 / len(count))))
        return np.array(found)

    def _line_names(self) -> list[Summary]:
        """The names of what `_along_lines` finds."""
        found = []
        for name in ("elevation", "azimuth"):
            along = f"range along {name}"
            found += [Summary(along, *where) for where in self._lines.bins if where[0] != _COLUMN]
            found.append(Summary(along, _COLUMN, "spread"))
        features = [*(_STATISTICS[j] for j in _SPREADS), "other echoes"]
        return found + [Summary(name, _COLUMN, "spread") for name in features]

    def _extra_counts(self, observations: Observations) -> FloatArray:
        """Numbers of other echoes in front of, behind and without a surface, of each beam, (n, 3)."""
        lone = observations.extra_side < 0
        beam, range_m = observations.extra_beam[lone], observations.extra_m[lone]
        kind = sides_of_surface(self.beams, beam, range_m)
        cells = len(self.beams) * len(_EXTRAS)
        return np.bincount(beam * len(_EXTRAS) + kind, minlength=cells).reshape(-1, len(_EXTRAS)).astype(np.float64)


def _kind_of(one: Summary) -> Literal["location", "rate", "spread"]:
    """Whether it is a mean of a surface's echoes, a rate of losses or further echoes, or a spread."""
    of_surface = one.feature.startswith(("range", "area", "peak", "width")) and not one.feature.endswith("bloom")
    if not of_surface:
        return "rate"
    return "spread" if one.covariate == _COLUMN or "scatter" in one.feature else "location"


def _named(features: Sequence[str], sums: _Sums) -> list[Summary]:
    """The summaries of some features over all bins."""
    return [Summary(feature, *where) for feature in features for where in sums.bins]


def _means(value: FloatArray, weight: FloatArray, sums: _Sums, columns: Sequence[int]) -> FloatArray:
    """Standardised sums over the bins of values with variances `weight`, shapes (n, statistics); column by column."""
    # An echo's features are all there or none: they share a weight.
    kinds, which = np.unique(np.where(np.array(columns) < len(FEATURES), 0, columns), return_inverse=True)
    noise = np.sqrt(np.maximum(sums.of(weight, kinds), 1.0))[:, which]
    return np.asarray((sums.of(value, columns) / noise).T.ravel())


def _statistics(observations: Observations, expected: Expected) -> tuple[FloatArray, FloatArray]:
    """Per beam the statistics that are summed up, and the variance that each has by chance; shapes (n, 9)."""
    valid = observations.detected & expected.known
    value = np.zeros((len(valid), len(_STATISTICS)))
    weight = np.zeros_like(value)
    write_residuals(valid, observations.feature, expected.mean, expected.spread, CLIP, value)
    weight[:, :4] = valid[:, None]
    for j, (feature, partner) in enumerate(SCATTERS):
        mine, other = expected.partner[partner]
        moments = float(expected.square_mean[j]), float(expected.square_spread[j])
        write_scatter(valid, mine, other, feature, _SCATTERED[j], *moments, SPREAD_CLIP, value, weight)
    # A beam beside an edge may stray onto another surface, or past its own; what it loses says little of losses.
    p, sure = expected.probability, ~expected.at_edge
    value[:, 8] = np.where(sure, observations.detected - p, 0.0)
    weight[:, 8] = np.where(sure, p * (1.0 - p), 0.0)
    return value, weight


def _sums(found: Sequence[Division]) -> _Sums:
    labels, bins = [], list[tuple[str, str]]()
    for division in found:
        labels.append(np.where(division.bin >= 0, division.bin + len(bins), -1))
        bins += [(division.covariate, name) for name in division.names]
    return _Sums(np.array(labels, dtype=np.int32), tuple(bins))


def _lines(beams: BeamTable, strips: Division) -> _Sums:
    """Strips of points, frames, and last the (frame, point) columns: what is swept at one moment."""
    frames = int(beams.frame.max()) + 1
    columns = tuple(str(i) for i in range(int(beams.column.max()) + 1))
    by_frame = Division("frame", beams.frame, tuple(str(i) for i in range(frames)))
    return _sums([strips, by_frame, Division(_COLUMN, beams.column, columns)])


def _unevenness(t: FloatArray) -> float:
    """By how much standardised sums of lines spread more than by chance, in standard deviations of that."""
    return float((np.minimum(t**2, _MOST_SQUARE) - 1.0).sum() / np.sqrt(2.0 * len(t)))
