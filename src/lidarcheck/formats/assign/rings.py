"""Ring numbers of a cloud, and the channels of the sensor that they mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError

__all__ = ["channels_of", "medians", "reversed_order", "says_nothing"]

_AGAINST = -0.99
"""Rank correlation of the rings' elevations with the channels' from which the rings count from the other end."""
_FEWEST = 3
"""Rings that tell an order."""


def says_nothing(ring: npt.NDArray[Any]) -> bool:
    """Whether a ring column is no ring: one negative number in every row stands for "not known"."""
    return not len(ring) or bool((ring < 0).all())


def channels_of(ring: npt.NDArray[Any], numbers: Sequence[int], layers: int, name: str = "ring") -> IntArray:
    """The channel of each ring number, shape (n,); `numbers`: each channel's ring, empty where it is its index.

    `name`: what the file calls it.

    `UsageError` for a ring that the sensor does not have.
    """
    names = np.asarray(numbers if len(numbers) else np.arange(layers), dtype=np.int64)
    order = np.argsort(names, kind="stable")
    whole = ring.astype(np.int64)
    at = np.minimum(np.searchsorted(names[order], whole), layers - 1)
    unknown = (names[order][at] != whole) | (whole != ring)
    if unknown.any():
        odd = ring[unknown][0]
        what = f"a row has {name} {odd:g}, the sensor's {layers} channels have {names.min()} to {names.max()}"
        fix = "give the sensor file `ring`, each channel's number in the file, or take the file of this sensor"
        raise UsageError(what, fix=fix)
    return order[at].astype(np.int32)


def reversed_order(layer: IntArray, elevation: FloatArray, of_channel: FloatArray) -> IntArray | None:
    """The channels in the other order, shape (layers,), where the rings run against their elevations; else None.

    `layer`, `elevation` [deg], shape (n,): of each row; `of_channel` [deg], shape (layers,): the sensor's. Channels
    change places by their rank in elevation.
    """
    seen, median = medians(elevation, layer)
    if len(seen) < _FEWEST:
        return None
    ranks = [np.argsort(np.argsort(values, kind="stable"), kind="stable") for values in (median, of_channel[seen])]
    if float(np.corrcoef(ranks[0], ranks[1])[0, 1]) > _AGAINST:
        return None
    order = np.argsort(of_channel, kind="stable")
    other = np.empty(len(order), dtype=np.int32)
    other[order] = order[::-1]
    return other


def medians(values: FloatArray, group: npt.NDArray[Any]) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """The groups that occur, ascending, and the median of the values of each."""
    order = np.lexsort((values, group))
    names, start, counts = np.unique(group[order], return_index=True, return_counts=True)
    ordered = values[order]
    return names.astype(np.int64), 0.5 * (ordered[start + (counts - 1) // 2] + ordered[start + counts // 2])
