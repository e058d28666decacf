"""What speaks against saying that there is no gap: echoes lost or added beyond chance, a classifier that still tells.

The distance is a mean over beams, and small where few beams differ or where features differ together. Usual errors of
gain, reflectances and pose are put right before anything is asked: they are no gap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lidarcheck.arrays import IndexArray
from lidarcheck.explain.search.selection import start_fit
from lidarcheck.inference.classifier import Chance, Classifier
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.usual_ranges import usual_range_errors_m
from lidarcheck.workers.threads import mapped

__all__ = ["against_no_gap", "rates_beyond_chance", "still_tells"]

_SEEDS, _FIRST = 12, 500
"""Simulations that say how many echoes are lost and added where nothing is missing, apart from the seeds of fits."""
_SURE = 3.3
"""A number beyond so many standard deviations is no chance: one in a thousand of both questions together."""
_SEEN = 0.999
"""A surface that is seen so surely is lost by nothing that gain and reflectances are usually off by."""


def against_no_gap(select: Simulator, classifier: Classifier, off: Nuisance, chance: Chance | None = None) -> str:
    """What speaks against "no gap" on the select frames, in words; empty where nothing does."""
    rates = select.frames[0].origin.judges_rates
    return (rates and rates_beyond_chance(select, off)) or still_tells(select, classifier, off, chance)


def rates_beyond_chance(select: Simulator, off: Nuisance) -> str:
    """How many surely seen surfaces are lost, or other echoes there, if that is beyond chance, in words; else empty.

    Where another surface is near, a usual error of the pose makes both: beams at edges are not asked. `select`: the
    select frames; `off`: the usual errors that were fitted.
    """
    shown = mapped(lambda k: select.observations(select.model, _FIRST + k, off), range(_SEEDS))
    expected = select.summaries.expected
    sure = (expected.probability > _SEEN) & expected.known & ~expected.at_edge

    def lost(one: Observations) -> IndexArray:
        return (sure & ~one.detected).astype(np.int64)

    def added(one: Observations) -> IndexArray:
        lone = one.extra_beam[one.extra_side < 0]
        return np.where(expected.at_edge, 0, np.bincount(lone, minlength=len(sure)))

    found = []
    for count, words in ((lost, f"of {sure.sum()} surfaces that are surely seen"), (added, "echoes of no surface")):
        there, usual, sd = _compared(count, select.measured_observations, shown)
        if there - usual > _SURE * sd or (count is added and usual - there > _SURE * sd):
            verb = "are lost" if count is lost else "are there"
            found.append(f"{there} {words} {verb}, by chance {usual:.1f}")
    return "; ".join(found)


def _compared(
    count: Callable[[Observations], IndexArray], measured: Observations, shown: list[Observations]
) -> tuple[int, float, float]:
    """A number of beams that was measured, its mean over simulations, and the standard deviation of the difference."""
    numbers = np.array([count(one) for one in shown])
    # Beams are independent under the model; one more than expected is no surprise where none is.
    sd = np.sqrt((numbers.var(axis=0, ddof=1).sum() + 1.0) * (1.0 + 1.0 / len(numbers)))
    return int(count(measured).sum()), float(numbers.sum(axis=1).mean()), float(sd)


def still_tells(select: Simulator, classifier: Classifier, off: Nuisance, chance: Chance | None) -> str:
    """By how much a classifier tells measured from simulated echoes of the select frames with usual errors put right,
    if that is beyond chance, in words; else empty.

    The usual errors are those that were fitted, else those of the select frames alone: what is in view there need not
    be in view elsewhere.
    """
    inner = classifier.but_for(select.summaries.expected.at_edge)
    floor = inner.floor(chance)
    figure = _put_right(select, inner, off)
    if figure is None or floor is None or figure <= floor:
        return ""
    own = start_fit(select, nuisances=True).nuisance
    figure = min(figure, _put_right(select, inner, own) or 0.0)
    if figure <= floor:
        return ""
    return f"a classifier tells measured echoes from simulated ones by {figure:.3f}, by chance {floor:.3f}"


def _put_right(select: Simulator, inner: Classifier, off: Nuisance) -> float | None:
    """The classifier's figure with the case's model but for usual errors."""
    shown = select.observations(select.model, 0, off)
    spread = select.summaries.expected.spread[:, 0]
    longer_m = usual_range_errors_m(select.beams, spread, select.measured_observations, shown)
    return inner.gap(select.model, off, longer_m)
