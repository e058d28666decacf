"""What empirical terms of the readout do to echoes: draws of their own, whole numbers, and numbering them anew."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.scan import Scan

__all__ = ["draws_of", "whole"]


def draws_of(scan: Scan, around: Surroundings, draws: int = 1) -> FloatArray:
    """Uniform numbers of each echo's own, shape (n, draws), of at least one echo; the same for a beam's first echo
    however many it has."""
    echo = np.maximum(scan.echo_number.astype(np.int64) - 1, 0)
    uniform = around.uniforms(scan.layer, scan.point, draws * (int(echo.max()) + 1))
    return uniform[np.arange(len(scan))[:, None], draws * echo[:, None] + np.arange(draws)]


def whole(value: FloatArray, uniform: FloatArray) -> FloatArray:
    """Whole numbers whose mean is `value`: rounded up as often as its fraction says. Whole ones stay as they are."""
    return np.floor(value + uniform)
