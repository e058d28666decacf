"""What a `SearchSpec` may hold besides numbers: usual errors, stand-ins, and what follows the fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search.evidence import Evidence, Observations, Replays

if TYPE_CHECKING:
    from lidarcheck.effects.search.base import Probe

__all__ = ["BeamByBeam", "Imitation", "ListReader", "Refined", "TakeOver", "UsualError"]


@dataclass(frozen=True)
class UsualError:
    """An effect that is also a nuisance: so large, as a standard deviation, it is there without being worth a name.

    `parameters`: those that say it; `log`: of factors, whose logarithm is meant.
    """

    size: float
    parameters: tuple[str, ...]
    log: bool = False


@dataclass(frozen=True)
class Imitation:
    """Another effect that does nearly the same where little is in view, and a start of it that does the same as this
    one with some settings; None where the frames allow none."""

    name: str
    start: Callable[[Evidence, Mapping[str, Any]], Probe | None]


@dataclass(frozen=True)
class TakeOver:
    """What this effect can do of another one that is left out: `of` its name, `take` a start and a point that do both.

    `can`: whether a start of this effect can. `wholly`: the other one is no more than a factor on it.
    """

    of: str
    take: Callable[[Probe, FloatArray, Mapping[str, Any]], tuple[Probe, FloatArray]]
    can: Callable[[Probe], bool] = lambda _probe: True
    wholly: bool = False


@dataclass(frozen=True)
class ListReader:
    """A list of numbers that is read off what a fit leaves over; `read` gets simulations of the fit, and its point.

    `rounds`: steps by which the other numbers follow. `always`: also where the start has no such list yet.
    """

    parameter: str
    read: Callable[[Evidence, Sequence[Observations], Probe, FloatArray], tuple[float, ...]]
    rounds: int
    always: bool = True


@dataclass(frozen=True)
class Refined:
    """An effect with more of its form, with the 90 % intervals (value, low, high) of what is new in it, and factors by
    which the intervals of others become wider."""

    effect: Effect
    intervals: Mapping[str, tuple[float, float, float]]
    wider: Mapping[str, float]


@dataclass(frozen=True)
class BeamByBeam:
    """More of an effect's form, which means over frames do not show: read off the beams once all is fitted.

    `name`: of the step in the report. `words`: what was found, empty for the plain form.
    """

    name: str
    read: Callable[[Replays, Effect], Refined | None]
    words: Callable[[Effect], str]
