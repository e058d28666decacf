"""Describing what no name explains: empirical terms, each a curve of at most two covariates, that must help elsewhere.

They are fitted to the residuals of single beams on the fit frames and kept only where they bring model and measurement
together on the select frames too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import make
from lidarcheck.errors import UsageError
from lidarcheck.explain.empirical.terms import Kind, again, described, terms
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.inference.nuisances import beside
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model

__all__ = ["Description", "describe"]

ProgressCallback = Callable[[str, int, int], object]

_MOST_TERMS = 5
_LEAST_PART = 0.02
"""A term must bring the select frames nearer by this part of what is left."""
_AS_NEAR = 0.01
"""Of terms that bring as much to this part, one that says more than a curve is taken."""


@dataclass(frozen=True)
class Description:
    """The empirical terms that help, and what they are in words."""

    effects: tuple[Effect, ...]
    words: str


def describe(bench: SearchData, seen: Scale, seed: int, on_progress: ProgressCallback) -> Description:
    """Add the term that helps most while one helps on the select frames, at most five of different kinds.

    The chosen kinds are then fitted again on the fit and select frames together, which cover more, and kept as long as
    they bring these, `seen`, nearer beam by beam too.
    """
    kinds = _chosen(bench, on_progress)
    if not kinds:
        return Description((), "")
    simulator = Simulator((*bench.simulator.frames, *bench.select.frames), bench.simulator.model, seed)
    model = simulator.model
    left = seen.excess(model)[0]
    words: list[str] = []
    for kind in kinds:
        found = again(simulator, model, kind)
        if found is None:
            continue
        nearer = _with(model, found)
        now = seen.excess(nearer)[0]
        if now < left:
            model, left = nearer, now
            words.append(kind.words(found))
    new = (effect for effect in model.effects if effect not in simulator.model.effects)
    return Description(tuple(new), "; ".join(words))


def _chosen(bench: SearchData, on_progress: ProgressCallback) -> list[Kind]:
    """The kinds of terms that bring the select frames nearer, fitted on the fit frames."""
    simulator, select = bench.simulator, bench.select
    model, other = simulator.model, select.model
    kinds: list[Kind] = []
    taken = described(model)
    best = select.distance(np.zeros((1, len(select.measured))))
    for number in range(_MOST_TERMS):
        tried = list(terms(simulator, model, taken | {kind.part for kind in kinds}))
        found: list[tuple[float, Kind, Effect]] = []
        for i, (kind, effect) in enumerate(tried):
            with contextlib.suppress(UsageError):  # a term out of its range cannot be carried
                found.append((select.distance(select.shows(_with(other, effect))), kind, effect))
            on_progress("unknown", number * len(tried) + i + 1, _MOST_TERMS * len(tried))
        least = min((there for there, _, _ in found), default=np.inf)
        if least > best - max(3.0 * bench.level, _LEAST_PART * best):
            break
        near = [one for one in found if one[0] < least + _AS_NEAR * (best - least)]
        best, kind, effect = min(near, key=lambda one: (one[1].shape == "spline", one[0]))
        model, other = _with(model, effect), _with(other, effect)
        kinds.append(kind)
    return kinds


def _with(model: Model, term: Effect) -> Model:
    """The model with one more term; with its functions beside those that the same effect has."""
    own = next((effect.settings() for effect in model.effects if effect.name == term.name), {})
    return beside(model.without(term.name), make(term.name, {**own, **term.settings()}))
