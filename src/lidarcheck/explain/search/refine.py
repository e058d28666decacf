"""The last fit: the accepted effects on all frames but those of the verification, around the model that has them.

Summaries are compressed far from the model that they are relative to, and there a fit is blunt. Around the explained
model the residuals are small, so that parameters and their intervals come out sharp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lidarcheck.cases.frame import Frame
from lidarcheck.explain.search.fitted_tables import read_again
from lidarcheck.explain.search.whole_bins import at_whole_steps
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model

__all__ = ["Judged", "judged", "polished"]


@dataclass(frozen=True)
class Judged:
    """A fit around its own model, with the lab around that, and the gap that it leaves beam by beam, beyond its own
    noise; that noise's standard deviation is `chance`."""

    simulator: Simulator
    last: Fit
    left: float
    chance: float


def judged(scale: Scale, model: Model, now: Fit, seed: int) -> Judged:
    """The fit polished on the scale's frames, and judged there."""
    simulator, last = polished(scale.frames, model, now, seed)
    return Judged(simulator, last, *scale.excess(last.model(model), last.nuisance))


def polished(frames: Sequence[Frame], model: Model, now: Fit, seed: int) -> tuple[Simulator, Fit]:
    """A lab around the explained model, and the same effects and nuisances fitted again there.

    Of the new fit and the old one the nearer is taken: far from the sensor's form there may be no better point.
    """
    simulator = Simulator(frames, now.model(model), seed)
    there = fit(simulator, now.probes, now.x, rounds=0, nuisance=now.nuisance)
    best = fit(simulator, now.probes, now.x, rounds=3, nuisance=now.nuisance)
    best = fit_nuisance(simulator, best, rounds=2)
    best = read_again(simulator, best)
    again = fit(simulator, best.probes, best.x, rounds=1, nuisance=best.nuisance, slopes=best.jacobian)
    return simulator, at_whole_steps(simulator, min((there, best, again), key=lambda one: one.distance))
