"""Sums of products in one order, and the places of a quadrature."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.elementary.angles import cos

__all__ = ["gauss_legendre", "product"]

_NEWTON_STEPS = 6


def gauss_legendre(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Places between -1 and 1 and weights of Gauss-Legendre quadrature, shape (nodes,) each, rising.

    By Newton's method from Tricomi's guess on the three-term recurrence.
    """
    order = np.arange(nodes, 0, -1)
    x = cos(math.pi * (order - 0.25) / (nodes + 0.5))
    for _ in range(_NEWTON_STEPS):
        before, value = np.ones(nodes), x
        for k in range(2, nodes + 1):
            before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
        slope = nodes * (x * value - before) / (x * x - 1.0)
        x = x - value / slope
    return x, 2.0 / ((1.0 - x * x) * slope * slope)


def product(a: Any, b: Any) -> FloatArray:
    """What `a @ b` means, summed in one order: libraries of linear algebra choose theirs by the processor."""
    left, right = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return np.asarray(np.einsum("...j,j->..." if right.ndim == 1 else "...j,jk->...k", left, right))
