"""How an effect declares its parameters: numbers, lists of numbers, words, and files; and what may stand in them."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.errors import UsageError

__all__ = [
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


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect: its unit, the closed interval it may lie in, and a typical value."""

    name: str
    unit: str
    low: float
    high: float
    typical: float
    whole: bool
    meaning: str
    option: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"unit": self.unit, "low": self.low, "high": self.high, "typical": self.typical, "meaning": self.meaning}

    def check(self, effect: str, value: Any) -> None:
        """Refuse what is no number, out of range, or not whole where it must be."""
        number = _is_number(value)
        if not number or not self.low <= value <= self.high or (self.whole and value != int(value)):
            kind = "a whole number" if self.whole else "a number"
            wrong = "out of range" if number else "no number"
            raise UsageError(
                f"{effect}: {self.name} = {value!r} is {wrong}",
                fix=f"use {kind} from {self.low:g} to {self.high:g} {self.unit}".rstrip(),
            )


@dataclass(frozen=True, slots=True)
class FileParameter:
    """A parameter that names a file; `kind` says what is read from it, as "lut.vertical"."""

    name: str
    kind: str
    meaning: str

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"kind": self.kind, "meaning": self.meaning}


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

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        facts = {"unit": self.unit, "low": self.low, "high": self.high, "ascending": self.ascending}
        return {**facts, "example": list(self.example), "meaning": self.meaning}

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


def file_parameter(kind: str, *, meaning: str) -> Any:
    """Declare a parameter that names a file, as a dataclass field of type `Curve | None`; None when left out."""
    return dataclasses.field(default=None, metadata={"kind": kind, "meaning": meaning})


def parameter(
    unit: str, *, low: float, high: float, typical: float, meaning: str, whole: bool = False, option: bool = False
) -> Any:
    """Declare a parameter as a dataclass field; it takes its typical value when a model leaves it out.

    `option`: with that value the effect is what it was before there was the parameter, so that hashes of models that
    do not use it stay.
    """
    facts = {"unit": unit, "low": low, "high": high, "whole": whole, "meaning": meaning, "option": option}
    return dataclasses.field(default=int(typical) if whole else typical, metadata=facts)


def list_parameter(
    unit: str,
    *,
    low: float,
    high: float,
    meaning: str,
    example: Sequence[float] = (),
    ascending: bool = False,
    counted: bool = False,
) -> Any:
    """Declare a parameter that is a list of numbers, as a field of type `tuple[float, ...]`, or `tuple[int, ...]` where
    they are `counted`; empty when left out."""
    facts = {"unit": unit, "low": low, "high": high, "ascending": ascending, "meaning": meaning, "counted": counted}
    return dataclasses.field(default=(), metadata={**facts, "example": tuple(example)})


def choice_parameter(choices: Sequence[str], *, meaning: str, example: str | None = None, option: bool = False) -> Any:
    """Declare a parameter that is one of some words, as a field of type `str | None`; None when left out. `option`: as
    of `parameter`."""
    metadata = {"choices": tuple(choices), "example": example, "meaning": meaning, "option": option}
    return dataclasses.field(default=None, metadata=metadata)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
