"""Rows that say one echo twice, and clouds of which each holds one return of the same beams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.errors import UsageError

__all__ = ["copies", "merged_returns"]

Column = npt.NDArray[Any]
_SAME_FRAME = 0.5
"""Share of a cloud's times that occur in another return's cloud of the same frame."""


def copies(
    layer: IntArray,
    point: IntArray,
    range_m: FloatArray,
    step_m: float,
    *,
    apart: Sequence[Column] = (),
    features: Sequence[Column] = (),
) -> BoolArray:
    """Rows that repeat an echo of the same beam, shape (n,): another number or kind, the same echo otherwise.

    `apart`: echo numbers and return kinds, of which a copy differs in one; without any it stands beside its twin in the
    order of rows. Ranges agree within half of `step_m`, `features` exactly; two missing values are equal.
    """
    order = np.lexsort((np.arange(len(layer)), range_m, point, layer))
    one, other = order[:-1], order[1:]
    same = (layer[one] == layer[other]) & (point[one] == point[other]) & (point[one] >= 0)
    # A millionth of a step: float32 ranges of one step lie that much apart.
    same &= np.abs(range_m[other] - range_m[one]) <= 0.5 * step_m + 1e-6 * np.abs(range_m[one])
    for column in features:
        missing = (column[one] != column[one]) & (column[other] != column[other])
        same &= (column[one] == column[other]) | missing
    distinct = np.abs(other - one) == 1 if not apart else np.zeros(len(same), dtype=np.bool_)
    for column in apart:
        distinct |= column[one] != column[other]
    found = np.zeros(len(layer), dtype=np.bool_)
    found[np.maximum(one, other)[same & distinct]] = True
    return found


def merged_returns(clouds: Sequence[Mapping[str, Column]], on: Sequence[str] = ("ring", "t")) -> dict[str, Column]:
    """Clouds of one frame, a return each, as one: columns of all rows, and `return` with the cloud's number from 1.

    The clouds belong together by ring and time: `UsageError` where hardly a time of one occurs in the first.
    """
    first, *others = clouds
    names = [name for name in first if all(name in cloud for cloud in others)]
    for place, cloud in enumerate(others, start=2):
        shared = [name for name in on if name in names]
        if not shared:
            raise UsageError(f"cloud {place} has no column {' or '.join(on)}", fix="give it one to merge it by")
        common = float(np.mean(np.isin(cloud[shared[-1]], first[shared[-1]]))) if len(cloud[shared[-1]]) else 1.0
        if common < _SAME_FRAME:
            what = f"cloud {place} is another frame: {100.0 * common:.0f} % of its times are in the first"
            raise UsageError(what, fix="merge the returns of one frame")
    numbers = [np.full(len(next(iter(cloud.values()))), i, dtype=np.int32) for i, cloud in enumerate(clouds, start=1)]
    columns = {name: np.concatenate([cloud[name] for cloud in clouds]) for name in names}
    return {**columns, "return": np.concatenate(numbers)}
