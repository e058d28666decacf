"""Fewer values for a picture: more would not show."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

__all__ = ["thinned", "thinned_cloud"]

_CLOUD = 5000

_Number = TypeVar("_Number", bound=np.generic)


def thinned(values: npt.NDArray[_Number], most: int) -> npt.NDArray[_Number]:
    """Every so many-th of the rows, so that they are no more than `most`."""
    return values[:: max(-(-len(values) // most), 1)]


def thinned_cloud(points: npt.NDArray[_Number]) -> npt.NDArray[_Number]:
    """Every so many-th of the points, shape (n, 3), so that they are not much more than 5 000."""
    return points[:: max(len(points) // _CLOUD, 1)]
