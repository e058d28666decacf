"""The last judgements beam by beam: which small errors to put right, and whether the named effects close the gap."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from lidarcheck.crew import Crew
from lidarcheck.explain.edges import AT_EDGES
from lidarcheck.explain.explanation import Gap
from lidarcheck.explain.forward import are_kin
from lidarcheck.explain.gap import PARTS, Scale, excesses
from lidarcheck.explain.nuisances import Nuisance
from lidarcheck.model.spec import Model

__all__ = ["calibrated", "carries_over", "widening"]

_LEAST_CLOSED, _LEAST_CLOSED_EDGES, _LEAST_CLOSED_KIN, _SURE = 0.4, 0.25, 0.85, 3.0
"""Effects that close less of the gap are not what it is made of, if it is more than chance by so many of its standard
deviations; less of it closes where all that shows is at edges, each of which is where the scan does not say. Effects
that change the same features in the same way must close more: together they come near to many a third one."""
_EXACT = {"range_offset", "range_scale"}
_LEFT_IN_RANGE, _STANDARD_DEVIATIONS_LEFT = 0.04, 0.15
"""These have one form only, so that hardly anything of the ranges may stay open: this part, or so much on the mean of
both kinds of frames. Of true ones up to 2 % stayed, or 0.14, where reflectances and pose were off and not fitted."""

_WIDER = 0.03
"""An effect that widens the gap by this part of what was open without it does not help there."""


def calibrated(seen: Scale, model: Model, off: Nuisance, crew: Crew) -> Model:
    """The model with the small errors put right that were fitted beside the effects, all or those of reflectances,
    whichever comes nearest: an ideal scan says too little of edges to turn its beams by a part of one."""
    tables = dataclasses.replace(off, yaw=0.0, pitch=0.0)
    ways = [model, *(one.calibrated(model) for one in (tables, off) if one.words())]
    if len(ways) == 1:
        return model
    left = [excess for excess, _ in excesses(seen, ways, crew)]
    return ways[int(np.argmin(left))]


def widening(gap: Gap, names: Sequence[str]) -> list[str]:
    """Those of the names whose effects leave a wider gap than there was without them, beyond a little chance."""
    values = [gap.before.value, *(one.value for _, one in gap.waterfall)]
    found = []
    for (name, _), before, after in zip(gap.waterfall, values[:-1], values[1:], strict=True):
        if name in names and after - before > _WIDER * max(before - gap.floor.value, 0.0):
            found.append(name)
    return found


def carries_over(seen: Scale, first: Model, last: Model, gap: Gap, crew: Crew, names: Sequence[str] = ()) -> bool:
    """Whether a good part of the gap closes between two models, over the frames that no fit has seen and all others
    alike; `names`: the effects that the last one has more.

    Where there is no gap beyond chance, this cannot be asked. What a beam meets that looks past an edge is nowhere in
    the ideal scan: of effects that are of nothing else, the other echoes are left out.
    """
    at_edges = bool(names) and all(name in AT_EDGES for name in names)
    parts = [part for part in PARTS if part != "other echoes" or not at_edges]
    whole, left, chance = _open(seen, (first, last), gap, crew, parts)
    kin = any(are_kin(one, other) for one, other in itertools.combinations(names, 2))
    least = _LEAST_CLOSED_EDGES if at_edges else _LEAST_CLOSED_KIN if kin else _LEAST_CLOSED
    if whole > _SURE * chance and left > (1.0 - least) * whole:
        return False
    if not names or not _EXACT.issuperset(names):
        return True
    whole, left, _ = _open(seen, (first, last), gap, crew, ["range"])
    return left <= max(_LEFT_IN_RANGE * whole, 2.0 * _STANDARD_DEVIATIONS_LEFT)


def _open(
    seen: Scale, models: tuple[Model, Model], gap: Gap, crew: Crew, parts: Sequence[str]
) -> tuple[float, float, float]:
    """What is open with the first of two models and with the last one, of some parts of the gap, on the frames that no
    fit has seen and on all others together; and the standard deviation of chance on these."""
    (before, chance), (after, _) = excesses(seen, models, crew, parts)
    there = _beyond_the_floor(gap, parts)
    return before + there[0], after + there[1], chance


def _beyond_the_floor(gap: Gap, parts: Sequence[str]) -> tuple[float, float]:
    """The gap above its floor before and after, of some parts alone."""
    if len(parts) == len(PARTS):
        return gap.before.value - gap.floor.value, gap.after.value - gap.floor.value
    before, after, floor = np.mean([gap.by_feature[part] for part in parts], axis=0).tolist()
    return before - floor, after - floor
