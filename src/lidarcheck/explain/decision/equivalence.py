"""Which names explain the data nearly as well: the accepted one's rivals, and the contest between them.

The search judges by summaries, which are blunt far from the case's own model. So rivals are fitted once more around the
model that each of them makes, and judged there by the distance beam by beam.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.report.explanation import Alternative
from lidarcheck.explain.report.wording import measurement
from lidarcheck.explain.search.merit import CHANCE, FittedCandidate, accepted, best_of_each_name
from lidarcheck.explain.search.refine import Judged, judged, polished
from lidarcheck.explain.search.related import is_confused
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.explain.search.trial import select_distance
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import is_usual_error
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale, excesses
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool
from lidarcheck.workers.threads import done_by

__all__ = ["Polished", "Rival", "contest", "rivals"]

Told = Callable[[str, int, int], object]

_NEAR_MERIT = 0.85
_MOST = 3
"""So many names beside the accepted one are looked at, those that explain most."""
_MOST_OVERLOOKED = 2
"""So many names of earlier rounds are tried in an effect's place."""
_HALF = 0.5
"""So large a part of the accepted one's merit brings a name that is taken for it into the comparison."""
_NEAR, _NEAR_PART = 300.0, 0.06
"""A rival's distance is larger by no more than this, or this part of what it explains."""
_MARGIN, _NO_WORTH = 2.0, 0.03
"""Names whose gaps differ by less than so many standard deviations of the floor, or by less than this part of the
whole gap, which no name would be worth that closes no more, are not told apart; nor are such whose summaries, on the
frames of the fit and the selection, differ by less than `CHANCE`."""
_MUCH_LESS = 0.6
"""An effect that can do all that another one does, and more, must leave no more than this part of what that does."""
_LESS = 0.8
"""To take an effect's place, what can imitate it must leave no more than this part of what that does, and its summaries
be no farther; where the imitation was accepted it stays. The one that is tried in its place must only leave no more if
its summaries are nearer by more than chance. Any rival whose summaries are farther by more than chance must leave no
more than this part, too."""


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of an accepted one: its name, that one's place, the fit, how much farther it is, and
    whether it is near enough to be that one's equal; not where it is no more than a usual error."""

    name: str
    place: int
    fit: Fit
    farther: float
    near: bool = True
    usual: bool = False


@dataclass(frozen=True)
class Polished:
    """The winner of a contest: its fit, the lab around its model with the last fit there, each effect's equals, all
    that were compared with it beam by beam, and the gap that it left there; `behind`: how much farther all is with
    another name in an effect's place, of those that are not near; `rivals`: all that were tried, for the report."""

    fit: Fit
    simulator: Simulator
    last: Fit
    equals: Mapping[str, tuple[str, ...]]
    compared: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left: float = np.inf
    behind: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    rivals: tuple[Alternative, ...] = ()


def rivals(bench: SearchData, now: Fit, trials: Sequence[FittedCandidate], on_progress: Told) -> list[Rival]:
    """The effects that explained nearly as much as an accepted one, in its place; the nearest first.

    So are those that the catalogue says are taken for it, whenever they explained half as much: what these data cannot
    tell apart is said, whichever of both came first. Where more than chance is left, also those that explained more in
    an earlier round than it did in its own: beside another effect whose fit has taken up a part of theirs, they explain
    less than they do when all is fitted together.
    """
    names = now.names()
    asked = [(place, trial) for place, name in enumerate(names) for trial in _near(name, names, trials)]
    asked += [(place, trial) for place, name in enumerate(names) for trial in _lookalikes(name, names, trials)]
    asked += [(place, trial) for place, probe in enumerate(now.probes) for trial in _siblings(probe, trials)]
    if now.distance - bench.simulator.floor_distance > CHANCE:
        asked += [(place, trial) for place, name in enumerate(names) for trial in _overlooked(name, names, trials)]
    best = now.distance + select_distance(bench.select, now)
    tasks = ((bench.simulator.shared, bench.select.shared, now, place, trial) for place, trial in asked)
    found = []
    for (place, trial), (swapped, distance) in zip(asked, done_by(bench.pool, _swapped, tasks), strict=True):
        farther = distance - best
        near = farther < max(_NEAR, _NEAR_PART * trial.merit)
        usual = is_usual_error(swapped.effects()[place], swapped.nuisance)
        found.append(Rival(trial.name, place, swapped, farther, near and not usual, usual))
        on_progress("equivalence", len(found), len(asked))
    return sorted(found, key=lambda one: one.farther)


def _near(name: str, names: Sequence[str], trials: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The trials of the round in which an effect was accepted that came near it, the best of each other name. Merits
    that differ by less than chance leaves of a fit say nothing."""
    last = accepted(name, trials)
    if last is None:
        return []
    least = min(_NEAR_MERIT * last.merit, last.merit - CHANCE)
    others = (t for t in trials if t.round == last.round and t.name not in names)
    return best_of_each_name(t for t in others if t.merit > least)[:_MOST]


def _lookalikes(name: str, names: Sequence[str], trials: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The best trial of each other name that the catalogue says is taken for this one, of any round, that explained
    half as much and is not near by its merit anyway."""
    last = accepted(name, trials)
    if last is None:
        return []
    known = {*names, *(one.name for one in _near(name, names, trials))}
    alike = (t for t in trials if t.name not in known and t.merit > _HALF * last.merit and is_confused(name, t.name))
    return best_of_each_name(alike)


def _siblings(probe: Probe, trials: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The best trial of the same effect's other kind, which the summaries hardly tell from it."""
    last = accepted(probe.name, trials)
    if last is None or not search_spec(probe.name).kinds_alike:
        return []
    found = [t for t in trials if t.round == last.round and t.name == probe.name and t.probe.variant != probe.variant]
    return [t for t in best_of_each_name(found) if t.merit > _NEAR_MERIT * last.merit]


def _overlooked(name: str, names: Sequence[str], trials: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """The trials of earlier rounds that explained more than an effect did in the round that accepted it, the best of
    each name that none of the later rounds brought near it."""
    last = accepted(name, trials)
    if last is None:
        return []
    near = {*names, *(one.name for one in _near(name, names, trials))}
    earlier = (t for t in trials if t.round < last.round and t.passes and t.name not in near)
    return best_of_each_name(t for t in earlier if t.merit > last.merit)[:_MOST_OVERLOOKED]


def _swapped(
    simulator: Simulator, select: Simulator, now: Fit, place: int, trial: FittedCandidate
) -> tuple[Fit, float]:
    """The fit with another effect in one's place, all fitted again, and how far it is on all frames."""
    mine = trial.fit.names().index(trial.name)
    probes, x = list(now.probes), list(now.x)
    probes[place], x[place] = trial.fit.probes[mine], trial.fit.x[mine]
    found = fit_nuisance(simulator, fit(simulator, probes, x, rounds=1, nuisance=now.nuisance))
    return found, found.distance + select_distance(select, found)


def contest(
    scale: Scale,
    model: Model,
    now: Fit,
    others: Sequence[Rival],
    seed: int,
    *,
    known: Judged | None = None,
    pool: WorkerPool | None = None,
) -> Polished:
    """The accepted effects and their rivals, each fitted again around the model that it makes, and the nearest of them.

    A rival takes an accepted effect's place only where it is nearer by more than chance, and much nearer if it can do
    all that one does and more, or if its summaries are farther; or, if it is such a one's special case, where it is not
    much farther, and so an imitation with much nearer summaries. Those that chance may make
    as near are its equals. The same effect of another kind stands for it where it is nearer.
    `known`: the accepted effects where they were judged already.
    """
    names = now.names()
    behind = {
        name: {one.name: one.farther for one in others if one.place == k and not one.near and one.name != name}
        for k, name in enumerate(names)
    }
    near = [one for one in others if one.near]
    if not near:
        simulator, last = polished(scale.frames, model, now, seed) if known is None else (known.simulator, known.last)
        return Polished(now, simulator, last, {}, behind=behind, rivals=rows(now, others, {}, {}))
    fits = [*([now] if known is None else []), *(one.fit for one in near)]
    found = [*done_by(pool or WorkerPool(), judged, ((scale.shared, model, one, seed) for one in fits))]
    own = known or found.pop(0)
    both = list(zip(near, found, strict=True))
    now, own = _of_its_kind(now, own, both)
    rest = [(one, its) for one, its in both if one.name != names[one.place]]
    if not rest:
        told = rows(now, others, {}, {})
        return Polished(now, own.simulator, own.last, {}, left=own.left, behind=behind, rivals=told)
    [(whole, _)] = excesses(scale, [model])
    gaps = {(one.place, one.name): its.left for one, its in rest}
    margin = max(_MARGIN * own.chance, _NO_WORTH * whole)
    best, its = min(rest, key=lambda pair: pair[1].left * _handicap(pair[0].name, names[pair[0].place]))
    if not _takes_its_place(best.name, its, names[best.place], own):
        alike = _alike([one for one, _ in rest], gaps, own.left + margin, CHANCE)
        equals = {name: _equals(k, name, gaps, alike) for k, name in enumerate(names)}
        compared = {name: tuple(one.name for one, _ in rest if one.place == k) for k, name in enumerate(names)}
        told = rows(now, others, gaps, equals)
        return Polished(now, own.simulator, own.last, equals, compared, own.left, behind, told)
    # What it takes the place of is compared with it in its turn.
    beaten = Rival(names[best.place], best.place, now, 0.0)
    gaps = {at: left for at, left in gaps.items() if at[0] == best.place and at[1] != best.name}
    gaps[best.place, beaten.name] = own.left
    others = [beaten, *(one for one in others if one is not best)]
    alike = _alike([one for one in others if one.near], gaps, its.left + margin, best.farther + CHANCE)
    equals = {best.name: _equals(best.place, best.name, gaps, alike)}
    compared = {best.name: tuple(name for _, name in gaps)}
    told = rows(best.fit, others, gaps, equals, best.farther)
    return Polished(best.fit, its.simulator, its.last, equals, compared, its.left, rivals=told)


def rows(
    now: Fit,
    others: Sequence[Rival],
    gaps: Mapping[tuple[int, str], float],
    equals: Mapping[str, Sequence[str]],
    farther: float = 0.0,
) -> tuple[Alternative, ...]:
    """The rivals as the report has them, the best score first, each name in a place once; `farther`: how much farther
    the fit itself is than what they were compared with."""
    found: dict[tuple[str, ...], Alternative] = {}
    for one in sorted(others, key=lambda one: one.farther):
        name = now.names()[one.place]
        names = tuple(one.name if k == one.place else other for k, other in enumerate(now.names()))
        if one.name == name or names in found:
            continue
        score, gap = 0.5 * (farther - one.farther), gaps.get((one.place, one.name), np.nan)
        if one.name in equals.get(name, ()):
            why = f"these data cannot tell it from {name}; this would: {measurement(name, one.name)}"
        elif one.usual:
            why = "it is no more than a usual error"
        elif not np.isnan(gap):
            why = f"beam by beam it leaves more of the gap than {name}, or can do all that {name} does and more"
        else:
            why = f"its summaries are farther than those with {name}"
        found[names] = Alternative(names, float(score), float(gap), why)
    return tuple(found.values())


def _of_its_kind(now: Fit, own: Judged, both: Sequence[tuple[Rival, Judged]]) -> tuple[Fit, Judged]:
    """The accepted effects, or the same ones of another kind where they are nearer."""
    for one, its in both:
        if one.name == now.names()[one.place] and _takes_its_place(one.name, its, one.name, own):
            now, own = one.fit, its
    return now, own


def _handicap(rival: str, accepted: str) -> float:
    """By what the gap that a rival leaves is multiplied before it is compared with the accepted one's."""
    if search_spec(accepted).special_case_of == rival:
        return 1.0 / _MUCH_LESS
    if rival in search_spec(accepted).imitated_by:
        return 1.0 / _LESS
    return _MUCH_LESS if search_spec(rival).special_case_of == accepted else 1.0


def _takes_its_place(rival: str, its: Judged, accepted: str, own: Judged) -> bool:
    """Whether a rival is nearer beam by beam by more than chance, and by much where its summaries say the opposite; a
    special case need only not be farther by more than chance, the imitation that is tried in its place only be no
    farther if its summaries are much nearer."""
    # Chance is large where an effect strikes at random: a view that wanders may hit upon the measured one.
    margin = _MARGIN * max(own.chance, its.chance)
    nearer = _beyond_floor(own) - _beyond_floor(its)
    if rival in search_spec(accepted).imitated_by:
        if nearer < 0.0:
            return False
        imitation = search_spec(accepted).imitation
        if imitation is not None and rival == imitation.name and nearer > CHANCE:
            return its.left < own.left
    handicap = _handicap(rival, accepted)
    if handicap == 1.0 and rival != accepted and nearer < -CHANCE:
        handicap = 1.0 / _LESS
    return handicap * its.left < own.left + (margin if handicap < 1.0 else -margin)


def _beyond_floor(one: Judged) -> float:
    """How far the summaries around a model of its own are, beyond where they are if nothing is missing."""
    return one.last.distance - one.simulator.floor_distance


def _alike(
    others: Sequence[Rival], gaps: Mapping[tuple[int, str], float], most: float, farthest: float
) -> set[tuple[int, str]]:
    """The rivals that these data cannot tell from what they were compared with: that leave no larger gap than `most`,
    or whose summaries are as near as chance makes of the same."""
    places = {(one.place, one.name): one.farther for one in others}
    return {at for at, left in gaps.items() if left < most or places.get(at, np.inf) < farthest}


def _equals(
    place: int, winner: str, gaps: Mapping[tuple[int, str], float], alike: set[tuple[int, str]]
) -> tuple[str, ...]:
    """The names of the rivals in a place that are alike, the smallest gap first; not those of which the winner is a
    special case, which are near because they can do what it does."""
    near = sorted((gaps[at], at[1]) for at in alike if at[0] == place)
    return tuple(name for _, name in near if search_spec(winner).special_case_of != name)
