"""Closure once more, beam by beam, of what compressed summaries say leaves too much open.

Effects' forms are never quite the sensor's. Far from the model that they are relative to, summaries say by how many
standard deviations of thousands of beams the rest is off, and not how little that is of the gap. So the effects, or the
most promising ones where none was accepted, are fitted around the model that they make, and the gap tells.
"""

from __future__ import annotations

from dataclasses import replace

from lidarcheck.explain.fit import Fit
from lidarcheck.explain.forward import Bench, Search
from lidarcheck.explain.gap import Scale, excesses
from lidarcheck.explain.polish import judged
from lidarcheck.explain.verdict import AT_EDGES, OPEN_BY_BEAMS, OPEN_BY_BEAMS_EDGES, Closure

__all__ = ["appeal"]

_SURE = 10.0
"""A gap of fewer standard deviations of chance is too small to tell."""
_MOST = 2


def appeal(bench: Bench, seen: Scale, search: Search, closed: Closure, seed: int) -> tuple[Search, Closure]:
    """The search and how it closes the gap beam by beam, where it does; else both as they are.

    `seen`: the frames of the fit and the selection, beam by beam.
    """
    fits = [search.fit] if search.fit.probes else _promising(search)
    [(before, chance)] = excesses(seen, [bench.lab.model])
    if not fits or before < _SURE * chance:
        return search, closed
    known = search.own if search.own is not None and search.fit.probes else None
    own = [known] if known else [*bench.crew.map(judged, ((seen.held, bench.lab.model, one, seed) for one in fits))]
    best = min(range(len(own)), key=lambda i: own[i].left)
    at_edges = any(name in AT_EDGES for name in fits[best].names())
    found = Closure(before, own[best].left, (OPEN_BY_BEAMS_EDGES if at_edges else OPEN_BY_BEAMS) * before)
    return (replace(search, fit=fits[best], own=own[best]), found) if found.holds else (search, closed)


def _promising(search: Search) -> list[Fit]:
    """The first round's fits that gain enough, the best of each name."""
    best: dict[str, tuple[float, Fit]] = {}
    for trial in search.trials:
        enough = trial.round == 1 and trial.gain > trial.needed
        if enough and trial.gain > best.get(trial.name, (0.0,))[0]:
            best[trial.name] = (trial.gain, trial.fit)
    return [one for _, one in sorted(best.values(), key=lambda found: -found[0])[:_MOST]]
