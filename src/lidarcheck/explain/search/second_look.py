"""A second look: a search for one effect more, around the model that has those that were found.

Summaries are compressed, and blunt far from the model that they are relative to: beside one strong effect a second one
moves them little, and not always to the better. Around the explained model residuals are small, and what is left stands
out as if it were all there is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import Probe
from lidarcheck.explain.decision.closure import closure
from lidarcheck.explain.progress import ignore_progress
from lidarcheck.explain.search.merit import CHANCE, FittedCandidate, best_of_each_name
from lidarcheck.explain.search.refine import Judged, judged
from lidarcheck.explain.search.related import are_related
from lidarcheck.explain.search.screening import Screened, chance_level, screen
from lidarcheck.explain.search.selection import MOST_EFFECTS, Search, SearchData, beside_related, run_round
from lidarcheck.explain.search.starts import fixed_probes, located_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.workers import WorkerPool

__all__ = [
    "SURE",
    "Look",
    "closes_what_others_left",
    "joint_trials",
    "look_around",
    "second_look",
    "unstrained_trials",
    "worth_by_beams",
]

Parts = tuple[FloatArray, FloatArray]

_LEFT = 3.0 * CHANCE
"""Less than this above the floor is not looked at again."""
_LEAST_PART = 0.33
"""Another effect must explain this part of what the others leave: of what an effect's form leaves over, which is no
effect of its own, several explain a little."""
_LIKELY = 0.08
"""Before it is fitted, some start of it must explain this part: fits made three or four times as much of a start."""
_LEAST_CLOSED, _LEAST_OF_ALL, _MOST_OF_LEFT, SURE = 0.15, 0.03, 0.5, 4.0
"""Beam by beam it must close this part of the gap that the others leave, this one of the gap that there was or else
most of what the others leave, and so many standard deviations of chance."""
_UNTOUCHED, _LARGE_PART, _PART_LEFT = 0.4, 0.05, 0.4
"""Or, of a part of the gap that the others leave nearly as it was, more than the first, and that is larger than usual
errors make, it leaves less than the last. A fog that lights up the air makes a gap of which jitter is a sixtieth, and
yet all that ranges are off."""
_MOST_EXPLAINED = 0.6
"""Where less is left than that chance, it must explain this part of what the summaries have left."""
_AS_MUCH = 2.0
"""A gap larger by so many standard deviations of chance is as large."""
_STILL = 0.5
"""Another look is taken where one more effect has left this part of what was left before, or more than may be open."""
_MOST = 2
_ALIKE, _WEAKER, _LEAST_JOINT = 0.5, 0.6, 0.5
"""Names that explained such a part of what an accepted one did are tried beside it, both from such a part of their
strengths. Such a name fits what the other one's form leaves over, too: it must explain more of it."""


def second_look(
    bench: SearchData,
    seen: Scale,
    search: Search,
    screened: Sequence[Screened],
    seed: int,
    on_progress: Callable[[int, int], object],
) -> Search:
    """The search with the effects that show beside the accepted ones, one after another, or as it is where none does;
    it then knows how its own fit was judged.

    `seen`: the frames of the fit and the selection, beam by beam. `screened`: what the first search began with.
    """
    left = 0.0
    while 0 < len(search.fit.probes) < MOST_EFFECTS:
        own = search.own or judged(seen, bench.simulator.model, search.fit, seed)
        search, before, left = replace(search, own=own), left, own.last.distance - own.simulator.floor_distance
        if left < _LEFT or (left < _STILL * before and closure(bench, search.fit, search.trials).holds):
            return search
        look = look_around(own, _starts(bench, own.simulator, search, screened), bench.pool, on_progress)
        number = 1 + max(trial.round for trial in search.trials)
        trials = _trials(own, look, number, search) + joint_trials(own, search, number, bench.pool)
        if not own.last.nuisance.usual:
            trials += unstrained_trials(own, look, number)
        found = _best(bench, seen, search, trials)
        if found is None:
            return search
        search = found
    return search


@dataclass(frozen=True)
class Look:
    """The bench around what was found, and the candidates on top of it."""

    bench: SearchData
    screened: Sequence[Screened]


def look_around(
    own: Judged, starts: Sequence[Probe], pool: WorkerPool, on_progress: Callable[[int, int], object]
) -> Look:
    """What each start would change around what was found, on all frames seen: of these all must agree on what is left,
    and it is the gap beam by beam that decides."""
    simulator = own.simulator
    screened = screen(simulator, starts, on_progress, pool)
    bench = SearchData(simulator, simulator, chance_level(simulator, screened), own.last.distance, pool, _LEAST_PART)
    return Look(bench, screened)


def _trials(own: Judged, look: Look, number: int, search: Search) -> list[FittedCandidate]:
    """Candidates fitted on top of what was found, as in a round of the first search.

    A view that turns at random explains a part of what an error of aim leaves at edges, here as there.
    """
    trials = run_round(
        look.bench, Search(own.last, own.last), _likely(own.simulator, own.last, look), number, ignore_progress
    )
    return [
        replace(t, needed=max(t.needed, beside_related(t.fit.probes[-1], search)))
        if t.fit.probes[-1].strikes_anew
        else t
        for t in trials
    ]


def unstrained_trials(own: Judged, look: Look, number: int) -> list[FittedCandidate]:
    """Candidates on top of what was found without nuisances, which follow: such as make do with usual ones.

    Nuisances at their limits are hardly that: they have made up for an effect, of which they leave little to begin
    with.
    """
    simulator, before = own.simulator, own.last.distance
    plain = fit(simulator, own.last.probes, own.last.x, rounds=3)
    if not plain.possible:
        return []
    bench = replace(look.bench, start=plain.distance)
    trials = run_round(bench, Search(plain, plain), _likely(simulator, plain, look), number, ignore_progress)
    best = {t.name: t for t in sorted(trials, key=lambda t: t.gain) if t.passes}
    needed = _LEAST_PART * (before - simulator.floor_distance)
    found = []
    for t in [*best.values()][-_MOST:]:
        end = fit_nuisance(simulator, t.fit)
        if end.nuisance.usual:
            found.append(FittedCandidate(t.name, number, end, before - end.distance, needed, before, end.distance))
    return found


def _likely(simulator: Simulator, now: Fit, look: Look) -> list[Screened]:
    """Those of the effects that explain a part of what is left before any fit, worth the fits' time."""
    left, residual = now.distance - simulator.floor_distance, simulator.measured - now.shown.mean(axis=0)
    names = {one.probe.name for one in look.screened if one.gain(simulator, residual)[0] > _LIKELY * left}
    return [one for one in look.screened if one.probe.name in names]


def joint_trials(own: Judged, search: Search, number: int, pool: WorkerPool) -> list[FittedCandidate]:
    """Names that explained much of the same, fitted together with the accepted ones from where both are weaker.

    Of two effects that do much the same the one that is accepted first takes what both do, and then leaves nothing that
    the other one could begin with: dark counts that crosstalk multiplies are so many more dark counts.
    """
    now, before = own.last, own.last.distance
    needed = _LEAST_JOINT * (before - own.simulator.floor_distance)
    tasks = ((own.simulator.shared, now, needed, *alike) for alike in _alike(search))
    found = []
    for joint in pool.map(_joined, tasks):
        if joint.possible:
            gain = before - joint.distance
            found.append(FittedCandidate(joint.names()[-1], number, joint, gain, needed, before, joint.distance))
    return found


def _alike(search: Search) -> list[tuple[Probe, FloatArray]]:
    """The other names that explained nearly as much as an accepted one of their round, where their fits ended."""
    names = search.fit.names()
    accepted_gain: dict[int, float] = {}
    for t in search.trials:
        if t.name in names and t.passes:
            accepted_gain[t.round] = max(t.gain, accepted_gain.get(t.round, 0.0))
    passed = (t for t in search.trials if t.name not in names and t.passes)
    near = (t for t in passed if t.gain > _ALIKE * accepted_gain.get(t.round, float("inf")))
    best = best_of_each_name(near, by=lambda t: t.gain)[:_MOST]
    return [(t.fit.probes[-1], t.fit.x[-1]) for t in best]


def _joined(simulator: Simulator, now: Fit, needed: float, probe: Probe, x: FloatArray) -> Fit:
    """Effects and one more fitted together, all from a part of their strengths; with the nuisances where these may make
    up what a gain of `needed` lacks."""
    probes = [at.weaker(x, _WEAKER) for at, x in zip((*now.probes, probe), (*now.x, x), strict=True)]
    joint = fit(simulator, probes, [one.start() for one in probes], rounds=4, nuisance=now.nuisance)
    return fit_nuisance(simulator, joint) if now.distance - joint.distance > 0.25 * needed else joint


def _starts(bench: SearchData, simulator: Simulator, search: Search, screened: Sequence[Screened]) -> list[Probe]:
    """Of each kind of each other effect the start that explained most of what was left, and those that need a look at
    the data, at what is left now."""
    names = {one.probe.name for one in screened} - set(search.fit.names())
    fixed = fixed_probes(sorted(names), bench.simulator.model.sensor)
    residual = bench.simulator.measured - search.fit.shown.mean(axis=0)
    best: dict[tuple[str, str], tuple[float, Probe]] = {}
    for one in screened:
        kind, gain = (one.probe.name, one.probe.variant), one.gain(bench.simulator, residual)[0]
        if one.probe in fixed and gain > best.get(kind, (-1.0,))[0]:
            best[kind] = gain, one.probe
    return [probe for _, probe in best.values()] + located_probes(simulator, names)


def _best(bench: SearchData, seen: Scale, search: Search, trials: Sequence[FittedCandidate]) -> Search | None:
    """The search with the candidate that closes most of what is left beam by beam; None where none closes enough."""
    tried = best_of_each_name(t for t in trials if t.passes)[:_MOST]
    own = search.own
    if not tried or own is None:
        return None
    case = bench.simulator.model
    settled = closure(bench, search.fit, search.trials).settled
    fits = [own.last, *(one.fit for one in tried)]
    models = [(seen.shared, case, Nuisance()), *((seen.shared, one.model(case), one.nuisance) for one in fits)]
    whole, before, *after = bench.pool.map(Scale.excess_by_part, models)
    closing = [
        (float(there[0].mean()), one)
        for there, one in zip(after, tried, strict=True)
        if _closes(own, one, float(there[0].mean()), float(whole[0].mean()), settled=settled)
        or closes_what_others_left(whole[0], before, there)
    ]
    if not closing:
        return None
    found = min(closing, key=lambda both: both[0])[1].fit
    # Told as one of the first bench, whose frames and summaries all that follows is in.
    now = fit(bench.simulator, found.probes, found.x, rounds=0, nuisance=found.nuisance)
    return Search(search.first, now, [*search.trials, *trials], beside=own)


def _closes(own: Judged, one: FittedCandidate, left: float, whole: float, *, settled: bool = False) -> bool:
    """Whether a fit with one more effect closes enough of the gap beam by beam, of which it leaves `left`; or as much
    as before with nuisances that are usual, where those before were at their limits. Where the others have `settled`
    the case, most of what they leave is not enough: it may be no more than their forms."""
    if one.fit.nuisance.usual and not own.last.nuisance.usual:
        return left < own.left + _AS_MUCH * own.chance
    closed = own.left - left
    if _beams_cannot_tell(own) and _explains_most(own, one):
        return closed >= _LEAST_CLOSED * own.left
    worth = worth_by_beams(own.left, whole, own.chance)
    return closed >= (max(worth, _LEAST_OF_ALL * whole) if settled else worth)


def _beams_cannot_tell(own: Judged) -> bool:
    """Whether less is left beam by beam than the chance that is asked of one more effect: noise hides it there, from
    which summaries tell it."""
    return own.left < SURE * own.chance


def _explains_most(own: Judged, one: FittedCandidate) -> bool:
    """Whether an effect explains most of what the summaries have left, and no other is its relative, whose form
    might leave as much."""
    left = own.last.distance - own.simulator.floor_distance
    return one.gain > _MOST_EXPLAINED * left and not any(are_related(one.name, name) for name in own.last.names())


def worth_by_beams(left: float, whole: float, chance: float) -> float:
    """How much of the gap beam by beam an effect must close beside others that leave so much of the whole one."""
    return max(_LEAST_CLOSED * left, min(_LEAST_OF_ALL * whole, _MOST_OF_LEFT * left), SURE * chance)


def closes_what_others_left(whole: FloatArray, before: Parts, after: Parts) -> bool:
    """Whether one more effect closes most of a part of the gap that the others leave nearly as it was, (n_parts,), and
    some of it all: such a part is not what their forms leave over, however small it is beside what they close."""
    (open_, noise), (left, noise_left) = before, after
    chance = np.maximum(noise.std(axis=0, ddof=1), noise_left.std(axis=0, ddof=1))
    untouched = (open_ > _UNTOUCHED * whole) & (open_ > _LARGE_PART)
    closed = (left < _PART_LEFT * open_) & (open_ - left > SURE * chance)
    return bool((untouched & closed).any() and left.mean() < open_.mean())
