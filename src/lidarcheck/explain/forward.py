"""The rounds of the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.candidates import Probe
from lidarcheck.explain.fit import Fit, fit, fit_nuisance
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.search import MOST_EFFECTS, Screened, Search, Trial, chance_level, screen

FloatArray = npt.NDArray[np.float64]

REFINED = 4
LEAST_PART = 0.05


def empty_fit(lab: Lab) -> Fit:
    """The model as it is."""
    shown = np.zeros((1, len(lab.measured)))
    return Fit((), (), lab.distance(shown), shown)


def search(lab: Lab, select: Lab, probes: Sequence[Probe], told: Callable[[str, int, int], object]) -> Search:
    """Accept one effect after another while it explains more than chance and more than 5 %, at most four."""
    screened = screen(lab, probes, lambda i, n: told("candidates", i, n))
    level = chance_level(lab, screened)
    found = Search(empty_fit(lab), screened=screened)
    start = found.fit.distance
    floor = lab.floor_distance
    for number in range(1, MOST_EFFECTS + 1):
        trials = run_round(lab, select, found.fit, screened, level, number, start, told)
        found.trials += trials
        accepted = [t for t in trials if passes(t)]
        if not accepted:
            break
        found.fit = fit_nuisance(lab, max(accepted, key=merit).fit, rounds=1)
        if found.fit.distance - floor < LEAST_PART * (start - floor):
            break
    if found.fit.probes:
        found.fit = backward(lab, select, found.fit, level, start)
    return found


def backward(lab: Lab, select: Lab, now: Fit, level: float, start: float) -> Fit:
    """Leave out again what gain, reflectances and pose within their usual errors explain as well."""
    now = fit_nuisance(lab, fit(lab, now.probes, now.x, rounds=1, nuisance=now.nuisance), rounds=1)
    while now.probes:
        without = []
        for i in range(len(now.probes)):
            rest = [j for j in range(len(now.probes)) if j != i]
            fewer = fit(lab, [now.probes[j] for j in rest], [now.x[j] for j in rest], rounds=0)
            without.append(fit_nuisance(lab, fewer, rounds=1))
        losses = [one.distance - now.distance for one in without]
        print("      backward", now.names(), [round(v) for v in losses], now.nuisance.words(), round(now.distance))
        least = int(np.argmin(losses))
        if losses[least] > max(3.0 * level, LEAST_PART * (start - lab.floor_distance)):
            break
        now = without[least]
    return now


def merit(trial: Trial) -> float:
    """How much a trial explains on the frames of the fit and on those of the selection."""
    return trial.gain + (trial.select_before - trial.select_after)


def passes(trial: Trial) -> bool:
    return trial.gain > trial.needed and trial.select_before - trial.select_after > 0.15 * trial.gain * 0.33


def run_round(
    lab: Lab,
    select: Lab,
    now: Fit,
    screened: Sequence[Screened],
    level: float,
    number: int,
    start: float,
    told: Callable[[str, int, int], object],
) -> list[Trial]:
    residual = lab.measured - now.shown.mean(axis=0)
    best: dict[str, tuple[float, float, Screened]] = {}
    for one in screened:
        if one.probe.name in now.names():
            continue
        gain, scale = one.gain(lab, residual)
        if gain / one.chance > level and gain > best.get(one.probe.name, (0.0, 0.0, one))[0]:
            best[one.probe.name] = (gain, scale, one)
    order = sorted(best.values(), key=lambda pair: -pair[0])[:REFINED]
    order = [one for one in order if one[0] > 0.45 * order[0][0]]
    before = select_distance(select, now)
    trials = []
    for i, (gain, scale, one) in enumerate(order):
        alone = fit_next(lab, now, one.probe.scaled(scale))
        after = select_distance(select, alone)
        needed = max(level * one.chance, LEAST_PART * start)
        trials.append(
            Trial(one.probe.name, number, alone, now.distance - alone.distance, needed, before, after, gain)
        )
        told(f"fit {number}", i + 1, len(order))
    return trials


def select_distance(select: Lab, at: Fit) -> float:
    """Distance on the select frames of the same effects and nuisances."""
    if not at.probes and at.nuisance.penalty == 0.0:
        return select.distance(np.zeros((1, len(select.measured))))
    return select.distance(select.shows(at.model(select.model), nuisance=at.nuisance))


def fit_next(lab: Lab, now: Fit, probe: Probe) -> Fit:
    """The probe's own parameters first, then all together."""
    x = probe.start()
    if not now.probes:
        return fit(lab, [probe], [x], rounds=3, nuisance=now.nuisance)
    held = Held(lab, now)
    alone = fit(held, [probe], [x], rounds=2, nuisance=now.nuisance)  # type: ignore[arg-type]
    return fit(lab, [*now.probes, probe], [*now.x, alone.x[0]], rounds=1, nuisance=now.nuisance)


class Held:
    """A lab whose model already has some effects."""

    def __init__(self, lab: Lab, now: Fit) -> None:
        self.model = now.model(lab.model)
        self.measured = lab.measured
        self.metric = lab.metric
        self.shows = lab.shows
        self.distance = lab.distance
