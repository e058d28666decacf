"""Describing what no name explains: empirical terms, each a spline of at most two covariates, that must help elsewhere.

They are fitted to the residuals of single beams on the fit frames and kept only where they bring model and measurement
together on the select frames too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Effect, make
from lidarcheck.errors import UsageError
from lidarcheck.explain.forward import Bench
from lidarcheck.explain.gap import Scale
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.located import dimming_of
from lidarcheck.explain.nuisances import beside
from lidarcheck.model.spec import Model

__all__ = ["Description", "describe"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Told = Callable[[str, int, int], object]

_MOST_TERMS = 3
_KNOTS, _FINE_KNOTS = 12, 80
_COVARIATES = ("range_m", "layer", "point", "incidence_deg", "material_id", "signal_log10")
_WORDS = {
    "range_m": "range", "layer": "layer", "point": "point", "incidence_deg": "incidence", "material_id": "material",
    "signal_log10": "signal", "area_log10": "AREA",
}  # fmt: skip


@dataclass(frozen=True)
class Description:
    """The empirical terms that help, and what they are in words."""

    effects: tuple[Effect, ...]
    words: str


@dataclass(frozen=True, slots=True)
class _Spec:
    """A kind of term, the covariates that it is of, and how many knots it has at most."""

    term: str
    covariates: tuple[str, ...]
    knots: int = 12

    @property
    def words(self) -> str:
        """As `range over range and point`."""
        kind = "extra echoes" if self.term == "empirical_extra" else self.term.removeprefix("empirical_")
        return f"{kind} over {' and '.join(_WORDS[name] for name in self.covariates)}"


@dataclass(frozen=True)
class _Residual:
    """Values that a term should take for single beams, with weights, and the covariates there; shape (n,)."""

    term: str
    value: FloatArray
    weight: FloatArray
    rows: npt.NDArray[np.int64]
    limit: float


def describe(bench: Bench, seen: Scale, seed: int, told: Told) -> Description:
    """Add the term that helps most while one helps on the select frames, at most three of different kinds.

    The chosen kinds are then fitted again on the fit and select frames together, which cover more, and kept as long as
    they bring these, `seen`, nearer beam by beam too.
    """
    specs = _chosen(bench, told)
    if not specs:
        return Description((), "")
    lab = Lab((*bench.lab.frames, *bench.select.frames), bench.lab.model, seed)
    model = lab.model
    left = seen.excess(model)[0]
    kept: list[tuple[_Spec, Effect]] = []
    for spec in specs:
        found = _again(lab, model, spec)
        if found is None:
            continue
        nearer = _with(model, found)
        now = seen.excess(nearer)[0]
        if now < left:
            model, left = nearer, now
            kept.append((spec, found))
    return Description(tuple(effect for _, effect in kept), "; ".join(spec.words for spec, _ in kept))


def _chosen(bench: Bench, told: Told) -> list[_Spec]:
    """The kinds of terms that bring the select frames nearer, fitted on the fit frames."""
    lab, select = bench.lab, bench.select
    model, other = lab.model, select.model
    specs: list[_Spec] = []
    best = select.distance(np.zeros((1, len(select.measured))))
    for number in range(_MOST_TERMS):
        tried = list(_terms(lab, model, {spec.term for spec in specs}))
        found: list[tuple[float, _Spec, Effect]] = []
        for i, (spec, effect) in enumerate(tried):
            with contextlib.suppress(UsageError):  # a term out of its range cannot be carried
                found.append((select.distance(select.shows(_with(other, effect))), spec, effect))
            told("unknown", number * len(tried) + i + 1, _MOST_TERMS * len(tried))
        if not found or min(there for there, _, _ in found) > best - max(3.0 * bench.level, 0.02 * best):
            break
        best, spec, effect = min(found, key=lambda one: one[0])
        model, other = _with(model, effect), _with(other, effect)
        specs.append(spec)
    return specs


def _with(model: Model, effect: Effect) -> Model:
    return beside(model.without(effect.name), effect)


def _terms(lab: Lab, model: Model, taken: set[str]) -> Iterator[tuple[_Spec, Effect]]:
    """Each kind of term over its one or two best covariates, fitted to what the model leaves over."""
    for residual in _residuals(lab, model):
        if residual.term not in taken and residual.weight.sum() > 0.0:
            yield from _fitted(lab, residual)
    if "empirical_extra" not in taken:
        yield from _extras(lab, model)


def _again(lab: Lab, model: Model, spec: _Spec) -> Effect | None:
    """A kind of term fitted anew, or None where there is nothing left to fit it to."""
    if spec.term == "empirical_extra":
        return next((effect for one, effect in _extras(lab, model) if one == spec), None)
    residual = next(one for one in _residuals(lab, model) if one.term == spec.term)
    return _term(lab, residual, spec)[1] if residual.weight.sum() > 0.0 else None


def _residuals(lab: Lab, model: Model) -> Iterator[_Residual]:
    """What is left over for each kind of term, beam by beam."""
    shown = [lab.sights(model, 300 + k) for k in range(3)]
    measured, expected = lab.measured_sights, lab.summaries.expected
    count = sum(s.detected.astype(np.float64) for s in shown)
    mean = sum(s.feature for s in shown) / np.maximum(count, 1.0)[:, None]
    both = measured.detected & (count > 0)
    rows = np.flatnonzero(both)
    off = np.where(both[:, None], measured.feature - mean, 0.0)[rows].astype(np.float64)
    weight = 1.0 / expected.spread[rows] ** 2
    dimming = dimming_of(lab, mean[:, 1].astype(np.float64), both)
    yield _Residual("empirical_signal", dimming.log_gain, dimming.weight, np.arange(len(lab.beams)), 2.0)
    yield _Residual("empirical_range", np.clip(off[:, 0], -2.0, 2.0), weight[:, 0], rows, 2.0)
    yield _Residual("empirical_amplitude", np.clip(off[:, 1], -2.0, 2.0), weight[:, 1], rows, 2.0)
    sure = np.flatnonzero((count == len(shown)) & ~expected.at_edge)
    yield _Residual("empirical_loss", 1.0 - measured.detected[sure].astype(np.float64), np.ones(len(sure)), sure, 0.98)
    scatter = np.maximum(off[:, 0] ** 2 - expected.spread[rows, 0] ** 2 * (1.0 + 1.0 / len(shown)), -1.0)
    yield _Residual("empirical_spread", np.minimum(scatter, 1.0), np.minimum(weight[:, 0], 1e4) ** 2, rows, 1.0)


def _covariate(lab: Lab, name: str) -> FloatArray:
    beams = lab.beams
    if name == "signal_log10":
        return np.log10(np.maximum(beams.signal, 1e-9))
    columns = {"range_m": beams.distance_m, "layer": beams.layer, "point": beams.point,
               "incidence_deg": beams.incidence_deg, "material_id": beams.material_id}  # fmt: skip
    return np.asarray(columns[name], dtype=np.float64)


def _fitted(lab: Lab, residual: _Residual) -> Iterator[tuple[_Spec, Effect]]:
    """The term over each covariate, roughly and finely, and over the best two together."""
    ranked = []
    for name in _COVARIATES:
        u = _covariate(lab, name)[residual.rows]
        part = _at(*_curve(u, residual.value, residual.weight, name, _KNOTS), u, name)
        ranked.append((float((residual.weight * (residual.value**2 - (residual.value - part) ** 2)).sum()), name))
    ranked.sort(reverse=True)
    names = [name for _, name in ranked]
    for name in names[:3]:
        yield _term(lab, residual, _Spec(residual.term, (name,)))
        if name != "material_id":
            yield _term(lab, residual, _Spec(residual.term, (name,), _FINE_KNOTS))
    yield _term(lab, residual, _Spec(residual.term, (names[0], names[1])))


def _term(lab: Lab, residual: _Residual, spec: _Spec) -> tuple[_Spec, Effect]:
    """The additive term of one or two covariates, by backfitting."""
    names = spec.covariates
    columns = [_covariate(lab, name)[residual.rows] for name in names]
    parts = [np.zeros(len(residual.rows)) for _ in names]
    curves: list[tuple[FloatArray, FloatArray]] = [(np.zeros(1), np.zeros(1)) for _ in names]
    for _ in range(3 if len(names) > 1 else 1):
        for i, (name, u) in enumerate(zip(names, columns, strict=True)):
            rest = residual.value - sum(part for j, part in enumerate(parts) if j != i)
            curves[i] = _curve(u, rest, residual.weight, name, spec.knots)
            parts[i] = _at(*curves[i], u, name)
    settings: dict[str, object] = {}
    for suffix, name, (knots, values) in zip(("", "_2"), names, curves, strict=False):
        if residual.term == "empirical_spread":
            values = np.sqrt(np.maximum(values, 0.0)) * (1.0 if len(names) == 1 else 0.7)
        values = np.round(np.clip(values, -residual.limit, residual.limit), 5).astype(np.float64)
        settings |= {f"covariate{suffix}": name, f"knots{suffix}": np.round(knots, 4), f"values{suffix}": values}
    return spec, make(residual.term, settings)


def _curve(u: FloatArray, value: FloatArray, weight: FloatArray, name: str, most: int) -> tuple[FloatArray, FloatArray]:
    """Knots and values: weighted means, shrunk where little is known of them and 0 where nothing is."""
    if name == "material_id":
        knots = np.unique(u)
        place = np.searchsorted(knots, u)
    elif most > _KNOTS:
        # Evenly and with an empty bin at either end: what no beam has met is left as it is, not extrapolated.
        width = max(float(np.ptp(u)), 1e-3) / (most - 2)
        edges = u.min() - width + width * np.arange(most + 1)
        place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, most - 1)
        knots = 0.5 * (edges[1:] + edges[:-1])
    else:
        edges = np.unique(np.quantile(u, np.linspace(0.0, 1.0, most + 1)))
        place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, max(len(edges) - 2, 0))
        count = np.bincount(place, minlength=max(len(edges) - 1, 1))
        knots = np.bincount(place, u, len(count)) / np.maximum(count, 1)
    heft = np.bincount(place, weight, len(knots))
    values = np.bincount(place, weight * value, len(knots)) / np.maximum(heft + 0.02 * heft.mean(), 1e-12)
    keep = np.concatenate([[True], np.diff(knots) > 1e-3]) if len(knots) > 1 else np.ones(len(knots), dtype=bool)
    return knots[keep], values[keep]


def _at(knots: FloatArray, values: FloatArray, u: FloatArray, name: str) -> FloatArray:
    if name == "material_id":
        place = np.minimum(np.searchsorted(knots, u), len(knots) - 1)
        return np.where(knots[place] == u, values[place], 0.0)
    return np.asarray(np.interp(u, knots, values))


def _extras(lab: Lab, model: Model) -> Iterator[tuple[_Spec, Effect]]:
    """Echoes of no surface: how often, over the covariate that tells most, where along the beam, and how strong."""
    measured = lab.measured_sights
    shown = [lab.sights(model, 300 + k) for k in range(2)]
    lone = measured.extra_side < 0
    there = np.bincount(measured.extra_beam[lone], minlength=len(lab.beams)).astype(np.float64)
    ours = sum(np.bincount(s.extra_beam[s.extra_side < 0], minlength=len(lab.beams)) for s in shown) / len(shown)
    excess = there - ours
    if excess.sum() < 20.0:
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
    rows = np.arange(len(lab.beams))
    residual = _Residual("empirical_extra", np.clip(excess, -1.0, 1.0), np.ones(len(rows)), rows, 0.98)
    for spec, settings in _fitted_extra(lab, residual):
        shape = {"range_from": tightest, "range_knots": knots, "range_density": np.round(density / density.max(), 4)}
        yield spec, make("empirical_extra", {**settings, **shape, **amplitude})


def _fitted_extra(lab: Lab, residual: _Residual) -> Iterator[tuple[_Spec, dict[str, object]]]:
    for name in _COVARIATES:
        knots, values = _curve(_covariate(lab, name), residual.value, residual.weight, name, _KNOTS)
        values = np.round(np.clip(values, 0.0, residual.limit), 5).astype(np.float64)
        spec = _Spec("empirical_extra", (name,))
        yield spec, {"covariate": name, "knots": np.round(knots, 4), "values": values}
