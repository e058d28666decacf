"""What a number of a sensor may be, and the constants of nature and of pulses that its numbers refer to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lidarcheck.errors import UsageError

__all__ = ["FWHM_PER_SIGMA", "LIGHT_SPEED_M_PER_NS", "Bounds", "check_numbers"]

LIGHT_SPEED_M_PER_NS = 0.299792458
FWHM_PER_SIGMA = 2.3548


class Bounds(NamedTuple):
    """The closed interval a number may lie in, whether it is a whole number, its unit, and a change to be noticed.

    `noticeable` follows the rules of effects' parameters (`effects.parameters`), at typical numbers of the detector.
    """

    low: float
    high: float
    whole: bool
    unit: str
    noticeable: float


def check_numbers(holder: Any, bounds: Mapping[str, Bounds]) -> None:
    """Hold a frozen object's numbers against their bounds, None aside, and make whole ones int and others float."""
    for name, bound in bounds.items():
        value = getattr(holder, name)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            raise UsageError(f"{name} = {value!r} is no number", fix=f"use a number of {bound.unit}")
        if not bound.low <= value <= bound.high or (bound.whole and value != int(value)):
            kind = "a whole number" if bound.whole else "a number"
            raise UsageError(
                f"{name} = {value} is out of range",
                fix=f"use {kind} from {bound.low:g} to {bound.high:g} {bound.unit}",
            )
        object.__setattr__(holder, name, int(value) if bound.whole else float(value))
