"""Columns that do not repeat: each is turned about Z onto where its number says, by the median of its rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.geometry.lattice import Beams

__all__ = ["on_columns"]

_STEADY = 0.02
"""Columns step in the file's sense within this part of their step."""
_LAGS = 10
"""Steps are taken over this part of all columns: real ones wander from one to the next."""
_ROUNDS = 2


def on_columns(position: FloatArray, point: npt.NDArray[Any], beams: Beams, column_deg: float) -> FloatArray:
    """Points, shape (n, 3), as their beams would see them from where they start, were each column where it should be.

    `column_deg`: what a column should be farther than the one before. Where the columns do not step so, the points lie
    behind their beams: no turn of a column would say anything then.
    """
    names, place = np.unique(point, return_inverse=True)
    turned, relative, total = position, position, np.zeros(len(names))
    for _ in range(1 if beams.origin_m is None else _ROUNDS):
        relative = turned if beams.origin_m is None else turned - beams.origin_m
        off = np.rad2deg(np.angle(_level(relative) * np.conj(_level(beams.direction))))
        total = total + _medians(off, place, len(names))
        turned = _about_z(position, -total[place])
    if not _steps(total, names, column_deg):
        return np.asarray(-np.linalg.norm(position, axis=1)[:, None] * beams.direction)
    return turned if beams.origin_m is None else turned - beams.origin_m


def _steps(off: FloatArray, names: npt.NDArray[Any], column_deg: float) -> bool:
    lag = max(1, len(names) // _LAGS)
    if len(names) <= lag:
        return True
    change = (off[lag:] - off[:-lag] + 180.0) % 360.0 - 180.0
    return bool(np.median(np.abs(change / ((names[lag:] - names[:-lag]) * column_deg))) <= _STEADY)


def _medians(off: FloatArray, place: npt.NDArray[Any], columns: int) -> FloatArray:
    """The median of each column's rows [deg]; about the whole frame's middle, which may lie anywhere."""
    middle = float(np.rad2deg(np.angle(np.mean(np.exp(1j * np.deg2rad(off))))))
    beside = (off - middle + 180.0) % 360.0 - 180.0
    order = np.lexsort((beside, place))
    counts = np.bincount(place, minlength=columns)
    start = np.r_[0, np.cumsum(counts)[:-1]]
    ordered = beside[order]
    return np.asarray(middle + 0.5 * (ordered[start + (counts - 1) // 2] + ordered[start + counts // 2]))


def _level(vector: FloatArray) -> npt.NDArray[np.complex128]:
    return np.asarray(vector[:, 0] + 1j * vector[:, 1])


def _about_z(position: FloatArray, degrees: FloatArray) -> FloatArray:
    turned = _level(position) * np.exp(1j * np.deg2rad(degrees))
    return np.stack([turned.real, turned.imag, position[:, 2]], axis=-1)
