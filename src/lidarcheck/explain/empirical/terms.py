"""The kinds of empirical terms, and how each is fitted to what a model leaves over, beam by beam."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import make
from lidarcheck.explain.empirical.curves import at, curve, levels, repeating, rhythms, steps_of
from lidarcheck.explain.empirical.extra_echoes import extras
from lidarcheck.explain.empirical.residuals import PARTS, Residual, covariate, residuals
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model.spec import Model

__all__ = ["Kind", "again", "described", "terms"]


_KNOTS, _FINE_KNOTS = 12, 80
_COVARIATES = ("range_m", "layer", "point", "incidence_deg", "material_id", "signal_log10")
_PERIODIC = ("range_m", "layer", "point")
_LEAST_EXPLAINED = 4.0 * _KNOTS
"""A curve of so many knots explains one for each by chance; what explains less than four is not tried."""
_RHYTHMIC = 0.9
"""A wave that repeats explains as much beyond the mean, to this part, as the best curve of many knots."""
_WORDS = {
    "range_m": "range", "layer": "layer", "point": "point", "incidence_deg": "incidence", "material_id": "material",
    "signal_log10": "signal", "area_log10": "AREA", "peak_log10": "PEAK", "width_ns": "WIDTH",
}  # fmt: skip
_OWN = {"area": "area_log10", "peak": "peak_log10", "width": "width_ns"}
"""The covariate that is a part's own feature."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of term: the part of the model that it changes, the covariates that it is of, how many knots it has at
    most, and its shape: a `spline`, a wave that `repeats` with about that `period`, a `lattice` of ranges, or `levels`
    of a feature of its own."""

    part: str
    covariates: tuple[str, ...]
    knots: int = _KNOTS
    shape: str = "spline"
    period: float = 0.0

    @property
    def term(self) -> str:
        """The effect's name."""
        return f"empirical_{'amplitude' if self.part in _OWN else self.part}"

    @property
    def suffix(self) -> str:
        """What stands behind the names of the effect's fields."""
        return f"_{self.part}" if self.part in _OWN else ""

    def words(self, effect: Effect) -> str:
        """As `range over range and point`, with what a period is."""
        part = {"extra": "extra echoes"}.get(self.part, self.part.upper() if self.part in _OWN else self.part)
        over = f"{part} over {' and '.join(_WORDS[name] for name in self.covariates)}"
        if self.shape not in ("repeats", "lattice"):
            return over
        knots = effect.settings()["knots"]
        period = f"{knots[-1] - knots[0]:.3g}{' m' if self.covariates == ('range_m',) else ''}"
        return f"range in steps of {period}" if self.shape == "lattice" else f"{over}, the same every {period}"


def described(model: Model) -> set[str]:
    """The parts of which a model has terms already."""
    kinds = [Kind(part, ()) for part in PARTS]
    have = {effect.name: effect.settings() for effect in model.effects if effect.empirical}
    return {kind.part for kind in kinds if f"knots{kind.suffix}" in have.get(kind.term, {})}


def terms(simulator: Simulator, model: Model, taken: set[str]) -> Iterator[tuple[Kind, Effect]]:
    """Terms of each part that is not taken, fitted to what the model leaves over."""
    for residual in residuals(simulator, model):
        if residual.part not in taken and residual.weight.sum() > 0.0:
            for kind in _kinds(simulator, residual):
                yield kind, _fitted(simulator, residual, kind)
    if "range" not in taken and (lattice := _fitted_lattice(simulator)) is not None:
        yield lattice
    if "extra" not in taken:
        for name, effect in extras(simulator, model, _COVARIATES):
            yield Kind("extra", (name,)), effect


def again(simulator: Simulator, model: Model, kind: Kind) -> Effect | None:
    """A kind of term fitted anew, or None where there is nothing left to fit it to."""
    if kind.part == "extra":
        return next((effect for name, effect in extras(simulator, model, kind.covariates)), None)
    if kind.shape == "lattice":
        found = _fitted_lattice(simulator)
        return found and found[1]
    residual = next(one for one in residuals(simulator, model) if one.part == kind.part)
    known = residual.weight.sum() > 0.0 and not (kind.shape == "levels" and residual.all_values is None)
    return _fitted(simulator, residual, kind) if known else None


def _kinds(simulator: Simulator, residual: Residual) -> Iterator[Kind]:
    """Splines over each of the best covariates, roughly and finely, and over the best two together; what repeats; and
    levels of the feature itself. None where no covariate explains more than chance."""
    part = residual.part
    ranked = sorted(((_explained(simulator, residual, name), name) for name in _COVARIATES), reverse=True)
    if part in _OWN and residual.all_values is not None:
        yield Kind(part, (_OWN[part],), shape="levels")
    if residual.is_mean and ranked[0][0] < _LEAST_EXPLAINED:
        return
    names = [name for _, name in ranked]
    for name in names[:3]:
        yield Kind(part, (name,))
        if name != "material_id":
            yield Kind(part, (name,), _FINE_KNOTS)
    if part not in _OWN:
        yield Kind(part, (names[0], names[1]))
    if part in ("range", "signal"):
        level = residual.explained_by_mean()
        least = level + max(_RHYTHMIC * (ranked[0][0] - level), _LEAST_EXPLAINED)
        for name in _PERIODIC:
            u = covariate(simulator, name)[residual.rows]
            for period, explained in rhythms(u, residual.value, residual.weight, name):
                if explained > least:
                    yield Kind(part, (name,), shape="repeats", period=period)


def _explained(simulator: Simulator, residual: Residual, name: str) -> float:
    """How much of what is left over a rough curve over a covariate explains, in squares of standard deviations."""
    u, value = covariate(simulator, name)[residual.rows], residual.value
    part = at(*curve(u, value, residual.weight, name, _KNOTS), u, name)
    return float((residual.weight * (value**2 - (value - part) ** 2)).sum())


def _fitted(simulator: Simulator, residual: Residual, kind: Kind) -> Effect:
    """The term of a kind, fitted to what is left over."""
    if kind.shape == "levels":
        assert residual.all_values is not None
        return _made(kind, residual, [levels(kind.covariates[0], *residual.all_values)])
    if kind.shape == "repeats":
        name = kind.covariates[0]
        u = covariate(simulator, name)[residual.rows]
        return _made(kind, residual, [repeating(u, residual.value, residual.weight, name, kind.period)])
    return _made(kind, residual, _backfitted(simulator, residual, kind))


def _backfitted(simulator: Simulator, residual: Residual, kind: Kind) -> list[tuple[FloatArray, FloatArray]]:
    """The additive curves of one or two covariates."""
    names = kind.covariates
    columns = [covariate(simulator, name)[residual.rows] for name in names]
    parts = [np.zeros(len(residual.rows)) for _ in names]
    curves: list[tuple[FloatArray, FloatArray]] = [(np.zeros(1), np.zeros(1)) for _ in names]
    for _ in range(3 if len(names) > 1 else 1):
        for i, (name, u) in enumerate(zip(names, columns, strict=True)):
            rest = residual.value - sum(part for j, part in enumerate(parts) if j != i)
            curves[i] = curve(u, rest, residual.weight, name, kind.knots)
            parts[i] = at(*curves[i], u, name)
    return curves


def _made(kind: Kind, residual: Residual, curves: list[tuple[FloatArray, FloatArray]]) -> Effect:
    """The effect of some curves, which are of variances where the part scatters."""
    settings: dict[str, object] = {}
    suffixes = (kind.suffix, "_2")
    for suffix, name, (knots, values) in zip(suffixes, kind.covariates, curves, strict=False):
        if residual.is_variance:
            values = np.sqrt(np.maximum(values, 0.0)) * (1.0 if len(curves) == 1 else 0.7)
        values = np.round(np.clip(values, -residual.limit, residual.limit), 5).astype(np.float64)
        knots = np.round(knots, 4)
        apart = np.append(True, np.diff(knots) > 0.0)  # of those that a file would not tell apart the first
        settings |= {f"covariate{suffix}": name, f"knots{suffix}": knots[apart], f"values{suffix}": values[apart]}
    if kind.shape == "repeats":
        settings["beyond"] = "repeats"
    return make(kind.term, settings)


def _fitted_lattice(simulator: Simulator) -> tuple[Kind, Effect] | None:
    """Ranges on the steps of a coarse scale: the nearest of these, wherever the measured ones stand on some."""
    found = steps_of(np.concatenate([frame.measured.range_m for frame in simulator.frames]))
    if found is None:
        return None
    first_m, step_m = found
    knots = np.round([first_m - 0.5 * step_m, first_m + 0.5 * step_m], 6)
    values = np.round([0.5 * step_m, -0.5 * step_m], 6)
    settings = {"covariate": "range_m", "knots": knots, "values": values, "beyond": "repeats"}
    return Kind("range", ("range_m",), shape="lattice"), make("empirical_range", settings)
