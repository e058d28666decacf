"""What an effect is: its declarations, and the four stages of the light's way.

An effect is a frozen dataclass in a file of its own here, whose class derives from the stage it belongs to. Its fields
are its parameters, declared with `parameter(...)`; its docstring gives the formula, the source and the valid range.
Being here is all it takes: see `finding`.

The light's way has four stages: `aim` (what a beam meets), `light` (pulses and background), `detector` (the SPADs'
numbers) and `readout` (echoes). An effect takes its stage's table and returns a new one; at zero strength it returns
the same one.
"""

from __future__ import annotations

import abc
import dataclasses
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.parameters import (
    ChoiceParameter,
    Curve,
    FileParameter,
    ListParameter,
    Parameter,
    choice_parameter,
    file_parameter,
    list_parameter,
    parameter,
)
from lidarcheck.errors import UsageError
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Linear, Material, PhotonHistogram, Program, Sensor, SpadArray

__all__ = [
    "DETECTORS",
    "STAGES",
    "AimEffect",
    "ChoiceParameter",
    "Curve",
    "DetectorEffect",
    "Effect",
    "FileParameter",
    "LightEffect",
    "ListParameter",
    "Parameter",
    "ReadoutEffect",
    "Surroundings",
    "beams_in",
    "choice_parameter",
    "file_parameter",
    "in_detector",
    "list_parameter",
    "parameter",
    "unfit_for",
]

STAGES = ("aim", "light", "detector", "readout")
DETECTORS = (SpadArray.detector, Linear.detector, PhotonHistogram.detector)
"""The kinds of detector that there are; what an effect takes around somebody else's program says `around_program`."""


class Surroundings(Protocol):
    """What an effect may know besides its table: the sensor, the ideal scan, and random numbers of its own."""

    @property
    def sensor(self) -> Sensor:
        """The sensor, after the detector effects that stand before this one."""

    @property
    def ideal(self) -> IdealScan:
        """What each beam meets, after the aim effects that stand before this one."""

    @property
    def materials(self) -> Mapping[int, Material]:
        """The model's table of materials."""

    @property
    def scene(self) -> Caster | None:
        """The scene that the ideal scan was cast from, where it is known."""

    @property
    def caster(self) -> Caster:
        """What tells what a ray meets: the scene, else the surfaces of the ideal scan before any aim effect."""

    def signal(self, ideal: IdealScan) -> npt.NDArray[np.float64]:
        """S of each row of an ideal scan as if it had the beam for itself, by the range equation; shape (n,)."""

    def uniforms(self, layer: npt.ArrayLike, point: npt.ArrayLike, draws: int = 1) -> npt.NDArray[np.float64]:
        """Uniform numbers in [0, 1), shape (n, draws): the same for a beam, whatever other effects there are."""


def unfit_for(**reasons: str) -> Mapping[str, str]:
    """Declare for which kinds of detector an effect means nothing, each with the reason, as `Effect.unfit`."""
    if unknown := sorted(reasons.keys() - set(DETECTORS)):
        raise ValueError(f"there is no detector {unknown[0]}")
    return MappingProxyType(reasons)


def beams_in(sensor: Sensor) -> dict[str, int]:
    """The largest value of a parameter that counts beams, by the words of `COUNTS`."""
    layers, points = sensor.beams.layers, sensor.beams.points
    lines = sensor.beams.size if sensor.detector == "photon_histogram" else layers
    return {"layer": layers - 1, "point": points - 1, "line": lines - 1, "layers": layers, "points": points}


@dataclass(frozen=True)
class Effect(abc.ABC):
    """A configured effect. Derive from one of the stage classes below, not from this one."""

    name: ClassVar[str]
    stage: ClassVar[str]
    role: ClassVar[str] = ""
    """By what a tool that is about one effect finds it, as "ghost" or "vertical blooming"; empty for most."""
    tree: ClassVar[tuple[int, ...]] = ()
    """Its nodes in the perception-sensor effect tree PerCollECT/LidarLimbs; empty where the tree has none for it."""
    empirical: ClassVar[bool] = False
    """Whether it only describes data that no effect explains; it is then not in the catalogue."""
    hash_word: ClassVar[str] = ""
    """What the hash of a model's parameters calls it; empty: its name, spelled as BeamGrid for beam_grid."""
    unfit: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """The kinds of detector for which it means nothing, and why; see `unfit_for`."""
    handed: ClassVar[tuple[str, ...]] = ()
    """The columns of an ideal scan by which somebody else's program learns of it."""
    inside: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Of an effect that acts inside such a program the parameters that a number of the program may stand for: "added"
    to that number, or "times" it. Not empty, or a detector effect: nothing else brings it in."""
    scatters: ClassVar[bool] = False
    """Whether it adds what the air sends back, of which such a program must know a material."""
    by_strength: ClassVar[bool] = False
    """Whether it goes by how strong an echo is."""

    def __post_init__(self) -> None:
        for words in self.choices():
            words.check(self.name, getattr(self, words.name))
        for numbers in self.lists():
            checked = numbers.checked(self.name, getattr(self, numbers.name))
            object.__setattr__(self, numbers.name, checked)  # an array or a list becomes a tuple
        for number in self.parameters():
            number.check(self.name, getattr(self, number.name))

    @classmethod
    def why_not(cls, sensor: Sensor) -> str:
        """Why the effect means nothing for this sensor; empty where it means something. Derive from `needs`."""
        around = cls._why_not_around(sensor) if isinstance(sensor, Program) else ""
        return around or cls.unfit.get(sensor.detector) or cls.needs(sensor.nominal)

    @classmethod
    def _why_not_around(cls, program: Program) -> str:
        """Why it cannot be put around somebody else's program, by what it is handed and what the program reads."""
        if cls.acts_inside():
            inside = "it acts inside the program, and no number of [external.parameters] stands for it"
            return "" if program.stands_for(cls.name) else inside
        if program.unlit and cls.stage == "light":
            return program.unlit
        unread = [column for column in cls.handed if not program.understands(column)]
        if unread:
            return f"the program does not read {unread[0]}"
        if cls.scatters and program.scatter_material is None:
            return "[external] names no scatter_material for what the air sends back"
        weak = cls.by_strength and not program.strength_told
        return "the program reports no feature that says how strong an echo is" if weak else ""

    @classmethod
    def around_program(cls) -> str:
        """What it takes around somebody else's program, in words; empty where it takes nothing."""
        if cls.acts_inside():
            named = f", for {' or '.join(cls.inside)}" if cls.inside else ""
            return f"it acts inside: a number of [external.parameters] must stand for it{named}"
        needs = [f"the program must read {' and '.join(cls.handed)}"] if cls.handed else []
        needs += ["[external] must name a scatter_material"] if cls.scatters else []
        needs += ["the program must report how strong an echo is"] if cls.by_strength else []
        return "; ".join(needs)

    @classmethod
    def acts_inside(cls) -> bool:
        """Whether it changes what a detector does, and not what goes in or comes out."""
        return bool(cls.inside) or issubclass(cls, DetectorEffect)

    @classmethod
    def detectors(cls) -> tuple[str, ...]:
        """The kinds of detector for which it means something, or may: `needs` says what else it takes."""
        return tuple(kind for kind in DETECTORS if kind not in cls.unfit)

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """What the effect needs and a sensor with one of its detectors lacks; empty where it lacks nothing."""
        return ""

    def check(self, sensor: Sensor) -> None:
        """Refuse a sensor for which it means nothing, and parameters beyond the sensor's beams."""
        reason = self.why_not(sensor)
        if reason:
            what = f"{self.name} means nothing for {sensor.name}: {reason}"
            raise UsageError(what, fix=f"take {self.name} out of the model")
        numbers = beams_in(sensor)
        for one in self.parameters():
            value, most = getattr(self, one.name), one.most(numbers)
            if value > most:
                what = f"{self.name}: {one.name} = {value:g} lies beyond the beams of {sensor.name}"
                raise UsageError(what, fix=f"use {one.low:g} to {most:g}")

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The declared parameters that are a number, in the order of the class."""
        return tuple(
            Parameter(name=f.name, typical=f.default, **f.metadata)  # type: ignore[arg-type]
            for f in dataclasses.fields(cls)
            if "whole" in f.metadata
        )

    @classmethod
    def lists(cls) -> tuple[ListParameter, ...]:
        """The declared parameters that are lists of numbers."""
        return tuple(ListParameter(f.name, **f.metadata) for f in dataclasses.fields(cls) if "ascending" in f.metadata)

    @classmethod
    def choices(cls) -> tuple[ChoiceParameter, ...]:
        """The declared parameters that are one of some words."""
        return tuple(ChoiceParameter(f.name, **f.metadata) for f in dataclasses.fields(cls) if "choices" in f.metadata)

    @classmethod
    def example(cls) -> dict[str, Any]:
        """What shows it beside its typical values: the example of every list and choice that has one."""
        shown: dict[str, Any] = {p.name: p.example for p in cls.choices() if p.example}
        shown |= {p.name: p.example for p in cls.lists() if p.example}
        return {f.name: shown[f.name] for f in dataclasses.fields(cls) if f.name in shown}

    @classmethod
    def files(cls) -> tuple[FileParameter, ...]:
        """The declared parameters that name files."""
        return tuple(FileParameter(f.name, **f.metadata) for f in dataclasses.fields(cls) if "kind" in f.metadata)

    @classmethod
    def summary(cls) -> str:
        """The first line of the docstring."""
        return (inspect.getdoc(cls) or "").splitlines()[0]

    def curves(self) -> tuple[Curve, ...]:
        """What was read from the files that its parameters name."""
        return tuple(curve for f in self.files() if (curve := getattr(self, f.name)) is not None)

    def settings(self) -> dict[str, Any]:
        """The parameters' values by name; of a file parameter the file. Absent where no file, list or word is set."""
        values: dict[str, Any] = {p.name: getattr(self, p.name) for p in self.parameters()}
        declared = [*(p.name for p in self.choices()), *(p.name for p in self.lists())]
        names = [f.name for f in dataclasses.fields(self) if f.name in declared]  # in the order of the class
        values |= {name: value for name in names if (value := getattr(self, name))}
        curves = {f.name: getattr(self, f.name) for f in self.files()}
        return values | {name: curve.file for name, curve in curves.items() if curve is not None}


class AimEffect(Effect):
    """An effect on what the beams meet."""

    stage = "aim"

    @abc.abstractmethod
    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """The ideal scan with the effect."""


class LightEffect(Effect):
    """An effect on the pulses and the background that reach the beams."""

    stage = "light"
    handed = ("Share",)

    @abc.abstractmethod
    def light(self, light: Light, around: Surroundings) -> Light:
        """The light with the effect."""


class DetectorEffect(Effect):
    """An effect on the SPADs' numbers."""

    stage = "detector"

    @abc.abstractmethod
    def detector(self, sensor: Sensor) -> Sensor:
        """The sensor with the effect; `UsageError` where that is no sensor. It knows the sensor alone. A program is
        none that it is asked about: `in_detector` turns the program's numbers."""


class ReadoutEffect(Effect):
    """An effect on the echoes."""

    stage = "readout"
    moves_echoes: ClassVar[bool] = True
    """Whether it moves echoes by what each of them is, or adds some: a program's ranges are then rounded anew."""

    @abc.abstractmethod
    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """The echoes with the effect."""

    def before(self, light: Light, sensor: Sensor) -> tuple[Light, Sensor]:
        """Light and sensor with what it does before echoes are found, of a detector that shows more than echoes."""
        return light, sensor


def in_detector(effect: Effect, sensor: Sensor) -> Sensor:
    """The sensor with what an effect does to its detector; the same one for effects that do nothing there."""
    if isinstance(sensor, Program):
        inside = effect.acts_inside()
        return sensor.turned(effect.name, effect.settings(), effect.inside) if inside else sensor
    return effect.detector(sensor) if isinstance(effect, DetectorEffect) else sensor
