"""What strikes at random strikes neither one place twice nor beside one thing: a check on names of effects that do.

An effect that adds or loses echoes at random, or turns the view, can take up as many as a fault adds or loses in the
same columns of every frame, and the means over all frames are the same. From frame to frame they are not. And single
columns that foreign pulses strike have so large a noise of their own that what a sign lights around it may be them, if
it were not always there and at the sign's range, and what it sends back twice, if it were not on the sign alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import search_spec
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["recurs"]


_SEEDS = 4
_MORE, _SURE = 0.3, 4.0
"""Echoes recur in the same columns where frames agree on these better than the model's do, by so large a correlation
and by so many of its standard deviations."""
_MORE_BESIDE, _FEWEST = 0.25, 30
"""They gather where such a larger part of them lies at the range of a bright target beside, or on one material, and so
many do."""


def recurs(seen: Scale, model: Model, name: str, pool: WorkerPool) -> bool:
    """Whether the echoes that an effect of the model is to add or lose at random are the same columns' in every frame,
    or those that it is to add gather beside bright targets; False of effects that do not strike at random."""
    at_random = search_spec(name).at_random
    if not at_random:
        return False
    with_, without = pool.map(_shown, ((seen.shared, one) for one in (model, model.without(name))))
    count = _lost if at_random == "loses echoes" else _others
    usual = sum(count(seen, one) for one in without) / _SEEDS
    measured, *random = (_agreement(count(seen, one) - usual) for one in (seen.measured, *with_))
    if _is_more(measured, random, _MORE):
        return True
    return at_random == "adds echoes" and _gathers(seen, with_, without)


def _is_more(measured: float, random: Sequence[float], least: float) -> bool:
    """Whether the measurement has more of something than the model's simulations, beyond chance."""
    return bool(measured > np.mean(random) + max(least, _SURE * float(np.std(random, ddof=1))))


def _gathers(seen: Scale, with_: Sequence[Observations], without: Sequence[Observations]) -> bool:
    """Whether a larger part of the measured echoes that are too many lies beside bright targets, at their range, or on
    beams that meet one material: foreign pulses strike whatever a beam meets."""
    usual = np.mean([_gathered(seen, one) for one in without], axis=0)
    measured, *random = (np.maximum(_gathered(seen, one) - usual, 0.0) for one in (seen.measured, *with_))
    part, *own = (np.minimum(one[1:] / max(one[0], 1.0), 1.0) for one in (measured, *random))
    return any(
        there >= _FEWEST and _is_more(float(here), simulated, _MORE_BESIDE)
        for there, here, simulated in zip(measured[1:], part, np.transpose(own).tolist(), strict=True)
    )


def _gathered(seen: Scale, observations: Observations) -> FloatArray:
    """How many echoes of no surface there are, how many of them at the range of a bright target beside them, and how
    many on beams that meet each material, or nothing."""
    beams, lone = seen.beams, observations.extra_side < 0
    beam, range_m = observations.extra_beam[lone], observations.extra_m[lone, None]
    near = ((beams.bright[beam] > 0) & (np.abs(range_m - beams.bright_m[beam]) < beams.view.match_m)).any(axis=1)
    _, material = np.unique(beams.material_id, return_inverse=True)
    on_each = np.bincount(material[beam], minlength=int(material.max()) + 1)
    return np.array([len(beam), np.count_nonzero(near), *on_each], dtype=np.float64)


def _shown(seen: Scale, model: Model) -> list[Observations]:
    return seen.simulated(model, 9600, _SEEDS)


def _agreement(count: FloatArray) -> float:
    """The correlation of what two frames show, column by column, mean over all pairs; `count`: (n_frames, n_points)."""
    off = count - count.mean(axis=1, keepdims=True)
    size = np.sqrt((off**2).sum(axis=1))
    pairs = [(off[i] @ off[j], size[i] * size[j]) for i, j in itertools.combinations(range(len(off)), 2)]
    both, alone = np.array(pairs).sum(axis=0)
    return float(both / max(alone, 1e-9))


def _others(seen: Scale, observations: Observations) -> FloatArray:
    """The number of echoes of no surface in each frame's columns, shape (n_frames, n_points)."""
    return _by_column(seen, observations.extra_beam[observations.extra_side < 0])


def _lost(seen: Scale, observations: Observations) -> FloatArray:
    """The number of surfaces that are not detected in each frame's columns, shape (n_frames, n_points)."""
    return _by_column(seen, np.flatnonzero((seen.beams.distance_m > 0.0) & ~observations.detected))


def _by_column(seen: Scale, beam: npt.NDArray[np.int64]) -> FloatArray:
    """How many of the beams lie in each frame's columns, shape (n_frames, n_points)."""
    _, point = np.unique(seen.beams.point, return_inverse=True)
    found = np.zeros((len(seen.frames), int(point.max()) + 1))
    np.add.at(found, (seen.beams.frame[beam], point[beam]), 1.0)
    return found
