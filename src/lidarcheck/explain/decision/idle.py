"""Names that say nothing: effects of no strength, and such as do not pay on the select frames.

A fit may end where an effect is all but gone, and one that was accepted beside others may have been needed only until
these had been fitted again. A name must still do, where all is fitted, what it had to do to be accepted.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.search import without
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.explain.search.trial import on_select, select_shown
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.workers.threads import done_by

__all__ = ["idle_names", "needless_on_select", "weak_names", "without_idle"]


def idle_names(bench: SearchData, now: Fit, last: Polished) -> dict[int, str]:
    """The places of names that are to be left out, each with what speaks against it."""
    found = dict.fromkeys(weak_names(bench, last), "it is too weak to be told from no effect")
    places = needless_on_select(bench, now) if len(now.probes) > 1 else []
    return {**dict.fromkeys(places, "on the select frames it does not pay"), **found}


def weak_names(bench: SearchData, last: Polished) -> list[int]:
    """The places of effects of no strength: where the last fit has ended, they change the summaries by no more than
    the largest of all candidates would gain by chance."""
    now, simulator = last.last, last.simulator
    model, own = now.model(simulator.model), {effect.name: effect for effect in bench.simulator.model.effects}
    found = []
    for at, name in enumerate(now.names()):
        # The lab is around the model that has them all; the case's own may have had one of that name.
        plain = model.with_(own[name]) if name in own else model.without(name)
        change = now.shown.mean(axis=0) - simulator.shows(plain, nuisance=now.nuisance).mean(axis=0)
        if simulator.metric.square(change) <= bench.level:
            found.append(at)
    return found


def needless_on_select(bench: SearchData, now: Fit) -> list[int]:
    """The places of effects that do not hold on the select frames, by the rule by which they were accepted, against a
    fit of all others without them."""
    fewer = done_by(bench.pool, without, [(bench.simulator.shared, now, at) for at in range(len(now.probes))])
    return [at for at, one in enumerate(fewer) if not _holds(bench, now, at, one)]


def _holds(bench: SearchData, now: Fit, at: int, fewer: Fit) -> bool:
    """Whether the select frames bear out what one of the effects explains on those of the fit."""
    before = select_shown(bench.select, fewer)
    order = [*(k for k in range(len(now.probes)) if k != at), at]
    last = replace(now, probes=tuple(now.probes[k] for k in order), x=tuple(now.x[k] for k in order), jacobian=None)
    _, after, change, edges, own = on_select(bench.select, before, last)
    gain, distance = fewer.distance - now.distance, bench.select.distance(before)
    floor = bench.select.floor_distance
    asked = FittedCandidate(now.names()[at], 0, last, gain, bench.level, distance, after, change, edges, own, floor)
    return asked.holds


def without_idle(bench: SearchData, now: Fit, places: Iterable[int]) -> Fit:
    """The fit without the effects of some places."""
    for at in sorted(places, reverse=True):
        now = without(bench.simulator, now, at)
    return now
