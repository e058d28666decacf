"""Judging what the search found: is the gap closed, which names could not be told apart, how sure is a name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.finding import find
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.errors import UsageError
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.merit import FittedCandidate, accepted
from lidarcheck.explain.search.screening import Screened
from lidarcheck.explain.search.selection import SearchData, start_fit
from lidarcheck.explain.search.trial import own_distance, select_shown
from lidarcheck.inference.effect_fit import Fit, jacobian_of
from lidarcheck.inference.intervals import Interval
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers.threads import mapped

__all__ = ["Closure", "closure", "confidence", "intervals", "lead", "not_testable", "shows_in_select_alone"]


OPEN_PART, OPEN_PART_AIM, OPEN_PART_EDGES = 0.06, 0.10, 0.28
"""Up to this part of the excess may be left on the select frames: effects' forms are never quite the sensor's. More
where a beam looks elsewhere, and most where all that shows is at edges: without the scene, these are known to half a
beam only."""
OPEN_PER_LEAD, OPEN_MOST = 0.4, 0.22
"""The further a name leads over the next best one, the more may be left open: where two names explain nearly the same,
a third that is in no catalogue may do so too."""
OPEN_SMALL = (0.30, 900.0)
"""Of a small excess so large a part, up to so much: nuisances, and chance, make as much."""
OPEN_CHANCE = 350.0
"""So much may be left whatever the excess was."""
OPEN_BY_BEAMS, OPEN_BY_BEAMS_EDGES = 0.2, 0.45
"""So much of the gap beam by beam may be left: of names that were wrong on hidden cases the best left a quarter. More
where all that shows is at edges; there, the best of the wrong ones left six tenths."""
SETTLED = 0.95
"""What closes so much of the excess has explained it: what is left then is what forms leave, in whatever part of the
gap that is, and no sign of another name. Of 24 frozen cases of three frames, no wrong name closed more than 0.77."""
_SHOWN_PART = 0.2
"""Select frames whose excess is less than this part of that of the fit's frames do not show what these do."""
_ALONE = 3.0
"""Select frames so many times as far off as chance makes show what is worth a fit."""
_FORM_ERROR = 0.04
"""Part of a parameter's value by which it may be off because the effect's form is not quite the sensor's,
where the effect itself does not say that it hangs more on the form."""
_EDGE_SEEDS = 4
_OTHERS_FORMS = 1.5
"""Beside other effects a parameter also takes up what their forms leave: so many times its own form's part besides. Of
65 parameters of three benchmarks, 85 % were covered without this where one effect was named, 68 % where more were."""

_TOO_WEAK = "even clearly present, it would change these frames by no more than chance"


@dataclass(frozen=True)
class Closure:
    """What was open on the select frames before, what is still open, and how much may be."""

    before: float
    after: float
    allowed: float

    @property
    def share(self) -> float:
        """Share of what was open that is closed."""
        return 1.0 - self.after / self.before if self.before > 0.0 else 0.0

    @property
    def settled(self) -> bool:
        """Whether hardly anything is left, and that is not asked about any more."""
        return self.share >= SETTLED

    @property
    def holds(self) -> bool:
        """Whether what is left is no more than chance and the effects' forms explain."""
        return self.after <= self.allowed


def closure(bench: SearchData, now: Fit, trials: Sequence[FittedCandidate] = ()) -> Closure:
    """How much of the disagreement on the select frames is left, above the floor; on the frames of the fit where the
    select frames hardly show it: they need not have what the others do, a pane, a sign, a moving car."""
    zero = np.zeros((1, len(bench.select.measured)))
    before = bench.select.distance(zero) - bench.select.floor_distance
    fitted = bench.start - bench.simulator.floor_distance
    in_select = before >= _SHOWN_PART * fitted
    if not in_select:
        before = fitted
    after = _left(bench.select if in_select else bench.simulator, now)
    if not now.probes:
        after = min(after, before)  # usual errors as the frames of the fit have them need not be those of others
    part = max((_open_part(name) for name in now.names()), default=OPEN_PART)
    leads = [lead(name, now, trials) for name in now.names()]
    part = max(part, min(part + OPEN_PER_LEAD * min(leads, default=0.0), OPEN_MOST))
    small = min(OPEN_SMALL[0] * before, OPEN_SMALL[1])
    found = Closure(before, after, max(OPEN_CHANCE, part * before, small))
    if found.holds or not in_select:
        return found
    # A material may be in view of these frames alone, and its reflectance not quite what the table says.
    found = replace(found, after=min(after, _left(bench.select, fit_nuisance(bench.select, now))))
    if found.holds or not all(search_spec(name).at_edges for name in now.names()):
        return found
    # One edge that lies elsewhere can outweigh all else in a single frame; not where others say that more is missing.
    if _left(bench.simulator, now) > OPEN_CHANCE:
        return found
    return replace(found, after=min(found.after, _left(bench.select, now, along_edges=True)))


def shows_in_select_alone(bench: SearchData) -> bool:
    """Whether the frames of the fit are nearly at their floor and the select frames far from theirs, by more than where
    edges lie and usual errors make."""
    away = bench.select.distance(np.zeros((1, len(bench.select.measured)))) - bench.select.floor_distance
    near = bench.start - bench.simulator.floor_distance <= OPEN_CHANCE
    return near and away > _ALONE * OPEN_CHANCE and not closure(bench, start_fit(bench.simulator)).holds


def _left(simulator: Simulator, now: Fit, *, along_edges: bool = False) -> float:
    """The distance above the floor that the fit leaves on the frames, but for where edges of surfaces lie to a part of
    a beam; with `along_edges`, as for footprints, but for all that any one edge shows."""
    now = _as_struck(simulator, now)
    shown = select_shown(simulator, now)
    model = now.model(simulator.model)
    if along_edges or any(search_spec(name).splits_echoes for name in now.names()):
        metric = simulator.along_edges(model, 800, now.nuisance)
    else:
        shown_there = mapped(lambda k: simulator.observations(model, 800 + k, now.nuisance), range(_EDGE_SEEDS))
        edges = simulator.edges_beside(shown_there, deep=True)
        metric = Metric(simulator.metric.diagonal, np.concatenate([simulator.metric.factors, edges], axis=1))
    return simulator.distance(shown, metric=metric) - max(simulator.floor_distance, own_distance(simulator, now))


def _as_struck(simulator: Simulator, now: Fit) -> Fit:
    """The fit with its effects striking as often as they did in these frames, where chance may make the difference."""
    for place, (probe, effect) in enumerate(zip(now.probes, now.effects(), strict=True)):
        as_struck = search_spec(probe.name).as_struck
        there = {} if as_struck is None else as_struck(SimulatorEvidence(simulator), probe, effect)
        if there:
            x = list(now.x)
            x[place] = replace(probe, settings={**probe.settings, **there}).start()
            now = replace(now, x=tuple(x))
    return now


def _open_part(name: str) -> float:
    """The part of the excess that one effect may leave open."""
    if search_spec(name).at_edges:
        return OPEN_PART_EDGES
    return OPEN_PART_AIM if find(name).stage == "aim" else OPEN_PART


def confidence(
    bench: SearchData,
    now: Fit,
    name: str,
    trials: Sequence[FittedCandidate],
    closed: Closure,
    compared: Sequence[str] = (),
    behind: Mapping[str, float] | None = None,
) -> float:
    """How often a name that stands out so far from its rivals, in a gap closed so far, is right.

    `compared`: rivals that it was compared with beam by beam, which are either beaten or its equals. `behind`: see
    `lead`.

    A logistic function of the lead over the next best name and of what is left open, fitted to how often the names of
    six benchmarks, 115 of them, were right.
    """
    open_part = max(closed.after, 0.0) / max(closed.allowed, 1e-9)
    score = 1.02 + 5.36 * min(lead(name, now, trials, compared, behind), 0.4) - 0.8 * min(open_part, 2.0)
    return float(1.0 / (1.0 + np.exp(-score)))


def lead(
    name: str,
    now: Fit,
    trials: Sequence[FittedCandidate],
    compared: Sequence[str] = (),
    behind: Mapping[str, float] | None = None,
) -> float:
    """By what part of its merit a name leads over the next best other one of its round, 0 ... 1; not over those that it
    was compared with beam by beam, which says more.

    `behind`: by how much others fell behind in its place once all was fitted: a round's merits are of what other
    effects, found later, have left open, too.
    """
    own = accepted(name, trials)
    if own is None:
        return 0.0
    others = [t for t in trials if t.round == own.round and t.name not in (*now.names(), *compared)]
    rivals = [min(t.merit, own.merit - (behind or {}).get(t.name, 0.0)) for t in others]
    return min(max(1.0 - max([*rivals, 0.0]) / max(own.merit, 1e-9), 0.0), 1.0)


def intervals(simulator: Simulator, now: Fit, widen: float) -> list[Mapping[str, Interval]]:
    """The fitted parameters of each effect with 90 % intervals, from the curvature of the distance."""
    jacobian = jacobian_of(simulator, now)
    weighted = simulator.metric.times(jacobian)
    curvature = jacobian.T @ weighted + 1e-6 * np.eye(jacobian.shape[1])
    variance = np.maximum(np.diag(np.linalg.inv(curvature)), 0.0)
    own = np.concatenate([_form_error(probe, x) for probe, x in zip(now.probes, now.x, strict=True)])
    own *= 1.0 + _OTHERS_FORMS * (len(now.probes) > 1)
    by_chance = np.concatenate(
        [_off_by_chance(simulator, probe, x) for probe, x in zip(now.probes, now.x, strict=True)]
    )
    half = 1.645 * np.sqrt(widen**2 * variance + own**2 + by_chance**2)
    found, start = [], 0
    for probe, x in zip(now.probes, now.x, strict=True):
        found.append(_interval(probe, x, half[start : start + len(x)]))
        start += len(x)
    return found


def _form_error(probe: Probe, x: FloatArray) -> FloatArray:
    """By how much, in steps, a form that is not quite the sensor's moves each parameter, shape (n_free,)."""
    spec = search_spec(probe.name)
    found = []
    for one, at in zip(probe.free, x, strict=True):
        part, least = spec.form_errors.get(one.name, _FORM_ERROR), spec.least_errors.get(one.name, 0.0)
        found.append(part / one.step if one.log else np.hypot(part * at, least / one.step))
    return np.array(found)


def _off_by_chance(simulator: Simulator, probe: Probe, x: FloatArray) -> FloatArray:
    """By how much, in steps, each parameter is off since few things were hit, shape (n_free,)."""
    chance = search_spec(probe.name).chance_errors
    parts = {} if chance is None else chance(SimulatorEvidence(simulator), probe, probe.effect(x))
    return np.array([parts.get(one.name, 0.0) / one.step for one in probe.free])


def _interval(probe: Probe, x: FloatArray, half: FloatArray) -> Mapping[str, Interval]:
    ranges = {p.name: p for p in find(probe.name).parameters()}
    settings = probe.effect(x).settings()
    found = {}
    for one, at, width in zip(probe.free, x, half, strict=True):
        p = ranges[one.name]
        width = min(width, 60.0)
        low, high = (one.decode(float(at + sign * width), p.low, p.high) for sign in (-1.0, 1.0))
        found[one.name] = Interval(float(settings[one.name]), min(low, high), max(low, high), p.unit)
    return found


def not_testable(
    simulator: Simulator, screened: Sequence[Screened], names: Sequence[str], level: float
) -> dict[str, str]:
    """Effects that these scenes cannot show: not even the strongest start would have been told from chance."""
    needed = 2.0 * level
    found = {}
    for name in names:
        mine = [one for one in screened if one.probe.name == name]
        if not mine:
            found[name] = "the model cannot carry it"
            continue
        if any(_shows(simulator, one, needed) for one in mine):
            continue
        why_unseen = search_spec(name).why_unseen
        found[name] = (why_unseen(SimulatorEvidence(simulator)) if why_unseen else "") or _TOO_WEAK
    return found


def _shows(simulator: Simulator, one: Screened, needed: float) -> bool:
    """Whether a start changes the summaries by more than chance, judged with two seeds where one says little."""
    length = simulator.metric.square(one.change)
    if length < needed:
        return False
    if length > 4000.0:
        return True
    try:
        both = simulator.shows(simulator.model.with_(one.probe.effect()), 2)
    except UsageError:
        return False
    return float(both[0] @ simulator.metric.times(both[1])) > needed
