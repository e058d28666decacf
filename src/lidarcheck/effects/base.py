"""What an effect is, and how the catalogue finds it.

An effect is a frozen dataclass in a file of its own here, whose class derives from the stage it belongs to. Its fields
are its parameters, declared with `parameter(...)`; its docstring gives the formula, the source and the valid range.
Being here is all it takes: the model, the commands and the documentation know effects through `catalogue()` alone.

The light's way has four stages: `aim` (what a beam meets), `light` (pulses and background), `detector` (the SPADs'
numbers) and `readout` (echoes). An effect takes its stage's table and returns a new one; at zero strength it returns
the same one.
"""

from __future__ import annotations

import abc
import dataclasses
import difflib
import functools
import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Material, Sensor

__all__ = [
    "STAGES",
    "AimEffect",
    "Curve",
    "DetectorEffect",
    "Effect",
    "FileParameter",
    "LightEffect",
    "Parameter",
    "ReadoutEffect",
    "Surroundings",
    "catalogue",
    "check_order",
    "file_parameter",
    "find",
    "make",
    "parameter",
]

STAGES = ("aim", "light", "detector", "readout")
_E = TypeVar("_E", bound="Effect")


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

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"unit": self.unit, "low": self.low, "high": self.high, "typical": self.typical, "meaning": self.meaning}


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
class Curve:
    """What a file parameter holds: `y` over `x`, shapes (n,), x not decreasing, and the file that it was read from."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    file: str


def file_parameter(kind: str, *, meaning: str) -> Any:
    """Declare a parameter that names a file, as a dataclass field of type `Curve | None`; None when left out."""
    return dataclasses.field(default=None, metadata={"kind": kind, "meaning": meaning})


def parameter(unit: str, *, low: float, high: float, typical: float, meaning: str, whole: bool = False) -> Any:
    """Declare a parameter as a dataclass field; it takes its typical value when a model leaves it out."""
    facts = {"unit": unit, "low": low, "high": high, "whole": whole, "meaning": meaning}
    return dataclasses.field(default=int(typical) if whole else typical, metadata=facts)


@dataclass(frozen=True)
class Effect(abc.ABC):
    """A configured effect. Derive from one of the stage classes below, not from this one."""

    name: ClassVar[str]
    stage: ClassVar[str]
    tree: ClassVar[tuple[int, ...]] = ()
    """Its nodes in the perception-sensor effect tree PerCollECT/LidarLimbs; empty where the tree has none for it."""

    def __post_init__(self) -> None:
        for p in self.parameters():
            value = getattr(self, p.name)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not p.low <= value <= p.high or (p.whole and value != int(value)):
                kind = "a whole number" if p.whole else "a number"
                wrong = "out of range" if number else "no number"
                raise UsageError(
                    f"{self.name}: {p.name} = {value!r} is {wrong}",
                    fix=f"use {kind} from {p.low:g} to {p.high:g} {p.unit}".rstrip(),
                )

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The declared parameters, in the order of the class."""
        return tuple(
            Parameter(name=f.name, typical=f.default, **f.metadata)  # type: ignore[arg-type]
            for f in dataclasses.fields(cls)
            if "kind" not in f.metadata
        )

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

    def settings(self) -> dict[str, float | str]:
        """The parameters' values by name; of a file parameter the file, absent where none is set."""
        values: dict[str, float | str] = {p.name: getattr(self, p.name) for p in self.parameters()}
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

    @abc.abstractmethod
    def light(self, light: Light, around: Surroundings) -> Light:
        """The light with the effect."""


class DetectorEffect(Effect):
    """An effect on the SPADs' numbers."""

    stage = "detector"

    @abc.abstractmethod
    def detector(self, sensor: Sensor) -> Sensor:
        """The sensor with the effect; `UsageError` where that is no sensor. It knows the sensor alone."""


class ReadoutEffect(Effect):
    """An effect on the echoes."""

    stage = "readout"

    @abc.abstractmethod
    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """The echoes with the effect."""


@functools.cache
def catalogue() -> Mapping[str, type[Effect]]:
    """All effects by name, in the order of the light's way and then of their names."""
    package = importlib.import_module("lidarcheck.effects")
    found: dict[str, type[Effect]] = {}
    for module in pkgutil.iter_modules(package.__path__):
        for value in vars(importlib.import_module(f"{package.__name__}.{module.name}")).values():
            if isinstance(value, type) and issubclass(value, Effect) and "name" in vars(value):
                found[value.name] = value
    return dict(sorted(found.items(), key=lambda item: (STAGES.index(item[1].stage), item[0])))


def find(name: str) -> type[Effect]:
    """The effect of that name; `UsageError` with the nearest one otherwise."""
    effects = catalogue()
    if name not in effects:
        raise UsageError(f"there is no effect {name!r}", fix=_did_you_mean(name, effects))
    return effects[name]


def make(name: str, parameters: Mapping[str, Any], read: Callable[[FileParameter, str], Curve] | None = None) -> Effect:
    """A configured effect; `UsageError` for an unknown name or parameter, or a value out of its range.

    `read` turns the path that a file parameter has in a model file into its curve.
    """
    effect = find(name)
    files = {f.name: f for f in effect.files()}
    known = [p.name for p in effect.parameters()] + list(files)
    values = dict(parameters)
    for key, value in parameters.items():
        if key not in known:
            raise UsageError(f"{name} has no parameter {key!r}", fix=_did_you_mean(key, known))
        if key in files and isinstance(value, str) and read is not None:
            values[key] = read(files[key], value)
        elif key in files and not isinstance(value, Curve | None):
            raise UsageError(
                f"{name}: {key} = {value!r} is no file", fix="give its path from the model file's directory"
            )
    return effect(**values)


def check_order(effects: Sequence[Effect]) -> None:
    """Refuse effects that do not stand in the order of the light's way."""
    for before, after in itertools.pairwise(effects):
        if STAGES.index(before.stage) > STAGES.index(after.stage):
            raise UsageError(
                f"{after.name} (stage {after.stage}) stands behind {before.name} (stage {before.stage})",
                fix=f"put {after.name} before it: the light's way is {', '.join(STAGES)}",
            )


def _did_you_mean(name: str, known: Sequence[str] | Mapping[str, Any]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known: {', '.join(known) or 'none'}"
