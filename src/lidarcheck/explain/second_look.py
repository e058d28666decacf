"""A second look at candidates that explain the frames of the fit but seem not to hold on others.

Summaries are compressed, and blunt far from the model that they are relative to: beside one strong effect a second one
moves them little, and not always to the better. So such candidates are fitted once more around the model that they
make, and judged there beam by beam.
"""

from __future__ import annotations

from dataclasses import replace

from lidarcheck.explain.fit import Fit, fit
from lidarcheck.explain.forward import MOST_EFFECTS, Bench, Search, Trial
from lidarcheck.explain.gap import Scale
from lidarcheck.explain.polish import judged

__all__ = ["is_open", "second_look"]

_OPEN_PART, _OPEN = 0.05, 900.0
"""A search has left much open where the distance above the floor is still this part of what it was, and so much."""
_MOST = 2
_LEAST_CLOSED = 0.25
"""Another effect must close this part of the gap that the others leave beam by beam: what an effect's form leaves over
is no effect of its own."""


def is_open(bench: Bench, now: Fit) -> bool:
    """Whether the accepted effects leave so much that another may be hidden beside them."""
    left = now.distance - bench.lab.floor_distance
    most = max(_OPEN_PART * (bench.start - bench.lab.floor_distance), _OPEN)
    return 0 < len(now.probes) < MOST_EFFECTS and left > most


def second_look(bench: Bench, seen: Scale, search: Search, seed: int) -> Search:
    """The search with the candidate that closes most of what is left, or as it is where none closes enough; it then
    knows how its own fit was judged.

    `seen`: the frames of the fit and the selection, beam by beam.
    """
    tried = _unsure(search)
    if not tried:
        return search
    fits = [search.fit, *(trial.fit for trial in tried)]
    own, *others = bench.crew.map(judged, ((seen.held, bench.lab.model, one, seed) for one in fits))
    best = min(others, key=lambda one: one.left)
    if best.left >= (1.0 - _LEAST_CLOSED) * own.left:
        return replace(search, own=own)
    # Told as one of the first bench, whose frames and summaries all that follows is in.
    now = fit(bench.lab, best.last.probes, best.last.x, rounds=0, nuisance=best.last.nuisance)
    return Search(search.first, now, search.trials)


def _unsure(search: Search) -> list[Trial]:
    """The trials of the last round that gain enough and do not hold elsewhere, the best of each name."""
    best: dict[str, Trial] = {}
    for trial in search.trials:
        last = trial.round == search.trials[-1].round and trial.name not in search.fit.names()
        beside = set(search.fit.names()) <= set(trial.fit.names())
        better = trial.name not in best or trial.gain > best[trial.name].gain
        if last and beside and better and trial.gain > trial.needed and not trial.passes:
            best[trial.name] = trial
    return sorted(best.values(), key=lambda t: -t.gain)[:_MOST]
