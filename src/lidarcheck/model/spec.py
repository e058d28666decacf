"""What a sensor model is: a sensor, its materials and effects, or somebody else's program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from lidarcheck.effects import Effect
from lidarcheck.effects.base import STAGES
from lidarcheck.sensor import Material, Sensor

__all__ = ["External", "Model"]


@dataclass(frozen=True, slots=True)
class External:
    """Somebody else's sensor model, run in the built-in one's place.

    `command` may hold the placeholders of `lidarcheck.model.external`; it runs in `directory`, for at most `timeout_s`
    an ideal scan. `ini` is the file that `{ini}` stands for. `server`: the command stays up and answers requests.
    `module`: a Python function, `package.module:function`, found in `directory` or installed; then there is no command.
    """

    command: tuple[str, ...]
    directory: Path
    ini: Path | None = None
    timeout_s: float = 600.0
    server: bool = False
    module: str = ""


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

    def with_(self, effect: Effect) -> Model:
        """The same model with an effect in its place on the light's way, behind those of its stage."""
        effects = sorted((*self.without(effect.name).effects, effect), key=lambda e: STAGES.index(e.stage))
        return replace(self, effects=tuple(effects))

    def without(self, name: str) -> Model:
        """The same model without the effect of that name."""
        return replace(self, effects=tuple(effect for effect in self.effects if effect.name != name))
