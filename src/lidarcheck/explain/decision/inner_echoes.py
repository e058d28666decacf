"""Echoes in the midst of surfaces: none that a view makes which looks elsewhere.

What such a view shows past edges is nowhere in the ideal scan, so that its other echoes are not asked for. But they lie
where an edge is, or a beam beside it meets something else. Foreign pulses lie anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.effects.search import search_spec
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model

__all__ = ["shows_inside"]

_APART_M, _APART = 1.0, 0.03
"""Beside an edge a neighbour's surface is so much apart, and by this part of the range."""
_MORE, _SURE = 0.25, 4.0
"""There are too many where the measurement has this part more than the model, and so many roots of the number. Of 13
true divergences, turned and shaken views none had more than 0.07 above; foreign pulses that were taken for a view that
shakes had 0.57, columns that report one range 1.24."""
_SEEDS = 4


def shows_inside(seen: Scale, model: Model, names: Sequence[str]) -> bool:
    """Whether many more other echoes were measured in the midst of surfaces than a model shows all of whose named
    effects only look elsewhere; False of others."""
    if not names or not all(search_spec(name).at_edges for name in names):
        return False
    shown = float(np.mean([_inside(seen, one) for one in seen.simulated(model, 9500, _SEEDS)]))
    return bool(_inside(seen, seen.measured) > (1.0 + _MORE) * shown + _SURE * np.sqrt(shown + 1.0))


def _inside(seen: Scale, observations: Observations) -> int:
    """How many other echoes, of no neighbour's surface, have beams whose neighbours all meet what they do."""
    own, beside = seen.beams.distance_m[:, None], seen.beams.neighbour_m
    inner = np.all(np.abs(own - beside) <= _APART_M + _APART * np.maximum(own, beside), axis=1)
    return int(np.count_nonzero(inner[observations.extra_beam] & (observations.extra_side < 0)))
