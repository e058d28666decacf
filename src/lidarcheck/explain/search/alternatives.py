"""Other ways through the search, where the one on which the best of each round is accepted leaves much open.

Of several missing effects the first round may accept none, but one that does a little of what each of them does: echoes
of another sensor for those of crosstalk and of drops. Beside it the right ones explain little, and are not found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from lidarcheck.explain.decision.closure import closure
from lidarcheck.explain.progress import ignore_progress
from lidarcheck.explain.search.merit import CHANCE, FittedCandidate, best_of_each_name
from lidarcheck.explain.search.related import are_related
from lidarcheck.explain.search.screening import Screened
from lidarcheck.explain.search.search import backward, without
from lidarcheck.explain.search.selection import FitProgress, Search, SearchData, accept, onward
from lidarcheck.explain.search.trial import select_distance
from lidarcheck.inference.effect_fit import Fit

__all__ = ["other_ways", "try_alternatives", "with_fewer_related"]

_OPEN, _OPEN_CLOSED = 0.06, 0.15
"""Where less than this part is left open, on the frames of the fit and the selection, nothing else is tried; nor where
less than the larger one is, if that may be what the effects' forms leave."""
_MOST, _PROMISING = 2, 0.25
"""So many of the first round's others are begun with, of those with such a part of the merit of the one accepted."""
_NEARER, _SIMPLER = 0.6, 0.9
"""Another way must leave no more than this part of what is open, for each effect that it needs more; or, with fewer
effects, that part."""


def try_alternatives(
    bench: SearchData, found: Search, screened: Sequence[Screened], on_progress: FitProgress
) -> Search:
    """The search that begins with another effect than the best of the first round, where that leads much nearer."""
    left = _left(bench, found.fit)
    first = max((t for t in found.trials if t.round == 1 and t.passes), key=lambda t: t.merit, default=None)
    open_ = left / max(_left(bench, found.first), 1.0)
    if first is None or left < 2.0 * CHANCE or open_ < _OPEN:
        return found
    if open_ < _OPEN_CLOSED and closure(bench, found.fit, found.trials).holds:
        return found
    nearest = found
    for way in other_ways(bench, found, screened, on_progress):
        there, more = _left(bench, way.fit), len(way.fit.probes) - len(nearest.fit.probes)
        if there < (_SIMPLER if more < 0 else _NEARER ** max(more, 1)) * left:
            nearest, left = way, there
    return nearest


def other_ways(
    bench: SearchData, found: Search, screened: Sequence[Screened], on_progress: FitProgress
) -> Iterator[Search]:
    """The searches that begin with another effect than the best of the first round, and go on without that one."""
    first = max((t for t in found.trials if t.round == 1 and t.passes), key=lambda t: t.merit, default=None)
    if first is None:
        return
    rest = [one for one in screened if one.probe.name != first.name]
    began = [t for t in found.trials if t.round == 1]
    ways = _others(found, first)
    for i, trial in enumerate(ways):
        on_progress("detour", i, len(ways))
        way = next((known for begun, known in bench.ways if begun is trial), None)
        if way is None:
            way = onward(bench, accept(bench, Search(found.first, found.first, [*began]), trial), rest, ignore_progress)
            way.fit = backward(bench, way.fit, ignore_progress)
            bench.ways.append((trial, way))
        yield replace(way)


def _others(found: Search, first: FittedCandidate) -> list[FittedCandidate]:
    """The best trial of each other name of the first round, the best names first."""
    least = _PROMISING * first.merit
    others = (t for t in found.trials if t.round == 1 and t.passes and t.name != first.name and t.merit > least)
    return best_of_each_name(others)[:_MOST]


def _left(bench: SearchData, now: Fit) -> float:
    """What a fit leaves open on the frames of the fit and of the selection."""
    there = select_distance(bench.select, now) - bench.select.floor_distance
    return now.distance - bench.simulator.floor_distance + there


def with_fewer_related(bench: SearchData, found: Search) -> Iterator[Search]:
    """The search without the later one of two effects that change the same features in the same way."""
    names = found.fit.names()
    for later, name in enumerate(names):
        if any(are_related(name, earlier) for earlier in names[:later]):
            yield Search(found.first, without(bench.simulator, found.fit, later), found.trials)
