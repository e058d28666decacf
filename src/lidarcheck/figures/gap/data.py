"""The tables of numbers that the pictures of a gap are drawn from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray

__all__ = ["FEWEST", "SEEDS", "Z_90", "Detected", "FieldMap", "Histogram", "Pictures", "ResidualCurve"]


SEEDS = 2
"""Simulations of each model that the measurement is compared with."""
FEWEST = 5
"""Beams or echoes that a number in a curve or a map must stand for."""
Z_90 = 1.6448536269514722
"""Half the width of a 90 % interval of normal numbers, in standard deviations."""


@dataclass(frozen=True)
class Histogram:
    """How often values of a feature occur: echoes a frame in the bins between `edges`.

    `edges` (k + 1,); `measured`, `before`, `after` (k,). The first and the last bin also hold what lies beyond.
    """

    feature: str
    words: str
    unit: str
    edges: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    log_x: bool = False


@dataclass(frozen=True)
class ResidualCurve:
    """Residuals, measured less simulated, of echoes of the same beams, over the bins of a covariate.

    `bins`: k names; `count` (k,): residuals in each, of both seeds; `before`, `after` (k, 3): their 10 %, 50 % and
    90 % quantiles, NaN where there are fewer than five.
    """

    feature: str
    words: str
    unit: str
    covariate: str
    bins: tuple[str, ...]
    count: IndexArray
    before: FloatArray
    after: FloatArray

    @property
    def clearness(self) -> float:
        """How clearly the median before is off zero: root mean square over the bins, in its standard errors."""
        spread = np.maximum(self.before[:, 2] - self.before[:, 0], 1e-9) / 2.563
        with np.errstate(invalid="ignore"):
            off = self.before[:, 1] / (1.2533 * spread / np.sqrt(np.maximum(self.count / SEEDS, 1.0)))
        off = off[np.isfinite(off)]
        return float(np.sqrt(np.mean(off**2))) if len(off) else 0.0


@dataclass(frozen=True)
class Detected:
    """Share of the beams that meet a surface and have an echo on it, 0 ... 1, over the bins of a covariate.

    `measured` (k, 3): the share and its 90 % Wilson interval's ends; `before`, `after` (k,): as simulated; NaN in bins
    of fewer than five beams. `count` (k,): measured beams.
    """

    covariate: str
    bins: tuple[str, ...]
    count: IndexArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray

    @property
    def clearness(self) -> float:
        """How clearly the simulation before misses the measured share, in standard errors, over the bins."""
        half = np.maximum(self.measured[:, 2] - self.measured[:, 1], 1e-9) / (2.0 * Z_90)
        off = (self.measured[:, 0] - self.before) / half
        off = off[np.isfinite(off)]
        return float(np.sqrt(np.mean(off**2))) if len(off) else 0.0


@dataclass(frozen=True)
class FieldMap:
    """A difference, measured less simulated, over the field of view in blocks of layers (r) and points (c).

    `layers`, `points`: first and last of each block, ascending; `before`, `after` (r, c), NaN where a block has fewer
    than five beams or echoes to compare. `elevation_deg`, `azimuth_deg`: of the first and of the last layer, and point.
    """

    quantity: str
    words: str
    unit: str
    layers: tuple[tuple[int, int], ...]
    points: tuple[tuple[int, int], ...]
    before: FloatArray
    after: FloatArray
    elevation_deg: tuple[float, float]
    azimuth_deg: tuple[float, float]


@dataclass(frozen=True)
class Pictures:
    """All numbers of a report's pictures; `frames` are the numbers of the frames, `seeds` those simulated with."""

    frames: tuple[int, ...]
    seeds: tuple[int, ...]
    histograms: tuple[Histogram, ...]
    curves: tuple[ResidualCurve, ...]
    detected: tuple[Detected, ...]
    maps: tuple[FieldMap, ...]

    @property
    def changed(self) -> bool:
        """Whether the model after shows anything else than the one before."""
        return not all(np.array_equal(h.before, h.after) for h in self.histograms) or not all(
            np.array_equal(m.before, m.after, equal_nan=True) for m in self.maps
        )
