"""One more effect on top of what was accepted: its fit, and what it does to the select frames. Done by workers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.finding import make
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.search.whole_bins import at_whole_steps
from lidarcheck.inference.effect_fit import Fit, fit, with_effects
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers.threads import mapped

__all__ = [
    "TO_THE_END",
    "finished",
    "on_select",
    "own_distance",
    "select_distance",
    "select_shown",
    "to_the_end",
    "tried",
]

Tried = tuple[Fit, float, float, tuple[float, float] | None, float | None]

TO_THE_END = 6
"""Steps of a fit after which it leads no further."""
_HOPELESS = 0.2
"""What alone explains less than this part of what is needed is not fitted together with the rest."""
_AGAIN, _MUCH = 2, 100.0
"""So often numbers and nuisances are fitted in turn once more, while that brings so much."""
_WEAKER = 3
"""So often a start that no sensor can have is made half as strong."""
_PLAIN_ROUNDS, _PART_OF_WAYS = 3, 1.7
"""Steps of the plain kind before a probe's ways are tried, and by what the strength found there is multiplied: what one
direction lights, it lights in part."""
_NAMED_PART = 0.01
"""The least part of its gain that an effect must lose without that which its name says."""


def tried(simulator: Simulator, select: Simulator, now: Fit, before: FloatArray, least: float, probe: Probe) -> Tried:
    """The fit with one more effect, and what it does to the select frames."""
    found = fit_next(simulator, now, probe, least)
    for _ in range(_WEAKER):
        if not found.possible:
            probe = probe.scaled(0.5)
            found = fit_next(simulator, now, probe, least)
    if found.possible and not now.probes and now.nuisance.penalty > 0.0:
        # What was fitted first may have made up for the effect: once also the other way round.
        first = fit_next(simulator, replace(now, nuisance=Nuisance()), probe, least)
        if first.possible:
            found = min((found, fit_nuisance(simulator, first)), key=lambda one: one.distance)
    if found.possible and not _is_what_it_says(simulator, now, found):
        found = replace(found, distance=np.inf)
    return on_select(select, before, found)


def _is_what_it_says(simulator: Simulator, now: Fit, found: Fit) -> bool:
    """Whether the last effect of a fit explains something by what its name says."""
    effect = found.effects()[-1]
    nothing = search_spec(effect.name).named_by
    if not nothing:
        return True
    others = with_effects(simulator.model, found.probes[:-1], found.x[:-1])
    without = simulator.shows(
        others.with_(make(effect.name, {**effect.settings(), **nothing})), nuisance=found.nuisance
    )
    gain = max(now.distance - found.distance, 0.0)
    return simulator.distance(without) - found.distance > _NAMED_PART * gain


def on_select(select: Simulator, before: FloatArray, found: Fit) -> Tried:
    """The fit, how far it is on the select frames, how far it moves them, by how much it brings them nearer and moves
    them wherever edges are, for a footprint, and how far they would be from themselves, for losses."""
    if not found.possible:
        return found, np.inf, 0.0, None, None
    spec = search_spec(found.probes[-1].name)
    shown = select_shown(select, found)
    moved = shown.mean(axis=0) - before.mean(axis=0)
    edges = None
    if spec.splits_echoes:
        metric = select.along_edges(found.model(select.model), 800, found.nuisance)
        nearer = select.distance(before, metric=metric) - select.distance(shown, metric=metric)
        edges = nearer, metric.square(moved)
    own = own_distance(select, found) if spec.at_random == "loses echoes" else None
    return found, select.distance(shown), select.metric.square(moved), edges, own


def to_the_end(simulator: Simulator, select: Simulator, before: FloatArray, now: Fit) -> Tried:
    """What `tried` tells of a fit, when it leads no further: its numbers, then the nuisances, and so again while that
    comes nearer by much, since an offset that was fitted beside a pose that is off has made up for that."""
    end = fit_nuisance(simulator, finished(simulator, now))
    for _ in range(_AGAIN):
        again = fit_nuisance(simulator, finished(simulator, end))
        if not again.distance < end.distance - _MUCH:
            break
        end = again
    return on_select(select, before, end)


def select_distance(select: Simulator, at: Fit) -> float:
    """Distance on the select frames of the same effects and nuisances."""
    return select.distance(select_shown(select, at))


def select_shown(select: Simulator, at: Fit) -> FloatArray:
    """What the same effects and nuisances show of the select frames, (seeds, n_summaries)."""
    if not at.probes and at.nuisance.penalty == 0.0:
        return np.zeros((1, len(select.measured)))
    return select.shows(at.model(select.model), nuisance=at.nuisance)


def own_distance(select: Simulator, now: Fit) -> float:
    """How far one more measurement would be if the fit were the truth: an effect that strikes at random strikes
    elsewhere each time."""
    if not now.probes:
        return 0.0
    model = now.model(select.model)
    shown = select.shows(model, nuisance=now.nuisance)
    others = mapped(lambda k: select.summaries.of(select.observations(model, 700 + k, now.nuisance)), range(3))
    return float(np.mean([select.distance(shown, other) for other in others]))


def fit_next(simulator: Simulator, now: Fit, probe: Probe, least: float) -> Fit:
    """The probe's own parameters first, then all together where it may gain `least`."""
    if probe.ways:
        probe = _best_way(simulator, now, probe)
    x = probe.start()
    if not now.probes:
        return fit(simulator, [probe], [x], rounds=3, nuisance=now.nuisance, leaps=True)
    alone = fit(simulator, [probe], [x], rounds=2, nuisance=now.nuisance, model=now.model(simulator.model), leaps=True)
    probes, start = (*now.probes, probe), (*now.x, alone.x[0])
    if not alone.possible or now.distance - alone.distance < _HOPELESS * least:
        return replace(alone, probes=probes, x=start, jacobian=None)
    slopes = None
    if now.jacobian is not None and alone.jacobian is not None:
        slopes = np.column_stack([now.jacobian, alone.jacobian])
    return fit(simulator, probes, start, rounds=1, nuisance=now.nuisance, slopes=slopes)


def _best_way(simulator: Simulator, now: Fit, probe: Probe) -> Probe:
    """The probe from the best of its ways on, or from where it stands if no sensor can have any of them."""
    plain, model = probe.plain(), now.model(simulator.model)
    there = fit(simulator, [plain], [plain.start()], rounds=_PLAIN_ROUNDS, nuisance=now.nuisance, model=model)
    if not there.possible:
        return probe
    settings = plain.weaker(there.x[0], _PART_OF_WAYS).settings
    ways = [replace(probe, settings={**settings, **way}) for way in probe.ways]
    fits = [fit(simulator, [way], [way.start()], rounds=0, nuisance=now.nuisance, model=model) for way in ways]
    return min(zip(fits, ways, strict=True), key=lambda both: both[0].distance)[1]


def finished(simulator: Simulator, now: Fit) -> Fit:
    """A fit that leads no further, with slopes of its own: those that led there were taken far away."""
    return at_whole_steps(simulator, fit(simulator, now.probes, now.x, rounds=TO_THE_END, nuisance=now.nuisance))
