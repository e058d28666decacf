"""What a model leaves over, beam by beam, for each part of it that an empirical term can change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.explain.search.evidence import dimming_of
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model.spec import Model

__all__ = ["PARTS", "Residual", "covariate", "residuals"]


PARTS = ("signal", "flicker", "range", "amplitude", "area", "peak", "width", "loss", "spread", "extra")
"""The parts of a model that terms change: the light, its scatter, the echoes' ranges and features, losses, extras."""
_SEEDS = 3
_ENOUGH = 200
"""Of so many echoes a distribution is told level by level."""
_FEATURES = {"area": 1, "peak": 2, "width": 3}


@dataclass(frozen=True)
class Residual:
    """What a term should be for single beams, with weights, and the beams' rows; shape (n,). `limit`: of its values.

    `is_mean`: weights are of one over a variance, so that squares count standard deviations. `is_variance`: values are
    squares of what the term should be. `all_values`: of a feature itself, as simulated and as measured.
    """

    part: str
    value: FloatArray
    weight: FloatArray
    rows: npt.NDArray[np.int64]
    limit: float
    is_mean: bool = True
    is_variance: bool = False
    all_values: tuple[FloatArray, FloatArray] | None = None

    def explained_by_mean(self) -> float:
        """What the same value everywhere explains, in squares of standard deviations."""
        return float((self.weight * self.value).sum() ** 2 / max(self.weight.sum(), 1e-9))


def covariate(simulator: Simulator, name: str) -> FloatArray:
    """A covariate of all beams of a lab, (n_beams,)."""
    beams = simulator.beams
    if name == "signal_log10":
        return np.log10(np.maximum(beams.signal, 1e-9))
    columns = {"range_m": beams.distance_m, "layer": beams.layer, "point": beams.point,
               "incidence_deg": beams.incidence_deg, "material_id": beams.material_id}  # fmt: skip
    return np.asarray(columns[name], dtype=np.float64)


def residuals(simulator: Simulator, model: Model) -> Iterator[Residual]:
    """What is left over for each part, beam by beam."""
    shown = [simulator.observations(model, 300 + k) for k in range(_SEEDS)]
    measured, expected = simulator.measured_observations, simulator.summaries.expected
    count = sum(s.detected.astype(np.float64) for s in shown)
    mean = sum(s.feature for s in shown) / np.maximum(count, 1.0)[:, None]
    both = measured.detected & (count > 0)
    rows = np.flatnonzero(both)
    off = np.where(both[:, None], measured.feature - mean, 0.0)[rows].astype(np.float64)
    weight = 1.0 / expected.spread[rows] ** 2
    dimming = dimming_of(simulator, mean[:, 1].astype(np.float64), both)
    yield Residual("signal", dimming.log_gain, dimming.weight, np.arange(len(simulator.beams)), 2.0)
    yield Residual("range", np.clip(off[:, 0], -2.0, 2.0), weight[:, 0], rows, 2.0)
    yield Residual("amplitude", np.clip(off[:, 1], -2.0, 2.0), weight[:, 1], rows, 2.0)
    seen = np.flatnonzero(measured.detected & (count == len(shown)))
    for part, j in _FEATURES.items():
        limit = 100.0 if part == "width" else 2.0
        # Of beams that all have seen: with those of faint ones in some, distributions would differ by what is lost.
        values = np.concatenate([s.feature[seen, j] for s in shown]).astype(np.float64)
        known = measured.feature[seen, j].astype(np.float64)
        both_ways = (values, known) if len(seen) >= _ENOUGH else None
        yield Residual(part, np.clip(off[:, j], -limit, limit), weight[:, j], rows, limit, all_values=both_ways)
    sure = np.flatnonzero((count == len(shown)) & ~expected.at_edge)
    lost = 1.0 - measured.detected[sure].astype(np.float64)
    yield Residual("loss", lost, np.ones(len(sure)), sure, 0.98, is_mean=False)
    noise = expected.spread[rows, 0] ** 2 * (1.0 + 1.0 / len(shown))
    scatter = np.clip(off[:, 0] ** 2 - noise, -1.0, 1.0)
    strength = np.minimum(weight[:, 0], 1e4) ** 2
    yield Residual("spread", scatter, strength, rows, 1.0, is_mean=False, is_variance=True)
    known = np.flatnonzero(both & (dimming.weight > 0.0))
    heft = dimming.weight[known]
    flicker = np.clip(dimming.log_gain[known] ** 2 - (1.0 + 1.0 / len(shown)) / heft, -1.0, 2.0)
    yield Residual("flicker", flicker, np.minimum(heft, 100.0) ** 2, known, 2.0, is_mean=False, is_variance=True)
