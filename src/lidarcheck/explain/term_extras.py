"""Echoes of no surface, as empirical terms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lidarcheck.effects.base import Effect, make
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.residuals import covariate
from lidarcheck.explain.term_curves import curve
from lidarcheck.model.spec import Model

__all__ = ["extras"]

_KNOTS = 12
_FEWEST, _MOST = 20.0, 9.0
"""So many more echoes than the model shows are described, and at most so many of a beam."""


def extras(lab: Lab, model: Model, covariates: Sequence[str]) -> Iterator[tuple[str, Effect]]:
    """Echoes of no surface: how often, over each of some covariates, where along the beam, and how strong."""
    measured = lab.measured_sights
    shown = [lab.sights(model, 300 + k) for k in range(2)]
    lone = measured.extra_side < 0
    there = np.bincount(measured.extra_beam[lone], minlength=len(lab.beams)).astype(np.float64)
    ours = sum(np.bincount(s.extra_beam[s.extra_side < 0], minlength=len(lab.beams)) for s in shown) / len(shown)
    excess = there - ours
    if excess.sum() < _FEWEST:
        return
    own = lab.beams.distance_m[measured.extra_beam[lone]]
    range_m, area = measured.extra_m[lone], np.exp(measured.extra_area[lone])
    places = {
        "sensor": range_m,
        "surface": (range_m - own)[own > 0.0],
        "ratio": (range_m / np.maximum(own, 1e-9))[own > 0.0],
    }
    tightest = min(
        (p for p in places if len(places[p]) > 0.8 * len(range_m)),
        key=lambda p: np.subtract(*np.quantile(places[p], [0.75, 0.25])) / max(np.ptp(places[p]), 1e-9),
    )
    knots = np.unique(np.round(np.quantile(places[tightest], np.linspace(0.0, 1.0, 9)), 2))
    if len(knots) < 2:
        knots = np.array([knots[0] - 0.05, knots[0] + 0.05])
    density = np.histogram(places[tightest], knots)[0] / np.diff(knots)
    levels = np.linspace(0.05, 0.95, 7)
    amplitude = {
        "area_quantiles": np.round(np.quantile(area, levels)),
        "peak_quantiles": np.round(np.quantile(np.exp(measured.extra_peak[lone]), levels)),
        "width_quantiles": np.round(np.quantile(measured.extra_width[lone], levels)),
    }
    shape = {"range_from": tightest, "range_knots": knots, "range_density": np.round(density / density.max(), 4)}
    for name in covariates:
        where, values = curve(covariate(lab, name), np.clip(excess, -_MOST, _MOST), np.ones(len(excess)), name, _KNOTS)
        values = np.round(np.clip(values, 0.0, _MOST), 5).astype(np.float64)
        often = {"covariate": name, "knots": np.round(where, 4), "values": values}
        yield name, make("empirical_extra", {**often, **shape, **amplitude})
