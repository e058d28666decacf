"""Echoes that only a footprint splits: a beam shows its own surface and, besides, what is beyond the edge next to it.

Where each edge lies to a part of a beam no ideal scan says, and a few straight edges are all that a weak footprint
shows at: a model shows as many split echoes, but not at those edges, and hardly closes the gap. What speaks for the
name is that there are such echoes, which no error of the aim makes, and that away from edges next to nothing is open.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.effects.search import search_spec
from lidarcheck.inference.observed.edges import at_borders
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model

__all__ = ["only_edges_stay"]

_FEWEST, _TIMES = 30, 3.0
"""Split echoes speak for a footprint if there are so many, and so many times as many as without it."""
_PART = 0.3
"""As large a part of the model's must have been measured, and the reverse."""
_OPEN = 0.15
"""Of the gap, so large a part may be open away from edges."""


def only_edges_stay(seen: Scale, model: Model, before: float) -> bool:
    """Whether echoes are split at edges as the model's footprint says, and what stays open is at edges; False without a
    footprint. `before`: the gap beyond chance without the model's effects."""
    footprints = [effect.name for effect in model.effects if search_spec(effect.name).splits_echoes]
    if not footprints:
        return False
    without = model
    for name in footprints:
        without = without.without(name)
    with_, plain = (_split(seen.simulated(one, 9700, 1)[0]) for one in (model, without))
    measured = _split(seen.measured)
    if measured < max(_FEWEST, _TIMES * plain):
        return False
    more, shown = measured - plain, with_ - plain
    return more > _PART * shown and shown > _PART * more and _off_edges(seen, model) < _OPEN * before


def _split(observations: Observations) -> int:
    """The number of echoes at a neighbour's range beside those of the beam's own surface."""
    return int(np.count_nonzero((observations.extra_side >= 0) & observations.detected[observations.extra_beam]))


def _off_edges(seen: Scale, model: Model) -> float:
    """The gap that a model leaves beyond chance of beams that no border is next to."""
    inner = (~at_borders(seen.beams)).astype(np.float64)
    return float(seen.excess_by_part(model, weight=inner)[0].mean())
