"""Location and spread of a sample, and the double validation metric that separates the two."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.kpi.distances import ordered, wasserstein

__all__ = ["GAUSS_SHARE", "Dvm", "dvm", "mean", "spread"]

GAUSS_SHARE = 0.6826894921370859
"""Share of a Gaussian within one standard deviation of its mean."""


class Dvm(NamedTuple):
    """Double validation metric, both in the feature's unit.

    `bias`: mean of measured minus mean of simulated; `scatter`: the area between the distributions that remains once
    the simulated sample has been moved by it.
    """

    bias: float
    scatter: float


def dvm(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> Dvm:
    """Double validation metric of two samples, shapes (n,) and (m,); NaN where either is empty.

    Rosenberger et al.: a model error d, the difference of the means, and the AVM without it. The area is absolute: a
    signed one is zero by construction once the bias is gone. Constant samples have a scatter of 0.
    """
    m, s = ordered(measured), ordered(simulated)
    bias = mean(m) - mean(s)
    if np.isnan(bias):
        return Dvm(bias, bias)
    # Both moved to their own mean, not one to the other's: symmetric, and no digits lost to a large offset.
    return Dvm(bias, wasserstein(m - mean(m), s - mean(s)))


def mean(values: npt.ArrayLike) -> float:
    """Mean of a sample, shape (n,), in its unit; NaN where it is empty."""
    sample = np.asarray(values, dtype=np.float64)
    return float(sample.mean()) if sample.size else float("nan")


def spread(values: npt.ArrayLike) -> float:
    """Half the width of the central 68.3 % of a sample, shape (n,), in its unit.

    The standard deviation of a Gaussian, and unmoved by outliers (up to 15.9 % on either side). 0 for constant and
    one-value samples, NaN for an empty one.
    """
    sample = ordered(values)
    if not sample.size:
        return float("nan")
    low, high = np.quantile(sample, [0.5 - 0.5 * GAUSS_SHARE, 0.5 + 0.5 * GAUSS_SHARE])
    return float(0.5 * (high - low))
