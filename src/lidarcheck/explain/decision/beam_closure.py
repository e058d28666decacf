"""Closure once more, beam by beam, of what compressed summaries say leaves too much open.

Effects' forms are never quite the sensor's. Far from the model that they are relative to, summaries say by how many
standard deviations of thousands of beams the rest is off, and not how little that is of the gap. So the effects, or the
most promising ones where none was accepted, are fitted around the model that they make, and the gap tells.
"""

from __future__ import annotations

from dataclasses import replace

from lidarcheck.effects.search import search_spec
from lidarcheck.explain.decision.closure import OPEN_BY_BEAMS, OPEN_BY_BEAMS_EDGES, Closure
from lidarcheck.explain.decision.mirror_images import only_images_stay
from lidarcheck.explain.search.merit import best_of_each_name
from lidarcheck.explain.search.refine import Judged, judged
from lidarcheck.explain.search.selection import Search, SearchData
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.wasserstein import PARTS, Scale, excesses
from lidarcheck.model.spec import Model

__all__ = ["closure_by_beam"]

_SURE = 10.0
"""A gap of fewer standard deviations of chance is too small to tell."""
_LESS = 0.5
_MOST = 2


def closure_by_beam(
    bench: SearchData, seen: Scale, search: Search, closed: Closure, seed: int
) -> tuple[Search, Closure]:
    """The search and how it closes the gap beam by beam, where it does; else both as they are.

    Where no effect was accepted, usual errors alone are asked first, and a candidate must leave less than half of what
    these do. `seen`: the frames of the fit and the selection, beam by beam.
    """
    [(before, chance)] = excesses(seen, [bench.simulator.model])
    if before < _SURE * chance:
        return search, closed
    first = search.own or judged(seen, bench.simulator.model, search.fit, seed)
    if _is_closed(first, before):
        return replace(search, own=first), Closure(before, first.left, _open(first) * before)
    if first.left > (left := _but_for_images(seen, bench.simulator.model, first)) and left <= _open(first) * before:
        return replace(search, own=first), Closure(before, left, _open(first) * before)
    if search.fit.probes:
        return search, closed
    tasks = ((seen.shared, bench.simulator.model, one, seed) for one in _promising(search))
    for own in sorted(bench.pool.map(judged, tasks), key=lambda one: one.left):
        if _is_closed(own, before) and own.left < _LESS * first.left:
            now = fit(bench.simulator, own.last.probes, own.last.x, rounds=0, nuisance=own.last.nuisance)
            return replace(search, fit=now, own=own), Closure(before, own.left, _open(own) * before)
    return search, closed


def _is_closed(own: Judged, before: float) -> bool:
    """Whether little enough is left; without an effect, by errors that are usual."""
    return own.left <= _open(own) * before and (bool(own.last.probes) or own.last.nuisance.usual)


def _but_for_images(seen: Scale, case: Model, own: Judged) -> float:
    """What is left of the gap, but for other echoes where these are of a mirror, of things that no beam meets."""
    model = own.last.model(case)
    if not only_images_stay(seen, model, own.last.nuisance):
        return own.left
    left, _ = seen.excess_by_part(model, own.last.nuisance)
    return float(left[[part != "other echoes" for part in PARTS]].sum() / len(PARTS))


def _open(own: Judged) -> float:
    """The part of the gap that may be left."""
    at_edges = any(search_spec(name).at_edges for name in own.last.names())
    return OPEN_BY_BEAMS_EDGES if at_edges else OPEN_BY_BEAMS


def _promising(search: Search) -> list[Fit]:
    """The first round's fits that gain enough, the best of each name."""
    asked = (trial for trial in search.trials if trial.round == 1 and trial.name not in search.idle)
    enough = (trial for trial in asked if trial.gain > trial.needed)
    return [trial.fit for trial in best_of_each_name(enough, by=lambda trial: trial.gain)[:_MOST]]
