"""Uniform numbers turned into counts and normal numbers, and a check that several effects share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError

__all__ = ["check_interval", "normals", "poisson_counts"]

_HALF_STEP = 2.0**-54
"""Half the distance between two uniform numbers: what stands for 0, whose normal number would be infinite."""


def normals(uniform: FloatArray) -> FloatArray:
    """Standard normal numbers by the inverse of the distribution function; same shape."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.maximum(uniform, _HALF_STEP)))


def poisson_counts(uniform: FloatArray, mean: float) -> npt.NDArray[np.int64]:
    """Poisson counts of that mean by the inverse of the distribution function; same shape."""
    from scipy.special import pdtr

    last = int(mean + 12.0 * np.sqrt(mean)) + 40
    below = np.asarray(pdtr(np.arange(last), mean))
    count = np.zeros(uniform.shape, dtype=np.int64)
    some = np.flatnonzero(uniform.ravel() >= below[0])  # where the mean is small, most have none
    count.ravel()[some] = np.searchsorted(below, uniform.ravel()[some], side="right")
    return count


def check_interval(effect: str, first: tuple[str, float], last: tuple[str, float]) -> None:
    """Refuse an interval, given by the names and values of its ends, that ends before it begins."""
    if first[1] > last[1]:
        raise UsageError(
            f"{effect}: {first[0]} = {first[1]:g} is above {last[0]} = {last[1]:g}",
            fix=f"use {first[0]} <= {last[0]}",
        )
