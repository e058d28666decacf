"""What a mirror shows of things that no beam meets.

They lie beyond the view or behind others, so that no model can place their images from ideal scans. These stay open,
however right the name: what speaks for it is that the images are there of all that is in view, and that no other echoes
stay but behind the mirror.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import search_spec
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model

__all__ = ["only_images_stay"]

Flags = npt.NDArray[np.bool_]

_CONFIRMED, _FEWEST = 0.7, 20
"""So many images must be in view, and of these so large a part of what one simulation shows of another's."""
_ELSEWHERE, _BY_CHANCE = 0.15, 2.0
"""Of the other echoes that stay unplaced, no larger a part may lie elsewhere than behind the mirror, beyond what chance
leaves there and so many standard deviations of that."""
_OF_IMAGES = 0.1
"""A material behind which lie more than such a part of the images, and more than one, is a mirror's."""
_BEAMS, _PART_OF_RANGE = 1.2, 0.03
"""An image so many beams off, or by this part of its range, is the same one: poses are a little off."""
_SEEDS = 3


def only_images_stay(seen: Scale, model: Model, nuisance: Nuisance) -> bool:
    """Whether the images that a model's mirror shows were measured, and hardly any other echoes stay that it does not
    show but behind the mirror; False without one."""
    mirror = next((effect.name for effect in model.effects if search_spec(effect.name).shows_images), None)
    if mirror is None:
        return False
    one, *others = seen.simulated(model, 9700, _SEEDS, nuisance)
    without = seen.simulated(model.without(mirror), 9700, 1, nuisance)[0]
    mirrors = _mirrors(seen, one, without)
    shown, there = _places(seen, one), _places(seen, seen.measured)
    image = _behind(seen, one, mirrors)
    again = _near(shown[image], _places(seen, others[0])).mean() if image.any() else 0.0
    if image.sum() < _FEWEST or _near(shown[image], there).mean() < _CONFIRMED * again:
        return False
    placed = np.concatenate([_places(seen, other) for other in others])
    behind, elsewhere = _unplaced(seen, seen.measured, mirrors, placed)
    # What one simulation shows and the others do not is what chance leaves unplaced, too.
    _, by_chance = _unplaced(seen, one, mirrors, placed)
    return bool(elsewhere <= by_chance + _BY_CHANCE * np.sqrt(by_chance + 1.0) + _ELSEWHERE * behind)


def _unplaced(seen: Scale, observations: Observations, mirrors: Flags, placed: FloatArray) -> tuple[int, int]:
    """How many echoes of no surface that is near are nowhere in `placed`: behind the mirror, and elsewhere."""
    unplaced = (observations.extra_side < 0) & ~_near(_places(seen, observations), placed)
    behind = _behind(seen, observations, mirrors)
    return int(np.sum(unplaced & behind)), int(np.sum(unplaced & ~behind))


def _mirrors(seen: Scale, with_: Observations, without: Observations) -> Flags:
    """The beams that meet a material which mirrors, shape (n_beams,): behind it are most of the model's images."""
    _, material = np.unique(seen.beams.material_id, return_inverse=True)
    more, less = (np.bincount(material[one.extra_beam], minlength=material.max() + 1) for one in (with_, without))
    images = more - less
    least = max(_OF_IMAGES * images.sum(), 1.0)
    return np.asarray((images > least)[material] & (seen.beams.distance_m > 0.0))


def _behind(seen: Scale, observations: Observations, mirrors: Flags) -> Flags:
    """Which of the other echoes lie behind a surface that mirrors, shape (m,)."""
    return np.asarray(
        mirrors[observations.extra_beam] & (observations.extra_m > seen.beams.distance_m[observations.extra_beam])
    )


def _places(seen: Scale, observations: Observations) -> FloatArray:
    """Where the other echoes lie, apart by more than 1 where they are not the same; shape (m, 4)."""
    beam = observations.extra_beam
    frame, layer, point = seen.beams.frame[beam], seen.beams.layer[beam], seen.beams.point[beam]
    depth = np.log(np.maximum(observations.extra_m, 0.1)) / _PART_OF_RANGE
    return np.column_stack([2.0 * frame, layer / _BEAMS, point / _BEAMS, depth])


def _near(places: FloatArray, others: FloatArray) -> Flags:
    """Which of the places are one of the others, too, shape (m,)."""
    if len(places) == 0 or len(others) == 0:
        return np.zeros(len(places), dtype=bool)
    apart, _ = cKDTree(others).query(places, p=np.inf, distance_upper_bound=1.0)
    return np.asarray(np.isfinite(apart))
