"""A number with all that it takes to say whether another one is better, and that judgement."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.inference.intervals import ENDS

__all__ = ["LEAST", "UNSEEN", "Kind", "Number", "Residual", "Step", "in_words", "judged"]

Kind = Literal["misfit", "gap"]

LEAST = 0.005
"""A difference that is smaller is none that anybody should act on [sd]."""
UNSEEN = "no beam sees this row"
SMALL = f"same, < {LEAST:g}"


@dataclass(frozen=True)
class Residual:
    """How far measured means lie above simulated ones in each cell, in standard deviations of one beam.

    `offset` (cells,) of the cells from their target; `off`: by what is compared, (cells,), NaN where one side has no
    echo; `chance`: the standard deviation of that by the number of beams alone, (cells,).
    """

    offset: FloatArray
    off: Mapping[str, FloatArray]
    chance: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Number:
    """How far a measurement and a model are apart, in standard deviations of one beam.

    `floor`: what a model that is right leaves. `parts`: the same by feature, as the sensor lists them. `sample`: what
    was simulated, in words, `7 200 beams x 8`. `left_out` (blocks,): the value without each block of columns, all that
    it takes to judge any two numbers of one `scale`; `blocks`: what these are, in words. `scale`: a hash of what was
    measured, of the sample and of the spreads that the value counts in. `simulated`: a hash of the light of all beams
    and of what sees it: numbers that agree in it are the same. `noise`: what was taken off a gap as the model's own:
    `explain` prints the sum of both. `exact`: simulated, not expected. `about`: what is said beside it. `residual`: of
    a misfit, what it is made of.
    """

    kind: Kind
    value: float
    floor: float
    parts: Mapping[str, float]
    sample: str
    left_out: FloatArray = field(repr=False)
    blocks: str
    scale: str
    simulated: str
    noise: float = 0.0
    exact: bool = True
    seconds: float = field(default=0.0, compare=False)
    about: str = ""
    residual: Residual | None = field(default=None, compare=False, repr=False)

    @property
    def key(self) -> str:
        """A hash of all that it was computed from, the same wherever that is done."""
        return hashlib.sha256(repr((self.kind, self.scale, self.simulated, self.sample)).encode()).hexdigest()

    @property
    def interval(self) -> tuple[float, float]:
        """The ends of its 90 % interval, by what other columns and other measurements would give."""
        half = _half_width(self.left_out)
        return max(self.value - half, 0.0), self.value + half

    def to_dict(self) -> dict[str, Any]:
        """As the JSON of `lidarcheck gap` has it; what nobody knows is null."""
        names = ("kind", "value", "floor", "noise", "sample", "blocks", "scale", "simulated", "key", "about")
        ends = {name: _known(end) for name, end in zip(("low", "high"), self.interval, strict=True)}
        own = {name: getattr(self, name) for name in names}
        return {**own, "floor": _known(self.floor), **ends, "unit": "sd of one beam", "parts": dict(self.parts)}


@dataclass(frozen=True)
class Step:
    """By how much a number has changed, with its 90 % interval, and what that is called."""

    difference: float
    low: float
    high: float
    word: str

    @property
    def is_said(self) -> bool:
        """Whether it is better or worse beyond chance."""
        return self.word in ("better", "worse")

    def to_dict(self) -> dict[str, float | str | None]:
        """As the JSON of `lidarcheck gap` has it; ends that nobody knows are null."""
        return {
            "difference": self.difference, "low": _known(self.low), "high": _known(self.high), "word": self.word,
        }  # fmt: skip


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def judged(before: Number, after: Number) -> Step:
    """Whether the second number is better, by the jackknife over blocks of columns, with the same seeds on both sides.

    `UsageError` for two numbers that count in different spreads, or are of two kinds.
    """
    if (before.kind, before.scale) != (after.kind, after.scale):
        what = "the two numbers are of different measurements, samples or spreads"
        raise UsageError(what, fix="compute both with the same request but for what was edited")
    if before.simulated == after.simulated:
        return Step(0.0, 0.0, 0.0, UNSEEN)
    difference = after.value - before.value
    half = _half_width(after.left_out - before.left_out)
    low, high = difference - half, difference + half
    if abs(difference) < LEAST:
        return Step(difference, low, high, SMALL)
    return Step(difference, low, high, "better" if high < 0.0 else "worse" if low > 0.0 else "same")


def _half_width(without: FloatArray) -> float:
    """Half of the 90 % interval of a difference, by what it is without each block (blocks,); infinite for one block.

    Delete-one jackknife, Student's t with a degree of freedom less than there are blocks.
    """
    from scipy.special import stdtrit

    n = len(without)
    if n < 2:
        return float("inf")
    error = np.sqrt((n - 1.0) / n * np.sum((without - without.mean()) ** 2))
    return float(stdtrit(n - 1, ENDS[1]) * error)


def in_words(steps: Mapping[str, Step]) -> str:
    """What an edit does to several measurements, by their names: `better at 69 m, worse at 157 m`.

    What is the same everywhere, or better, or worse, is said once.
    """
    words: dict[str, list[str]] = {}
    for name, step in steps.items():
        words.setdefault(step.word, []).append(name)
    said = sorted(words, key=lambda word: {"better": 0, "worse": 1}.get(word, 2))
    if len(said) == 1:
        return said[0]
    return ", ".join(f"{word} at {' and '.join(words[word])}" for word in said)
