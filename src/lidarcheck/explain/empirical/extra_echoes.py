"""Echoes of no surface, as empirical terms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import find, make
from lidarcheck.explain.empirical.curves import curve
from lidarcheck.explain.empirical.residuals import covariate
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model.spec import Model

__all__ = ["extras"]


_KNOTS = 12
_CELLS = 32
"""The echoes that a model shows are taken off in so many cells of their place."""
_MEET = 0.8
"""Echoes may be placed by the surface of their beam where this part of them has one."""
_FEWEST, _MOST = 20.0, 9.0
"""So many more echoes than the model shows are described, and at most so many of a beam."""


def extras(simulator: Simulator, model: Model, covariates: Sequence[str]) -> Iterator[tuple[str, Effect]]:
    """Echoes of no surface: how often, over each of some covariates, where along the beam, and how strong."""
    measured = simulator.measured_observations
    shown = [simulator.observations(model, 300 + k) for k in range(2)]
    lone = measured.extra_side < 0
    there = np.bincount(measured.extra_beam[lone], minlength=len(simulator.beams)).astype(np.float64)
    ours = sum(np.bincount(s.extra_beam[s.extra_side < 0], minlength=len(simulator.beams)) for s in shown) / len(shown)
    excess = there - ours
    if excess.sum() < _FEWEST:
        return
    places, known = _places(simulator, measured), [_places(simulator, s) for s in shown]
    new = {p: _new(v, [k[p] for k in known]) for p, v in places.items() if np.isfinite(v).mean() > _MEET}
    weights = {p: weight for p, weight in new.items() if weight.any()}
    if not weights:
        return
    tightest = min(weights, key=lambda p: _width(places[p], weights[p]))
    weight = weights[tightest]
    knots = np.unique(np.round(_quantiles(places[tightest], weight, np.linspace(0.0, 1.0, 9)), 3))
    if len(knots) < 2:
        knots = np.array([knots[0] - 0.05, knots[0] + 0.05])
    density = np.histogram(places[tightest], knots, weights=weight)[0] / np.diff(knots)
    levels = np.linspace(0.05, 0.95, 7)
    features = {
        "area_quantiles": np.exp(measured.extra_area[lone]),
        "peak_quantiles": np.exp(measured.extra_peak[lone]),
        "width_quantiles": measured.extra_width[lone],
    }
    within = {one.name: (one.low, one.high) for one in find("empirical_extra").lists()}
    # A linear detector's amplitudes are in units of its own, and may be larger than any count.
    amplitude = {
        name: np.clip(np.round(_quantiles(value, weight, levels)), *within[name]) for name, value in features.items()
    }
    shape = {"range_from": tightest, "range_knots": knots, "range_density": np.round(density / density.max(), 4)}
    for name in covariates:
        where, values = curve(
            covariate(simulator, name), np.clip(excess, -_MOST, _MOST), np.ones(len(excess)), name, _KNOTS
        )
        values = np.round(np.clip(values, 0.0, _MOST), 5).astype(np.float64)
        often = {"covariate": name, "knots": np.round(where, 4), "values": values}
        yield name, make("empirical_extra", {**often, **shape, **amplitude})


def _places(simulator: Simulator, observations: Observations) -> dict[str, FloatArray]:
    """Where the echoes of no surface are: from the sensor, behind the beam's surface and in multiples of its range, NaN
    for beams that meet none; each of shape (m,)."""
    lone = observations.extra_side < 0
    range_m, own = observations.extra_m[lone], simulator.beams.distance_m[observations.extra_beam[lone]]
    own = np.where(own > 0.0, own, np.nan)
    return {"sensor": range_m, "surface": range_m - own, "ratio": range_m / own}


def _new(value: FloatArray, shown: Sequence[FloatArray]) -> FloatArray:
    """What part of the echoes around each of some values the model does not show, same shape; 0 for NaN."""
    edges = np.unique(np.nanquantile(value, np.linspace(0.0, 1.0, _CELLS + 1)))
    place = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, max(len(edges) - 2, 0))
    here = np.isfinite(value)
    count = np.bincount(place[here], minlength=len(edges))
    inside = (other[(other >= edges[0]) & (other <= edges[-1])] for other in shown)
    cells = [np.clip(np.searchsorted(edges, o, side="right") - 1, 0, max(len(edges) - 2, 0)) for o in inside]
    ours = sum(np.bincount(cell, minlength=len(edges)) for cell in cells) / len(shown)
    part = np.clip(1.0 - ours / np.maximum(count, 1), 0.0, 1.0)
    return np.where(here, part[place], 0.0)


def _width(value: FloatArray, weight: FloatArray) -> float:
    """How wide the middle half of the weighted values is, in parts of the whole."""
    low, first, last, high = _quantiles(value, weight, np.array([0.0, 0.25, 0.75, 1.0]))
    return float((last - first) / max(high - low, 1e-9))


def _quantiles(value: FloatArray, weight: FloatArray, levels: FloatArray) -> FloatArray:
    """The weighted values' quantiles at levels, same shape."""
    used = weight > 0.0
    order = np.argsort(value[used])
    below = np.cumsum(weight[used][order])
    return np.asarray(np.interp(levels * below[-1], below - 0.5 * weight[used][order], value[used][order]))
