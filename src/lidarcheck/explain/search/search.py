"""The search for what is missing: nuisances, effects round by round, and leaving out again what is not needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.effects.search import search_spec
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.merit import CHANCE, PRICE, FittedCandidate
from lidarcheck.explain.search.related import are_related
from lidarcheck.explain.search.screening import Screened
from lidarcheck.explain.search.selection import RELATED_PART, SMALL, FitProgress, Search, SearchData, forward, start_fit
from lidarcheck.explain.search.substitution import others_of
from lidarcheck.explain.search.trial import TO_THE_END, finished, select_distance
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers.threads import done_by

__all__ = ["DOUBTFUL", "backward", "find_effects", "without"]

DOUBTFUL = 40.0
"""A start of fewer floors than this may be all nuisance; that is asked first. Where ranges scatter by millimetres, half
a centimetre of height alone makes it 12."""
_STANDS_OUT = 6.0
"""What one effect explains of a rest that is small enough for chance is none where it is so many times chance's: of
four nulls, two with nuisances, it was up to 3.3."""
_BESIDE_USUAL = 0.4
"""Beside usual errors an effect must explain this part of what chance may leave. Of six true ones that were fitted
beside such, the least explained 0.9 of it; one column of a scan without any effect, as a blockage, 0.2."""


def find_effects(bench: SearchData, screened: Sequence[Screened], on_progress: FitProgress) -> Search:
    """The whole search: none where nuisances explain all; else forward and backward, and where nothing stays once more
    with the nuisances first: a name that these explain as well may have hidden another."""
    if bench.start < DOUBTFUL * bench.simulator.floor_distance:
        off = start_fit(bench.simulator, nuisances=True)
        if _all_nuisance(bench, off, screened):
            return Search(off, off)
    first = start_fit(bench.simulator)
    found = _search_from(_beside_usual(bench, first), first, screened, on_progress)
    if not found.fit.probes and found.first.nuisance.penalty == 0.0:
        trials, off = found.trials, start_fit(bench.simulator, nuisances=True)
        found = _search_from(_beyond(bench, off), off, screened, on_progress)
        found.trials = trials + found.trials
    return found


def _beside_usual(bench: SearchData, first: Fit) -> SearchData:
    """The bench where usual errors that explain a part were fitted first: a name must explain more than fits of these
    differ by."""
    if first.nuisance.penalty == 0.0 or not first.nuisance.usual:
        return bench
    gap = max(bench.start - bench.simulator.floor_distance, 1.0)
    return replace(bench, least_part=max(bench.least_part, _BESIDE_USUAL * CHANCE / gap))


def _beyond(bench: SearchData, off: Fit) -> SearchData:
    """The bench of what the nuisances leave, of which a name must explain as large a part, and half of what chance may
    leave."""
    left = max(off.distance - bench.simulator.floor_distance, 1.0)
    return replace(bench, start=off.distance, least_part=max(bench.least_part, 0.5 * CHANCE / left))


def _search_from(bench: SearchData, first: Fit, screened: Sequence[Screened], on_progress: FitProgress) -> Search:
    """Forward from there, and backward."""
    found = forward(bench, first, screened, on_progress)
    found.fit = _or_imitation(bench, backward(bench, found.fit, on_progress), found.trials)
    return found


def _or_imitation(bench: SearchData, now: Fit, trials: Sequence[FittedCandidate]) -> Fit:
    """An effect that does nearly the same in the place of one of the fit, such as a sensor that drives in that of an
    offset, where much is left and it comes nearer by more than chance.

    In a narrow view both lengthen all ranges nearly alike, and which one is nearer is not to be told before all other
    effects are found: summaries are blunt far from the case's own model.
    """
    simulator, names = bench.simulator, now.names()
    if now.distance - simulator.floor_distance < CHANCE:
        return now
    passed = {trial.name for trial in trials if trial.passes}
    asked = [(place, it) for place, name in enumerate(names) if (it := search_spec(name).imitation)]
    for place, imitation in asked:
        if imitation.name in names or imitation.name not in passed:
            continue
        probe = imitation.start(SimulatorEvidence(simulator), now.effects()[place].settings())
        if probe is None:
            continue
        probes, x = list(now.probes), list(now.x)
        probes[place], x[place] = probe, probe.start()
        other = fit_nuisance(simulator, fit(simulator, probes, x, rounds=TO_THE_END, nuisance=now.nuisance))
        if not other.possible:
            continue
        there, here = (one.distance + select_distance(bench.select, one) for one in (other, now))
        if there < here - CHANCE:
            return other
    return now


def _all_nuisance(bench: SearchData, off: Fit, screened: Sequence[Screened]) -> bool:
    """Whether the fitted nuisances leave no more than chance does, on all frames, none of them is extreme, and no
    effect would explain much of so little: one summary that stands out is lost among a thousand."""
    left = off.distance - bench.simulator.floor_distance
    there = select_distance(bench.select, off) - bench.select.floor_distance
    residual = bench.simulator.measured - off.shown.mean(axis=0)
    most = max((one.gain(bench.simulator, residual)[0] / one.chance for one in screened), default=0.0)
    return left < CHANCE and there < 1.4 * CHANCE and off.nuisance.usual and most < _STANDS_OUT * bench.level


def backward(bench: SearchData, now: Fit, on_progress: FitProgress) -> Fit:
    """Leave out again what the others and the nuisances explain as well; fit the rest together. Nuisances that are no
    usual errors any more explain nothing."""
    simulator = bench.simulator
    if not now.probes:
        return now
    now = fit_nuisance(simulator, finished(simulator, now))
    while now.probes:
        fewer: list[Fit] = []
        for one in done_by(bench.pool, without, [(simulator.shared, now, j) for j in range(len(now.probes))]):
            fewer.append(one)
            on_progress("leave out again", len(fewer), len(now.probes))
        losses = [one.distance - now.distance for one in fewer]
        unusual = [now.nuisance.usual and not one.nuisance.usual for one in fewer]
        least = int(np.argmin(np.where(unusual, np.inf, losses)))
        price = PRICE * len(now.probes[least].free)
        related = [
            loss
            for probe, loss in zip(now.probes, losses, strict=True)
            if are_related(probe.name, now.probes[least].name)
        ]
        worth = bench.worth_beside(fewer[least].distance) if len(fewer) > 1 else bench.worth
        enough = max(1.3 * bench.level, worth, RELATED_PART * max(related, default=0.0)) + price
        if unusual[least] or losses[least] > enough:
            break
        now = fewer[least]
    return now


def without(simulator: Simulator, now: Fit, left_out: int) -> Fit:
    """The others fitted again: what is left out may have made up for what their fits had left open."""
    probes, x = others_of(now, left_out)
    fewer = fit(simulator, probes, x, rounds=TO_THE_END, nuisance=now.nuisance)
    small = fewer.distance < SMALL * simulator.floor_distance
    return fit_nuisance(simulator, fewer, rounds=4 if small else 1)
