"""Numbers that act in whole bins, or are most often whole: fitted step by step, the others anew at each.

Between two bins nothing changes, and at one all does at once. A fit of all numbers together goes by slopes, which are
those of a whole step or none, and ends where the others have made up for the wrong one. A threshold between two whole
numbers is dithered; most are not, and whole ones are tried as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.sensor import Program

__all__ = ["at_whole_steps"]

_ROUNDS, _MOST = 3, 4
"""Steps of each fit of the others, and how far a number is followed to one side."""


def at_whole_steps(simulator: Simulator, now: Fit) -> Fit:
    """The fit with each such number where it comes nearest, or as it is where it has none or nothing is nearer."""
    for k, probe in enumerate(now.probes):
        for j, free in enumerate(probe.free):
            steps = {} if isinstance(simulator.model.sensor, Program) else search_spec(probe.name).whole_steps
            width = steps.get(free.name)
            if width is not None:
                now = _followed(simulator, now, k, j, width(simulator.model.sensor))
    return now


def _followed(simulator: Simulator, now: Fit, k: int, j: int, width: float) -> Fit:
    """The fit with the j-th number of the k-th effect followed to the side on which it comes nearer."""
    probe = now.probes[k]
    middle = np.floor(now.x[k][j] * probe.free[j].step / width + 0.5) * width
    best = min(now, _at(simulator, now, k, j, middle), key=lambda one: one.distance)
    for way in (width, -width):
        for steps in range(1, _MOST + 1):
            found = _at(simulator, best, k, j, middle + way * steps)
            if not found.distance < best.distance:
                break
            best = found
    return best


def _at(simulator: Simulator, now: Fit, k: int, j: int, value: float) -> Fit:
    """The others fitted with the number at a value."""
    held = _held(now.probes[k], j, value)
    probes, x = [*now.probes], [*now.x]
    probes[k], x[k] = held, np.delete(now.x[k], j)
    found = fit(simulator, probes, x, rounds=_ROUNDS, nuisance=now.nuisance)
    ends = [*found.x]
    ends[k] = np.insert(found.x[k], j, value / now.probes[k].free[j].step)
    return replace(found, probes=now.probes, x=tuple(ends), jacobian=None)


def _held(probe: Probe, j: int, value: float) -> Probe:
    """The same start with a number that is not free any more."""
    name = probe.free[j].name
    return replace(probe, settings={**probe.settings, name: value}, free=(*probe.free[:j], *probe.free[j + 1 :]))
