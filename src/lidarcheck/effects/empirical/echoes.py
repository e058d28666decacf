"""What empirical terms of the readout do to echoes: draws of their own, whole numbers, and numbering them anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Surroundings
from lidarcheck.effects.empirical.covariates import keys_of
from lidarcheck.scan import Scan

__all__ = ["draws_of", "renumbered", "whole"]


def draws_of(scan: Scan, around: Surroundings, draws: int = 1) -> FloatArray:
    """Uniform numbers of each echo's own, shape (n, draws); the same for a beam's first echo however many it has."""
    if len(scan) == 0:
        return np.empty((0, draws))
    echo = np.maximum(scan.echo_number.astype(np.int64) - 1, 0)
    uniform = around.uniforms(scan.layer, scan.point, draws * (int(echo.max()) + 1))
    return uniform[np.arange(len(scan))[:, None], draws * echo[:, None] + np.arange(draws)]


def whole(value: FloatArray, uniform: FloatArray) -> FloatArray:
    """Whole numbers whose mean is `value`: rounded up as often as its fraction says. Whole ones stay as they are."""
    return np.floor(value + uniform)


def renumbered(scan: Scan) -> Scan:
    """The same rows, the echoes of each beam numbered from 1 in the order of range; of equal range as before."""
    key = keys_of(scan)
    order = np.lexsort((scan.echo_number, scan.range_m, key))
    place = np.arange(len(scan))
    starts = np.append(True, key[order][1:] != key[order][:-1])[: len(scan)]
    number = np.empty(len(scan), dtype=np.int32)
    number[order] = place - np.maximum.accumulate(np.where(starts, place, 0)) + 1 if len(scan) else number
    return replace(scan, echo_number=number)
