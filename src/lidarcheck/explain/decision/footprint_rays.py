"""How many rays a footprint has: the search takes few, which is fast and near a flat profile of the light; more see
what the faint flanks of a bell meet. What leaves less of the gap beam by beam is taken.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.effects.geometry.footprint import offsets_rad
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.inference.gauss_newton import Fit, fit
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["with_best_rays"]

_NAME, _MORE, _ROUNDS = "beam_divergence", 5, 2


def with_best_rays(seen: Scale, case: Model, polish: Polished, pool: WorkerPool) -> Polished:
    """The last fit, its footprint's widths fitted anew with more rays where that leaves less of the gap."""
    if _NAME not in polish.last.names():
        return polish
    start = _with_rays(polish.last, _MORE)
    more = fit(polish.simulator, start.probes, start.x, rounds=_ROUNDS, nuisance=start.nuisance)
    if not more.possible:
        return polish
    both = [(seen.held, one.model(case), one.nuisance) for one in (polish.last, more)]
    (few_left, _), (more_left, _) = pool.map(Scale.excess, both)
    return replace(polish, last=more) if more_left < few_left else polish


def _with_rays(now: Fit, rays: int) -> Fit:
    """The same fit with so many rays along either axis, which spread as far in the root mean square."""
    at = now.names().index(_NAME)
    probe = now.probes[at]
    factor = _spread(int(probe.fixed["rays"])) / _spread(rays)
    other = replace(probe.weaker(now.x[at], factor), fixed={**probe.fixed, "rays": rays})
    probes, x = list(now.probes), list(now.x)
    probes[at], x[at] = other, other.start()
    return replace(now, probes=tuple(probes), x=tuple(x), jacobian=None)


def _spread(rays: int) -> float:
    """How far so many rays of a footprint of width 1 spread, in the root mean square."""
    return float(np.std(offsets_rad(1.0, rays)))
