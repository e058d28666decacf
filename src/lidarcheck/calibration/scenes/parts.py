"""KPIs of the parts of a scene: of each object, of each sector of the view, of each layer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.scenes.groups import Sectors, UnitGroups, sector_of
from lidarcheck.calibration.scenes.rank import Ranking
from lidarcheck.calibration.scenes.units import NOTHING, Units, Values, features_in
from lidarcheck.kpi.distances import wasserstein

__all__ = ["Part", "SectorMap", "by_layer", "finite", "layer_angles_deg", "parts_of", "sectors_of"]

FEWEST_IN_SECTOR = 12


@dataclass(frozen=True)
class Part:
    """KPIs of one object (or material, or surface): all NaN where they are not defined.

    `beams`: that meet it; `echo_measured`, `echo_simulated`: the share of them with an echo from it; `range_bias_m`,
    `area_ratio`: mean difference, and ratio of the geometric means, on the beams that
    have its echo in both; `wasserstein`: by feature;
    `stray_measured`, `stray_simulated`: stray echoes a beam; `strength`: of its largest disagreement, 0 where
    it is within what chance gives.
    """

    name: str
    beams: int
    distance_m: float
    echo_measured: float
    echo_simulated: float
    range_bias_m: float
    area_ratio: float
    stray_measured: float
    stray_simulated: float
    wasserstein: Mapping[str, float]
    strength: float


@dataclass(frozen=True)
class SectorMap:
    """KPIs of each sector, shapes (rows, columns), NaN where fewer than 12 beams tell: measured minus simulated."""

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    beams: IndexArray
    echo_difference: FloatArray
    stray_difference: FloatArray
    range_bias_m: FloatArray
    area_ratio: FloatArray
    strength: FloatArray


def finite(column: FloatArray) -> FloatArray:
    """The values that are numbers."""
    return column[np.isfinite(column)]


class _Means:
    """Means of the features over the groups of a division, measured and simulated."""

    def __init__(self, index: IndexArray, groups: int, m: Values, a: Values) -> None:
        self.index, self.groups, self.m, self.a = index, groups, m, a

    def of(self, feature: str, values: Values) -> FloatArray:
        """Shape (n_groups,), NaN without a value."""
        if feature not in values.of:
            return np.full(self.groups, np.nan)
        return self._mean(values.of[feature])

    def difference(self, feature: str) -> FloatArray:
        """Measured minus simulated, over the units that have both: others would tell which echoes are lost."""
        if feature not in self.m.of or feature not in self.a.of:
            return np.full(self.groups, np.nan)
        return self._mean(self.m.of[feature] - self.a.of[feature])

    def _mean(self, column: FloatArray) -> FloatArray:
        some = np.isfinite(column) & (self.index >= 0)
        n = np.bincount(self.index[some], minlength=self.groups)
        total = np.bincount(self.index[some], weights=column[some], minlength=self.groups)
        return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def parts_of(kind: UnitGroups, units: Units, m: Values, a: Values, ranking: Ranking) -> tuple[Part, ...]:
    """KPIs of every object, the largest first."""
    means = _Means(kind.index, len(kind.names), m, a)
    order = np.argsort(kind.index, kind="stable")
    borders = np.searchsorted(kind.index[order], np.arange(len(kind.names) + 1))
    echo, false_echo = ([means.of(name, values) for values in (m, a)] for name in ("echo", "stray"))
    bias, log_ratio = means.difference("range_residual"), means.difference("log10_area")
    rows = []
    for i, name in enumerate(kind.names):
        own = order[borders[i] : borders[i + 1]]
        if not len(own):
            continue
        distances = {
            f.name: wasserstein(finite(m.of[f.name][own]), finite(a.of[f.name][own]))
            for f in features_in(m, a)
            if not f.counts
        }
        part = Part(
            name, len(own), float(np.median(units.distance_m[own])), float(echo[0][i]), float(echo[1][i]),
            float(bias[i]), float(10.0 ** log_ratio[i]), float(false_echo[0][i]), float(false_echo[1][i]), distances,
            float(ranking.strength[kind.name][i]),
        )  # fmt: skip
        rows.append(part)
    return tuple(sorted(rows, key=lambda part: -part.beams))


def sectors_of(units: Units, edges: Sectors, m: Values, a: Values, ranking: Ranking) -> SectorMap:
    """KPIs of every sector."""
    row, column = sector_of(units, edges)
    cells = edges.shape[0] * edges.shape[1]
    index = row * edges.shape[1] + column
    means = _Means(index, cells, m, a)
    beams = np.bincount(index[units.first], minlength=cells)

    def cell(values: FloatArray, least: FloatArray | IndexArray = beams) -> FloatArray:
        return np.where(least >= FEWEST_IN_SECTOR, values, np.nan).reshape(edges.shape)

    met = np.bincount(index[units.label != NOTHING], minlength=cells)
    return SectorMap(
        azimuth_deg=edges.azimuth_deg,
        elevation_deg=edges.elevation_deg,
        beams=beams.reshape(edges.shape),
        echo_difference=cell(means.difference("echo"), met),
        stray_difference=cell(means.difference("stray")),
        range_bias_m=cell(means.difference("range_residual"), met),
        area_ratio=cell(10.0 ** means.difference("log10_area"), met),
        strength=cell(ranking.strength["sector"]),
    )


def by_layer(units: Units, m: Values, a: Values) -> FloatArray:
    """Share of beams with an echo from their surface, measured and simulated; shape (2, n_layers)."""
    means = _Means(units.layer, int(units.layer.max(initial=0)) + 1, m, a)
    return np.stack([means.of("echo", m), means.of("echo", a)])


def layer_angles_deg(units: Units) -> FloatArray:
    """Elevation of each layer up to the last one that was fired [deg], shape (n_layers,)."""
    layer = np.arange(int(units.layer.max(initial=0)) + 1)
    return units.beams.angles_deg(layer, np.zeros_like(layer))[0]
