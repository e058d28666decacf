"""A parameter of a calibration: before the fit, with its bounds and scale, and as fitted, with its interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["FitParameter", "Fitted"]

_SMALLEST = 1e-12


@dataclass(frozen=True)
class FitParameter:
    """A parameter to be fitted: its name, unit, allowed interval and where the fit begins.

    `logarithmic`: whether it is fitted by its logarithm, as what only scales is; else in steps of `step` in its own
    unit. `whole`: whether it is a whole number.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    whole: bool
    logarithmic: bool
    step: float

    def to_x(self, value: float) -> float:
        """The value on the scale of the fit."""
        return float(np.log(max(value, _SMALLEST)) if self.logarithmic else value / self.step)

    def to_value(self, x: float) -> float:
        """The value at a point of that scale, kept within the bounds, and whole where it has to be."""
        if x <= self.ends[0]:
            return self.low
        value = float(np.exp(np.clip(x, -60.0, 60.0)) if self.logarithmic else x * self.step)
        value = min(max(value, self.low), self.high)
        return float(round(value)) if self.whole else value

    @property
    def ends(self) -> tuple[float, float]:
        """The bounds on the scale of the fit."""
        return self.to_x(self.low), self.to_x(self.high)


@dataclass(frozen=True)
class Fitted:
    """A parameter as fitted.

    `low`, `high`: its 90 % interval, the whole of its bounds where the data leave it open. `status`: "fitted", "no
    effect" or "not identified".
    """

    name: str
    unit: str
    start: float
    value: float
    low: float
    high: float
    status: str = "fitted"
