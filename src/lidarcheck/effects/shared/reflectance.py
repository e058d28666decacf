"""The reflectance that rows of an ideal scan have of their own, in the place of their materials'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.scan import IdealScan

__all__ = ["REFLECTANCE", "reflectance_of", "with_reflectance"]

REFLECTANCE = "Reflectance"
"""The further column of an ideal scan that holds it."""


def reflectance_of(ideal: IdealScan) -> FloatArray | None:
    """Each row's own, shape (n,), NaN where its material's counts; None where it does in all rows."""
    column = ideal.extra.get(REFLECTANCE)
    return None if column is None else np.asarray(column, dtype=np.float64)


def with_reflectance(ideal: IdealScan, column: FloatArray) -> IdealScan:
    """The same rows with that reflectance of their own, shape (n,)."""
    return replace(ideal, extra={**ideal.extra, REFLECTANCE: column})
