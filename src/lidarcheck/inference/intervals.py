"""A value with its interval, and the gap before and after, each with its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import NormalDist

__all__ = ["ENDS", "HALF_WIDTH", "LEVEL", "ClassifierGap", "Gap", "Interval"]

LEVEL = 0.90
"""An interval holds the true value nine times out of ten."""
ENDS = (0.05, 0.95)
"""The quantiles where it ends."""
HALF_WIDTH = NormalDist().inv_cdf(ENDS[1])
"""Half of such an interval, in standard errors of what is normally distributed: 1.645."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with its 90 % interval; `unit` as the effect's parameter has it."""

    value: float
    low: float
    high: float
    unit: str = ""

    def to_dict(self) -> dict[str, float]:
        """As report.json has it."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True, slots=True)
class ClassifierGap:
    """The second number of a gap: 2 AUC - 1 of a classifier that is asked which echoes are measured, before and after,
    and what chance makes of it; None where the frames have too few blocks of beams."""

    before: float | None = None
    after: float | None = None
    floor: float | None = None

    @property
    def tells(self) -> bool:
        """Whether, after, it still tells measured from simulated echoes."""
        return self.after is not None and self.floor is not None and self.after > self.floor

    def to_dict(self) -> dict[str, float | None]:
        """As report.json has it."""
        return {"before": self.before, "after": self.after, "floor": self.floor}


@dataclass(frozen=True)
class Gap:
    """The distance of measured and simulated echoes on the frames that no fit has seen.

    `before`, `after`, `floor` (what a perfect model is expected to leave), each with its interval;
    the same by feature, and `waterfall`: the gap after each effect, in order of importance. All count as much chance as
    the floor. `closed_span`: the ends of the 90 % interval of `closed`, cut off at -1 and 1; all of that where
    the gap before may be chance. `classifier`: the second number, which shares nothing with the distance.
    `by_kind`: of the echoes on no surface of their beam, by feature and what light they are of, in standard deviations
    of an echo; None where measurement or model has none of that light.
    """

    before: Interval
    after: Interval
    floor: Interval
    by_feature: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    waterfall: tuple[tuple[str, Interval], ...] = ()
    closed_span: tuple[float, float] = (-1.0, 1.0)
    classifier: ClassifierGap = ClassifierGap()
    by_kind: Mapping[str, tuple[float | None, float | None, float | None]] = field(default_factory=dict)

    @property
    def closed(self) -> float:
        """Share of the gap above the floor that is closed."""
        excess = self.before.value - self.floor.value
        # Below the floor there is nothing to close, and what falls below it is chance.
        return min((self.before.value - self.after.value) / excess, 1.0) if excess > 0.0 else 0.0
