"""A sensor whose echoes somebody else's program finds: only what goes in and what comes out is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

from lidarcheck.errors import UsageError
from lidarcheck.sensor.material import Material
from lidarcheck.sensor.sensor import Sensor
from lidarcheck.sensor.spad_array import SpadArray

__all__ = ["Program", "StandIn"]


@dataclass(frozen=True, slots=True)
class StandIn:
    """A number of the program that stands for a parameter of an effect, so that the effect can act inside.

    With the effect the number is its value plus `scale` times the parameter, or times the parameter where the effect
    says so; within `low` ... `high`.
    """

    number: str
    effect: str
    parameter: str
    scale: float = 1.0
    low: float = -float("inf")
    high: float = float("inf")


@dataclass(frozen=True, kw_only=True)
class Program(Sensor):
    """Beams, features and gate of a sensor whose detector is a program; the detector's numbers are the program's own.

    `described`: the sensor that the model's `variant` names, whose S at 1 m says what a pulse is worth beside others.
    `background_per_ns` is 1, the program's own background. `settings`: the program's own numbers that may be turned, as
    they stand now; `stand_ins`: which effects they stand for. `scatter_material`: what the air is made of. `known`: the
    materials as the program is taken to have them, whatever a fit makes of the model's. `runs`: the program itself.

    `reads`: what the program understands of what it is handed, None while that is not known: everything may be. `tells`
    names the features that it reports, None while that is not known. `unlit`: why no effect of light can be shown by
    these ideal scans, empty where it can. What is found out about a program is no part of a model.
    """

    detector: ClassVar[str] = "external"

    described: Sensor = field(repr=False)
    settings: Mapping[str, float] = field(default_factory=dict)
    stand_ins: tuple[StandIn, ...] = ()
    scatter_material: int | None = None
    runs: Any = field(default=None, compare=False, repr=False)
    known: Mapping[int, Material] = field(default_factory=dict)
    reads: tuple[str, ...] | None = field(default=None, compare=False)
    tells: tuple[str, ...] | None = field(default=None, compare=False)
    unlit: str = field(default="", compare=False)

    __hash__ = Sensor.__hash__

    @classmethod
    def around(cls, sensor: Sensor, **own: Any) -> Program:
        """A program in the place of a sensor's detector; what counts as strong is AREA where the sensor counts it."""
        common = {f.name: getattr(sensor, f.name) for f in fields(Sensor)}
        counted = "AREA" if isinstance(sensor, SpadArray) else ""
        common |= {"background_per_ns": 1.0, "missing": (), "strength": sensor.strength or counted}
        return cls(**common, described=sensor, **own)

    @property
    def nominal(self) -> Sensor:
        """The sensor that the model names: its numbers are a guess of the program's."""
        return self.described

    @property
    def window_m(self) -> float:
        """Surfaces that the program keeps apart are told apart."""
        return self.separation_m

    @property
    def bright_signal(self) -> float:
        """As of the sensor that the model names."""
        return self.described.bright_signal

    @property
    def threshold_counts(self) -> float:
        """As of the sensor that the model names."""
        return self.described.threshold_counts

    def signal_of(self, counts: float) -> float:
        """As of the sensor that the model names."""
        return self.described.signal_of(counts)

    def overrides(self) -> dict[str, Any]:
        """What a model says of the sensor beside the program."""
        return self.described.overrides()

    def understands(self, word: str) -> bool:
        """Whether the program reads a column, as far as that is known; who reads shares reads how they divide."""
        return self.reads is None or word in self.reads or (word == "Parts" and "Share" in self.reads)

    @property
    def strength_told(self) -> str:
        """The feature that says how strong an echo is; empty where the program reports none."""
        return self.strength if self.tells is None or self.strength in self.tells else ""

    def stands_for(self, effect: str) -> bool:
        """Whether a number of the program stands for the effect."""
        return any(one.effect == effect for one in self.stand_ins)

    def turned(self, effect: str, values: Mapping[str, float], acts: Mapping[str, str]) -> Program:
        """The program with its numbers turned as an effect asks for.

        `values`: the effect's parameters; `acts`: those that change what it does, "added" to a number or "times" it.
        `UsageError` for one that no number stands for, and for a number that leaves its interval.
        """
        settings = dict(self.settings)
        for name, how in acts.items():
            idle = 1.0 if how == "times" else 0.0
            value = float(values.get(name, idle))
            stands = [one for one in self.stand_ins if (one.effect, one.parameter) == (effect, name)]
            if not stands and value != idle:
                what = f"{effect}: {name} = {value:g} acts inside the program, and none of its numbers stands for it"
                fix = f'set it to {idle:g}, or name a number with effect = "{effect}.{name}" in [external.parameters]'
                raise UsageError(what, fix=fix)
            for one in stands:
                number = settings[one.number]
                number = number * value if how == "times" else number + one.scale * value
                if not one.low <= number <= one.high:
                    what = f"{effect}: {name} = {value:g} makes {one.number} {number:g}"
                    fix = f"keep it from {one.low:g} to {one.high:g}, or widen that in [external.parameters]"
                    raise UsageError(what, fix=fix)
                settings[one.number] = number
        return self if settings == self.settings else replace(self, settings=settings)
