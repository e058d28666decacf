"""The last judgements beam by beam: which small errors to put right, and whether the named effects close the gap."""

from __future__ import annotations

import dataclasses

import numpy as np

from lidarcheck.crew import Crew
from lidarcheck.explain.explanation import Gap
from lidarcheck.explain.gap import Scale, excesses
from lidarcheck.explain.nuisances import Nuisance
from lidarcheck.model.spec import Model

__all__ = ["calibrated", "carries_over"]

_LEAST_CLOSED, _SURE = 0.4, 3.0
"""Effects that close less of the gap are not what it is made of, if it is more than chance by so many of its standard
deviations."""


def calibrated(seen: Scale, model: Model, off: Nuisance, crew: Crew) -> Model:
    """The model with the small errors put right that were fitted beside the effects, all or those of reflectances,
    whichever comes nearest: an ideal scan says too little of edges to turn its beams by a part of one."""
    tables = dataclasses.replace(off, yaw=0.0, pitch=0.0)
    ways = [model, *(one.calibrated(model) for one in (tables, off) if one.words())]
    if len(ways) == 1:
        return model
    left = [excess for excess, _ in excesses(seen, ways, crew)]
    return ways[int(np.argmin(left))]


def carries_over(seen: Scale, first: Model, last: Model, gap: Gap, crew: Crew) -> bool:
    """Whether a good part of the gap closes between two models, over the frames that no fit has seen and all others
    alike.

    Where there is no gap beyond chance, this cannot be asked.
    """
    (before, chance), (after, _) = excesses(seen, (first, last), crew)
    whole = before + gap.before.value - gap.floor.value
    left = after + gap.after.value - gap.floor.value
    return whole <= _SURE * chance or left <= (1.0 - _LEAST_CLOSED) * whole
