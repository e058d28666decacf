"""The borders of a dimmed patch, line by line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Effect
from lidarcheck.inference.dimming import Dimming
from lidarcheck.inference.simulator import Simulator

__all__ = ["from_side_to_side", "to_lines"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
Box = tuple[int, int, int, int]
"""First layer, the one behind the last, first point, the one behind the last."""

_ROUNDS = 4
_PARTS = 10
"""A border is looked for within such a part of the view to either side."""


_WHOLE = 0.9
"""A patch over this part of the points, and more, lies over the layers and not on the window."""


def from_side_to_side(simulator: Simulator, effect: Effect) -> bool:
    """Whether a blockage is a band over all points that were fired: dirt is local, layers go from side to side."""
    if effect.name != "blockage":
        return False
    values, points = effect.settings(), np.unique(simulator.beams.point)
    inside = (points >= int(values["first_point"])) & (points <= int(values["last_point"]))
    return bool(inside.mean() >= _WHOLE)


def to_lines(simulator: Simulator, dimming: Dimming, start: Box) -> Box:
    """The rectangle near `start` that is dimmed most against the rest, its borders moved one after another."""
    layers, row = np.unique(simulator.beams.layer, return_inverse=True)
    points, column = np.unique(simulator.beams.point, return_inverse=True)
    group = row * len(points) + column
    mean, weight = dimming.mean(group, len(layers) * len(points))
    shape = len(layers), len(points)
    # Against the rest, and not against the mean of all, of which the patch is a part.
    rest = _outside(simulator, start)
    base, _ = dimming.mean(np.where(rest, 0, -1), 1)
    total = _summed((np.clip(base[0] - mean, -2.0, 2.0) * weight).reshape(shape))
    weights = _summed(weight.reshape(shape))
    found = [
        int(np.searchsorted(lines, edge)) for lines, edge in zip((layers, layers, points, points), start, strict=True)
    ]
    for _ in range(_ROUNDS):
        before = list(found)
        for side in range(4):
            found[side] = _best_border(total, weights, found, side, shape)
        if found == before:
            break
    ends = np.append(layers, layers[-1] + 1), np.append(points, points[-1] + 1)
    return int(ends[0][found[0]]), int(ends[0][found[1]]), int(ends[1][found[2]]), int(ends[1][found[3]])


def _outside(simulator: Simulator, box: Box) -> npt.NDArray[np.bool_]:
    layer, point = simulator.beams.layer, simulator.beams.point
    return np.asarray((layer < box[0]) | (layer >= box[1]) | (point < box[2]) | (point >= box[3]))


def _summed(cells: FloatArray) -> FloatArray:
    return np.asarray(np.pad(cells.cumsum(0).cumsum(1), ((1, 0), (1, 0))))


def _best_border(total: FloatArray, weights: FloatArray, box: list[int], side: int, shape: tuple[int, int]) -> int:
    """Where one border of the box lies best: half of what is dimmed counts against what is taken in undimmed."""
    lines = shape[side // 2]
    reach = max(lines // _PARTS, 2)
    low = box[side - 1] + 1 if side % 2 else 0
    high = lines if side % 2 else box[side + 1] - 1
    places = np.arange(max(low, box[side] - reach), min(high, box[side] + reach) + 1)
    if len(places) == 0:
        return box[side]
    own = _within(total, box) / max(_within(weights, box), 1e-9)
    scores = []
    for place in places:
        tried = [*box[:side], int(place), *box[side + 1 :]]
        scores.append(_within(total, tried) - 0.5 * own * _within(weights, tried))
    return int(places[int(np.argmax(scores))])


def _within(summed: FloatArray, box: list[int]) -> float:
    top, bottom, left, right = box
    return float(summed[bottom, right] - summed[top, right] - summed[bottom, left] + summed[top, left])
