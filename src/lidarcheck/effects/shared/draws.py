"""Uniform numbers turned into counts and normal numbers, and a check that several effects share."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.errors import UsageError

__all__ = ["check_interval", "normals", "poisson_struck", "strikes"]

_HALF_STEP = 2.0**-54
"""Half the distance between two uniform numbers: what stands for 0, whose normal number would be infinite."""


def normals(uniform: FloatArray) -> FloatArray:
    """Standard normal numbers by the inverse of the distribution function; same shape."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.maximum(uniform, _HALF_STEP)))


def poisson_struck(uniform: FloatArray, mean: float) -> tuple[IndexArray, IndexArray]:
    """Poisson counts of that mean by the inverse of the distribution function: of `uniform` (n,) the places where they
    are not 0, and the counts there; shapes (m,)."""
    from scipy.special import pdtr

    last = int(mean + 12.0 * np.sqrt(mean)) + 40
    below = np.asarray(pdtr(np.arange(last), mean))
    struck = np.flatnonzero(uniform >= below[0])
    return struck, np.searchsorted(below, uniform[struck], side="right").astype(np.int64)


def strikes(around: Surroundings, layer: IntArray, point: IntArray, mean: float) -> tuple[IndexArray, FloatArray]:
    """Events that strike beams (n,) independently, `mean` of them in each on average: the beam of every event, in
    order, and two uniform numbers of its own; shapes (m,), (m, 2)."""
    struck, count = poisson_struck(around.uniforms(layer, point)[:, 0], mean)
    first = np.cumsum(count) - count
    numbers = np.empty((int(count.sum()), 2))
    numbers[first] = around.uniforms(layer[struck], point[struck], 3)[:, 1:]
    # Nearly all have one event; the others' further numbers are drawn for them alone.
    many = np.flatnonzero(count > 1)
    if len(many):
        rows, most = struck[many], int(count.max())
        drawn = around.uniforms(layer[rows], point[rows], 1 + 2 * most)[:, 1:].reshape(-1, most, 2)
        for event in range(1, most):
            more = count[many] > event
            numbers[first[many[more]] + event] = drawn[more, event]
    return np.repeat(struck, count), numbers


def check_interval(effect: str, first: tuple[str, float], last: tuple[str, float]) -> None:
    """Refuse an interval, given by the names and values of its ends, that ends before it begins."""
    if first[1] > last[1]:
        raise UsageError(
            f"{effect}: {first[0]} = {first[1]:g} is above {last[0]} = {last[1]:g}",
            fix=f"use {first[0]} <= {last[0]}",
        )
