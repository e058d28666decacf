"""The rounds of the search: fit the best candidates, accept one of them, fit all to the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.fitted_tables import read_again
from lidarcheck.explain.search.merit import CHANCE, FittedCandidate, best_of_each_name
from lidarcheck.explain.search.refine import Judged
from lidarcheck.explain.search.related import are_related, enough_for, is_special_case
from lidarcheck.explain.search.screening import Screened
from lidarcheck.explain.search.trial import finished, select_shown, to_the_end, tried
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers import WorkerPool

__all__ = [
    "FitProgress",
    "Search",
    "SearchData",
    "accept",
    "beside_related",
    "best_of",
    "forward",
    "onward",
    "start_fit",
]

FitProgress = Callable[[str, int, int], object]
_Start = tuple[float, Screened]

MOST_EFFECTS = 4
REFINED = 5
"""So many of the best screened effects are fitted in each round."""
NEARLY = 0.35
"""Effects that explain less than this part of what the best one does are not fitted."""
LEAST_PART, MOST_OF_LEFT = 0.05, 0.6
"""An effect that explains less of the distance than this is not worth a name, unless it explains most of what others
leave: squares make a second effect a small part of what a strong one does."""
RELATED_PART = 0.12
"""An effect's form is never quite the sensor's, and what that leaves is best explained by its relatives: together with
one of them an effect must explain this part of what that one does."""
RANDOM_RELATED_PART, _RANDOM_WORTH, _RANDOM_ENOUGH = 0.3, 2.0, 0.5
"""What strikes at random explains a little of whatever is not quite right at edges: it needs this part beside its
relatives, and so many times the usual least part, though no more than half of all."""
_NEAR_THE_BEST, _CLOSE = 0.93, 3
"""So many names at most, whose merit is this part of the best one's or more, are compared to the end of their fits."""
_PLAIN_NEAR, _STEADY_NEAR, _PLAIN = 0.75, 0.65, 2
"""So are as many names of the best one's relatives that have fewer numbers, or do not strike at random as it does,
from these parts on."""
_OVERTAKES = 1.02
"""There another one must be ahead by so much: forms that are not quite the sensor's make such differences, too."""
_FAR_BEHIND = 4.0
"""What leaves so many times what chance does, where another name leaves no more than the floor, is far behind."""
SMALL = 4.0
"""A distance of up to so many floors may be all nuisance; these are then fitted before the search."""


@dataclass(frozen=True)
class SearchData:
    """The frames to fit on and the frames to select on, how large a gain by chance can be, and how far the fit's frames
    are at the start; `least_part` of that above the floor is worth a name. `ways`: what detours have
    led to, with the trial that each began with."""

    simulator: Simulator
    select: Simulator
    level: float
    start: float
    pool: WorkerPool = field(default_factory=WorkerPool)
    least_part: float = LEAST_PART
    ways: list[tuple[FittedCandidate, Search]] = field(default_factory=list)

    @property
    def worth(self) -> float:
        """The least gain that is worth a name, whatever chance says."""
        return self.least_part * self._gap

    def worth_of(self, probe: Probe) -> float:
        """The same for a start."""
        if not probe.strikes_anew:
            return self.worth
        return min(_RANDOM_WORTH * self.least_part, _RANDOM_ENOUGH) * self._gap

    def worth_beside(self, distance: float) -> float:
        """The same beside other effects that leave a distance: most of what these leave is enough."""
        return min(self.worth, MOST_OF_LEFT * max(distance - self.simulator.floor_distance, 0.0))

    @property
    def _gap(self) -> float:
        """How far the start is beyond the floor."""
        return max(self.start - self.simulator.floor_distance, 0.0)


@dataclass
class Search:
    """What the search found: the accepted effects together, and every candidate that was fitted.

    `first`: before any effect, with the nuisances fitted where they may be all that is wrong. `own`: how the accepted
    effects were judged beam by beam, where they were; `beside`: how those were beside which the second look found the
    last one. `idle`: names that were left out for good, since where all is fitted they do nothing.
    """

    first: Fit
    fit: Fit
    trials: list[FittedCandidate] = field(default_factory=list)
    own: Judged | None = None
    beside: Judged | None = None
    idle: tuple[str, ...] = ()


def start_fit(simulator: Simulator, *, nuisances: bool | None = None) -> Fit:
    """The model as it is; with the nuisances fitted, where they may be all that is wrong (or where that is asked)."""
    shown = np.zeros((1, len(simulator.measured)))
    plain = Fit((), (), simulator.distance(shown), shown)
    small = plain.distance < SMALL * simulator.floor_distance
    return fit_nuisance(simulator, plain, rounds=4) if (small if nuisances is None else nuisances) else plain


def forward(bench: SearchData, first: Fit, screened: Sequence[Screened], on_progress: FitProgress) -> Search:
    """Accept one effect after another while it explains more than chance and more than 5 %, at most four."""
    return onward(bench, Search(first, first), screened, on_progress)


def onward(bench: SearchData, found: Search, screened: Sequence[Screened], on_progress: FitProgress) -> Search:
    """The same from what is accepted already."""
    little = max(0.5 * CHANCE, 0.5 * bench.worth)
    while len(found.fit.probes) < MOST_EFFECTS:
        if found.fit.probes and found.fit.distance - bench.simulator.floor_distance < little:
            break
        trials = run_round(bench, found, screened, len(found.fit.probes) + 1, on_progress)
        trials = neck_and_neck(bench, found, trials)
        found.trials += trials
        passing = [trial for trial in trials if trial.passes]
        if not passing:
            break
        found = accept(bench, found, best_of(passing))
    return found


def best_of(passing: Sequence[FittedCandidate]) -> FittedCandidate:
    """The trial of the largest merit, or one of its special case that explains nearly as much."""
    best = max(passing, key=lambda t: t.merit)
    special = [t for t in passing if t.merit > enough_for(t.name, best.probe) * best.merit]
    return max(special, key=lambda t: t.merit, default=best)


def neck_and_neck(bench: SearchData, found: Search, trials: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The trials of a round; those of names that come near the best are fitted to the end, nuisances and all, and stand
    there as they are then if one of them overtakes it.

    Of two that explain the same, one that turns the view would be the better for what the pose's error alone has made.
    """
    close = _close([t for t in trials if t.passes])
    if len(close) < 2:
        return [*trials]
    shown = select_shown(bench.select, found.fit)
    tasks = ((bench.simulator.shared, bench.select.shared, shown, t.fit) for t in close)
    ended = []
    for t, (end, after, change, edges, own) in zip(close, bench.pool.map(to_the_end, tasks), strict=True):
        gain = found.fit.distance - end.distance
        there = replace(t, fit=end, end=end, gain=gain, select_after=after, select_change=change)
        ended.append(replace(there, along_edges=edges, own=own))
    first, *others = ended
    overtaken = any(t.passes and t.merit > _enough(t, first) * first.merit for t in others)
    now = ended if overtaken else [replace(t, end=its.end) for t, its in zip(close, ended, strict=True)]
    by_trial = {id(t): its for t, its in zip(close, now, strict=True)}
    return [by_trial.get(id(t), t) for t in trials]


def _close(passing: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The best trial of each name that comes near the best of all, and of a plainer one of its relatives, in order.

    Numbers that turn a view or bend a walk make up at once for what the pose's error has made; an offset cannot.
    """
    ranked = best_of_each_name(passing)
    if not ranked:
        return []
    first = ranked[0]
    close = [t for t in ranked if t.merit > _NEAR_THE_BEST * first.merit][:_CLOSE]
    plain = [t for t in ranked if _is_near(t, first) and t not in close]
    return close + plain[:_PLAIN]


def _plainer(one: FittedCandidate, other: FittedCandidate) -> bool:
    """Whether a trial is of an effect of the same group with fewer free numbers."""
    return are_related(one.name, other.name) and len(one.probe.free) < len(other.probe.free)


def _is_near(one: FittedCandidate, first: FittedCandidate) -> bool:
    """Whether a plainer name comes near enough to the first one to be fitted to the end."""
    if first.probe.strikes_anew and is_special_case(one.name, first.probe):
        return one.merit > _STEADY_NEAR * first.merit
    return one.merit > _PLAIN_NEAR * first.merit and _plainer(one, first)


def _enough(one: FittedCandidate, first: FittedCandidate) -> float:
    """What part of the first one's merit another one that is fitted to the end must have to count as it is then."""
    return min(1.0 if _plainer(one, first) else _OVERTAKES, enough_for(one.name, first.probe))


def accept(bench: SearchData, found: Search, trial: FittedCandidate) -> Search:
    """The search with a trial's effects, fitted to the end: what an unfinished fit leaves open would be taken for
    another effect."""
    end = trial.end or fit_nuisance(bench.simulator, finished(bench.simulator, trial.fit))
    return replace(found, fit=read_again(bench.simulator, end))


def run_round(
    bench: SearchData, found: Search, screened: Sequence[Screened], number: int, on_progress: FitProgress
) -> list[FittedCandidate]:
    """Fit the most promising candidates on top of what was accepted: one kind of each name, then the other kinds of
    those that may still be the nearest."""
    order = _promising(bench, found.fit, screened)
    shown = select_shown(bench.select, found.fit)
    first: dict[str, _Start] = {}
    for start in order:
        first.setdefault(start[1].probe.name, start)

    def fitted(some: Sequence[_Start], done: int) -> list[FittedCandidate]:
        return _fitted(
            bench, found, shown, some, number, lambda i: on_progress(f"round {number}", done + i, len(order))
        )

    trials = fitted([*first.values()], 0)
    others = [start for start in order if start is not first[start[1].probe.name]]
    others = [start for start in others if not _outrun(bench.simulator, start[1].probe.name, trials)]
    return trials + fitted(others, len(first))


def _outrun(simulator: Simulator, name: str, trials: Sequence[FittedCandidate]) -> bool:
    """Whether one kind of a name left much of what another name has explained to the floor."""
    own = [t.fit.distance for t in trials if t.name == name]
    nearest = min((t.fit.distance for t in trials if t.name != name), default=np.inf)
    return (
        bool(own) and nearest < simulator.floor_distance and min(own) > simulator.floor_distance + _FAR_BEHIND * CHANCE
    )


def _fitted(
    bench: SearchData,
    found: Search,
    shown: FloatArray,
    starts: Sequence[_Start],
    number: int,
    on_progress: Callable[[int], object],
) -> list[FittedCandidate]:
    """The trials of starts, `shown` what the accepted show of the select frames; not those that no sensor can have."""
    simulator, now, floor = bench.simulator, found.fit, bench.select.floor_distance
    before = bench.select.distance(shown)
    least = max(1.3 * bench.level, bench.worth)
    probes = (one.probe.scaled(scale) for scale, one in starts)
    fits = bench.pool.map(
        tried, ((simulator.shared, bench.select.shared, now, shown, least, probe) for probe in probes)
    )
    trials = []
    for i, ((_, one), (alone, after, change, edges, own)) in enumerate(zip(starts, fits, strict=True), 1):
        if not alone.possible or _is_another(simulator, alone):
            continue
        gain, needed = now.distance - alone.distance, _needed(bench, found, one)
        trials.append(
            FittedCandidate(one.probe.name, number, alone, gain, needed, before, after, change, edges, own, floor)
        )
        on_progress(i)
    return trials


def _is_another(simulator: Simulator, now: Fit) -> bool:
    """Whether the last effect of a fit has become what another name says."""
    is_another = search_spec(now.probes[-1].name).is_another
    return is_another is not None and is_another(SimulatorEvidence(simulator), now.effects()[-1])


def _needed(bench: SearchData, found: Search, one: Screened) -> float:
    """What a start must gain on top of what was accepted."""
    worth = bench.worth_of(one.probe)
    if found.fit.probes and not one.probe.strikes_anew:
        worth = bench.worth_beside(found.fit.distance)
    return max(1.3 * bench.level * one.chance, worth, beside_related(one.probe, found))


def beside_related(probe: Probe, found: Search) -> float:
    """What an effect must explain beside its relatives among those that were accepted."""
    gains = [
        t.gain for t in found.trials if t.passes and t.name in found.fit.names() and are_related(probe.name, t.name)
    ]
    return (RANDOM_RELATED_PART if probe.strikes_anew else RELATED_PART) * max(gains, default=0.0)


def _promising(bench: SearchData, now: Fit, screened: Sequence[Screened]) -> list[_Start]:
    """The best start of each kind of each of the best effects, with the factor on its strength.

    Every kind of an effect that is fitted at all: what one that strikes at random changes with one seed says little of
    what it explains.
    """
    residual = bench.simulator.measured - now.shown.mean(axis=0)
    best: dict[tuple[str, str], tuple[float, float, Screened]] = {}
    worth: dict[str, float] = {}
    for one in screened:
        if one.probe.name in now.names():
            continue
        gain, scale = one.gain(bench.simulator, residual)
        key = (one.probe.name, one.probe.variant)
        if gain > best.get(key, (-1.0,))[0]:
            best[key] = (gain, scale, one)
        if gain / one.chance > bench.level:
            worth[one.probe.name] = max(gain, worth.get(one.probe.name, 0.0))
    names = sorted(worth, key=lambda name: -worth[name])[:REFINED]
    names = [name for name in names if worth[name] > NEARLY * worth[names[0]]]
    order = sorted((found for found in best.values() if found[2].probe.name in names), key=lambda found: -found[0])
    return [(scale if gain > 0.0 else 1.0, one) for gain, scale, one in order]
