"""The step that a file's coordinates are rounded to, as its values show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["coordinate_steps", "direction_error_m"]

_STEPS = tuple(m * 10.0**k for k in range(0, -7, -1) for m in (5.0, 2.5, 2.0, 1.0))
"""What formats round to: decimals of a text, scales of LAS; the coarsest first."""
_LOOKED_AT = 4000
"""Values of a coordinate that tell its step."""
_FEWEST_VALUES = 20
"""Of fewer different values a coordinate, as of a wall at exactly 20 m, shows no step of its own."""
_ON_STEP = 0.99
"""Share of the values that must be multiples of a step."""
_NEAR = 0.01
"""A multiple of a step, as a part of it."""
_FLOAT32 = 2.0**-23
"""Spacing of the numbers of a float32 beside their size: how far a decimal lies from what is stored."""
_MOST_BLUR = 0.1
"""Where storing blurs a value by more than this part of a step, the step cannot be seen."""


def coordinate_steps(columns: Sequence[FloatArray]) -> tuple[float, ...]:
    """The rounding step of each column, in the column's unit: 0 where the values lie on none.

    A column of few different values takes the finest step of the others.
    """
    steps = [_step(column) for column in columns]
    known = [step for step in steps if step is not None]
    return tuple((min(known) if known else 0.0) if step is None else step for step in steps)


def direction_error_m(steps: Sequence[float]) -> float:
    """How far rounding to those steps can move a point: half the diagonal of the steps' box."""
    return 0.5 * float(np.sqrt(np.sum(np.square(steps))))


def _step(column: FloatArray) -> float | None:
    values = np.abs(column[:: max(1, len(column) // _LOOKED_AT)])
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(np.unique(values)) < _FEWEST_VALUES:
        return None
    for step in _STEPS:
        blur = values * (_FLOAT32 / step)
        if float(np.median(blur)) > _MOST_BLUR:
            return 0.0
        times = np.maximum(np.rint(values / step), 1.0)
        if np.count_nonzero(np.abs(values / step - times) <= _NEAR + blur) >= _ON_STEP * len(values):
            return step
    return 0.0
