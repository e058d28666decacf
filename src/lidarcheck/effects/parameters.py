"""How an effect declares its parameters: numbers, lists of numbers, words, and files; and what may stand in them.

`noticeable` is the change of a parameter that its user would notice, in the parameter's unit; where its sign is minus,
downward is tried first. It follows from the kind of quantity:

| quantity | noticeable | since |
|---|---|---|
| factor on the signal | 10 % | a field panel's reflectance and a laser's power over temperature are each good to 5 % |
| rate, stray light, rare event | 25 %, 1 dB | dark counts change by as much over 3 °C; scattered light is read in dB |
| width, length, decay time | 20 % | what fits of a profile or of a decay repeat to |
| duration of the laser's pulse | 5 % | an oscilloscope's |
| pointing angle | 0.05 deg | the spacing of two layers |
| edge of a patch of dirt | 0.5 deg | ten layers, four points |
| range, walk | 1 cm, at far range 5 cm in 100 m | the resolution of the reported range |
| instant in the trace | 1 ns, scatter 0.5 ns | one bin, half a bin |
| power, exponent | 0.25; a tenth where publications agree better | two curves that differ by it cross on a log plot |
| share of 0 ... 1 | 0.2 | what decides between two mechanisms |
| direction of sun, phase | 15, 30 deg | an hour of the sun; a twelfth of a period |
| speed | 1 m/s, 5 deg/s | a step of wheel speed and yaw rate over a frame |
| number of things, switch, name | 1, the other | there is nothing between |
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.errors import UsageError

__all__ = [
    "COUNTS",
    "MOST_BEAMS",
    "ChoiceParameter",
    "Curve",
    "FileParameter",
    "ListParameter",
    "Parameter",
    "choice_parameter",
    "file_parameter",
    "list_parameter",
    "parameter",
]

MOST_BEAMS = 1_000_000
"""No sensor has so many layers, points or zones."""
COUNTS = ("layer", "point", "line", "layers", "points")
"""What a parameter may count of a sensor's beams: the number of a layer, of a point, or of what has a gain of its own
(a layer, or a zone), from 0; how many layers, points."""
_LAST = {"layer": "the last", "point": "the last", "line": "the last"}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect: its unit, the closed interval it may lie in, a typical value, a noticeable change.

    `counts`: what of the sensor's beams it counts, see `parameter`; the interval is that of any sensor then.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    whole: bool
    meaning: str
    option: bool = False
    noticeable: float = 0.0
    counts: str = ""

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        facts = {"unit": self.unit, "low": self.low, "high": self.high, "typical": self.typical}
        return {**facts, "noticeable": self.noticeable, "meaning": self.meaning}

    def nearby(self, value: float) -> tuple[float, ...]:
        """The values a noticeable change away from `value` and in range, the one to prefer first.

        `noticeable` is at the typical value: what has no sign changes in proportion to `value`, all else by as much.
        """
        has_no_sign = self.low >= 0.0 < self.typical and not self.whole
        step = self.noticeable * (value / self.typical if has_no_sign and value > 0.0 else 1.0)
        found = (value + step, value - step)
        return tuple(int(one) if self.whole else one for one in found if self.low <= one <= self.high)

    def check(self, effect: str, value: Any) -> None:
        """Refuse what is no number, out of range, or not whole where it must be."""
        number = _is_number(value)
        if not number or not self.low <= value <= self.high or (self.whole and value != int(value)):
            kind = "a whole number" if self.whole else "a number"
            wrong = "out of range" if number else "no number"
            raise UsageError(
                f"{effect}: {self.name} = {value!r} is {wrong}",
                fix=f"use {kind} from {self.low:g} to {self.highest} {self.unit}".rstrip(),
            )

    @property
    def highest(self) -> str:
        """The end of its interval; of what counts the sensor's beams, in words."""
        return _LAST.get(self.counts) or f"{self.high:g}"

    def most(self, numbers: Mapping[str, int]) -> float:
        """The largest value with a sensor that has so many of what it counts, by the words of `COUNTS`."""
        return min(self.high, numbers[self.counts]) if self.counts else self.high


@dataclass(frozen=True, slots=True)
class FileParameter:
    """A parameter that names a file; `kind` says what is read from it, as "lut.vertical".

    `noticeable`: the part by which all of the curve grows in a noticeable change.
    """

    name: str
    kind: str
    meaning: str
    noticeable: float = 0.25

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"kind": self.kind, "noticeable": self.noticeable, "meaning": self.meaning}

    def nearby(self, value: Curve | None) -> tuple[Curve, ...]:
        """The curve scaled by a noticeable factor; none where there is no file."""
        if value is None:
            return ()
        scaled = tuple((1.0 + self.noticeable) * y for y in value.y)
        return (dataclasses.replace(value, y=scaled),)


@dataclass(frozen=True, slots=True)
class ListParameter:
    """A parameter that is a list of numbers of a closed interval, each above the one before where `ascending`, and all
    of them whole where `counted`.

    `example`: what documentation and demonstrations show; a model that leaves it out has an empty list.
    """

    name: str
    unit: str
    low: float
    high: float
    ascending: bool
    example: tuple[float, ...]
    meaning: str
    counted: bool = False
    noticeable: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        facts = {"unit": self.unit, "low": self.low, "high": self.high, "ascending": self.ascending}
        return {**facts, "example": list(self.example), "noticeable": self.noticeable, "meaning": self.meaning}

    def nearby(self, value: Sequence[float]) -> tuple[tuple[float, ...], ...]:
        """The lists a noticeable change away from `value`: every other number moves, where they ascend all of them.

        None for an empty list, which a model has not given.
        """
        apart = 1 if self.ascending else 2
        found = (
            tuple(one + sign * self.noticeable * (at % apart == 0) for at, one in enumerate(value)) for sign in (1, -1)
        )
        return tuple(one for one in found if one and all(self.low <= entry <= self.high for entry in one))

    def checked(self, effect: str, value: object) -> tuple[float, ...]:
        """The numbers of a list, a tuple or an array; `UsageError` for anything else."""
        kind = "whole numbers" if self.counted else "numbers"
        fix = f"use a list of {kind} from {self.low:g} to {self.high:g} {self.unit}".rstrip()
        if not isinstance(value, list | tuple | np.ndarray):
            raise UsageError(f"{effect}: {self.name} = {value!r} is no list", fix=fix)
        for index, entry in enumerate(value):
            where = f"{effect}: {self.name}[{index}] = {entry!r}"
            if not _is_number(entry):
                raise UsageError(f"{where} is no number", fix=fix)
            if not self.low <= entry <= self.high:
                raise UsageError(f"{where} is out of range", fix=fix)
            if self.counted and entry != int(entry):
                raise UsageError(f"{where} is not whole", fix=fix)
            if self.ascending and index and not entry > value[index - 1]:
                what = f"{where} is not above the one before, {value[index - 1]!r}"
                raise UsageError(what, fix="put them in ascending order, each once")
        return tuple(int(entry) if self.counted else float(entry) for entry in value)


@dataclass(frozen=True, slots=True)
class ChoiceParameter:
    """A parameter that is one of some words; None in a model that leaves it out. `example` as in `ListParameter`."""

    name: str
    choices: tuple[str, ...]
    example: str | None
    meaning: str
    option: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"choices": list(self.choices), "example": self.example, "meaning": self.meaning}

    def nearby(self, value: str | None) -> tuple[str, ...]:
        """Every other word; the first is what a model means that leaves it out."""
        return tuple(word for word in self.choices if word != (value or self.choices[0]))

    def check(self, effect: str, value: object) -> None:
        """Refuse what is neither a choice nor None."""
        if value is not None and value not in self.choices:
            near = difflib.get_close_matches(str(value), self.choices, n=1, cutoff=0.5)
            use = f"did you mean {near[0]}?" if near else f"use one of {', '.join(self.choices)}"
            raise UsageError(f"{effect}: {self.name} = {value!r} is not a valid choice", fix=use)


@dataclass(frozen=True, slots=True)
class Curve:
    """What a file parameter holds: `y` over `x`, shapes (n,), x not decreasing, and the file that it was read from."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    file: str


def file_parameter(kind: str, *, meaning: str, noticeable: float = 0.25) -> Any:
    """Declare a parameter that names a file, as a dataclass field of type `Curve | None`; None when left out."""
    return dataclasses.field(default=None, metadata={"kind": kind, "meaning": meaning, "noticeable": noticeable})


def parameter(
    unit: str,
    *,
    low: float,
    high: float,
    typical: float,
    meaning: str,
    noticeable: float | None = None,
    whole: bool = False,
    option: bool = False,
    counts: str = "",
) -> Any:
    """Declare a parameter as a dataclass field; it takes its typical value when a model leaves it out.

    `noticeable`: the change that a user would notice (see above); None: a tenth of the typical value, or of the range
    where that is 0. `option`: with the typical value the effect is what it was before there was the parameter, so that
    hashes of models that do not use it stay. `counts`: one of `COUNTS`, where the sensor's beams say how large it may
    be.
    """
    if counts not in ("", *COUNTS):
        raise ValueError(f"counts = {counts!r} is none of {', '.join(COUNTS)}")
    if noticeable is None:
        noticeable = 1.0 if whole else 0.1 * (abs(typical) or high - low)
    facts = {"unit": unit, "low": low, "high": high, "whole": whole, "meaning": meaning, "option": option}
    facts |= {"counts": counts} if counts else {}
    return dataclasses.field(default=int(typical) if whole else typical, metadata={**facts, "noticeable": noticeable})


def list_parameter(
    unit: str,
    *,
    low: float,
    high: float,
    meaning: str,
    example: Sequence[float] = (),
    ascending: bool = False,
    counted: bool = False,
    noticeable: float | None = None,
) -> Any:
    """Declare a parameter that is a list of numbers, as a field of type `tuple[float, ...]`, or `tuple[int, ...]` where
    they are `counted`; empty when left out. `noticeable`: of each number; None: 1 of what is counted, else 1 % of the
    range."""
    if noticeable is None:
        noticeable = 1.0 if counted else 0.01 * (high - low)
    facts = {"unit": unit, "low": low, "high": high, "ascending": ascending, "meaning": meaning, "counted": counted}
    return dataclasses.field(default=(), metadata={**facts, "noticeable": noticeable, "example": tuple(example)})


def choice_parameter(choices: Sequence[str], *, meaning: str, example: str | None = None, option: bool = False) -> Any:
    """Declare a parameter that is one of some words, as a field of type `str | None`; None when left out. `option`: as
    of `parameter`."""
    metadata = {"choices": tuple(choices), "example": example, "meaning": meaning, "option": option}
    return dataclasses.field(default=None, metadata=metadata)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
