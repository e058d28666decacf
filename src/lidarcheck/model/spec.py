"""What a sensor model is: a sensor, its materials and effects, or somebody else's program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from lidarcheck.effects import Effect
from lidarcheck.effects.base import STAGES
from lidarcheck.sensor import Material, Program, Sensor

__all__ = ["READS", "External", "Model", "ProgramNumber"]

READS = ("Share", "Parts", "Reflectance", "Background", "Time", "Frame", "Seed")
"""What somebody else's model may understand of what it is handed."""


@dataclass(frozen=True, slots=True)
class ProgramNumber:
    """A number of somebody else's model that may be turned between `low` and `high`, in its own unit.

    `name`: what stands in braces in the command, else a key of the `ini`, else a parameter of a request. `effect`: the
    effect that it stands for, or one of that effect's parameters behind a dot; with the effect the number is `value`
    plus `scale` times the parameter.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str = ""
    effect: str = ""
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class External:
    """Somebody else's sensor model, run in the built-in one's place.

    `command` may hold the placeholders of `lidarcheck.model.external`; it runs in `directory`, for at most `timeout_s`
    an ideal scan. `ini` is the file that `{ini}` stands for. `server`: the command stays up and answers requests.
    `module`: a Python function, `package.module:function`, found in `directory` or installed; then there is no command.
    `reads`: what it understands of `READS`, None where that is to be found out. `scatter_material`: the number of a
    material that it takes for the air. `parameters`: its own numbers that may be turned.
    """

    command: tuple[str, ...]
    directory: Path
    ini: Path | None = None
    timeout_s: float = 600.0
    server: bool = False
    module: str = ""
    reads: tuple[str, ...] | None = None
    scatter_material: int | None = None
    parameters: tuple[ProgramNumber, ...] = ()

    @property
    def draws_anew(self) -> bool:
        """Whether it is told of a seed or a frame at all: else all its frames are the same."""
        named = " ".join(self.command)
        told = "{seed}" in named or "{frame}" in named or ("{ini}" in named and self.ini is None)
        return told or self.server or bool(self.module)

    def with_settings(self, settings: Mapping[str, float]) -> External:
        """The same with its numbers at other values, by their names."""
        turned = tuple(replace(one, value=settings.get(one.name, one.value)) for one in self.parameters)
        return self if turned == self.parameters else replace(self, parameters=turned)


@dataclass(frozen=True, slots=True)
class Model:
    """A sensor model as its file describes it; `file` is that file, for messages.

    `effects` are configured effects in the order of the light's way (see `lidarcheck.effects`).
    """

    sensor: Sensor
    materials: Mapping[int, Material] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()
    external: External | None = None
    file: Path | None = None

    def with_sensor(self, **overrides: float) -> Model:
        """The same model with numbers of its sensor replaced."""
        return replace(self, sensor=replace(self.sensor, **overrides))  # type: ignore[arg-type]

    @property
    def as_written(self) -> External | None:
        """Somebody else's model as a file has it: with its numbers as they stand now."""
        settings = self.sensor.settings if isinstance(self.sensor, Program) else {}
        return None if self.external is None else self.external.with_settings(settings)

    def with_(self, effect: Effect) -> Model:
        """The same model with an effect in its place on the light's way, behind those of its stage."""
        effects = sorted((*self.without(effect.name).effects, effect), key=lambda e: STAGES.index(e.stage))
        return replace(self, effects=tuple(effects))

    def without(self, name: str) -> Model:
        """The same model without the effect of that name."""
        return replace(self, effects=tuple(effect for effect in self.effects if effect.name != name))
