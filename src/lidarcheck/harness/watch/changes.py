"""A model with one parameter changed by what its user would notice."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from lidarcheck.effects import Effect, catalogue
from lidarcheck.effects.base import STAGES
from lidarcheck.effects.parameters import Curve, Parameter
from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model
from lidarcheck.sensor import SpadArray
from lidarcheck.sensor.document import own

__all__ = ["SENSOR", "Change", "change_of", "parameters_of"]

SENSOR = "sensor"
"""Whose parameters those of the `[sensor]` table are."""


@dataclass(frozen=True, slots=True)
class Change:
    """One parameter of a model changed. `words`: from what to what, as "0.2 -> 0.25 deg"; `model`: the changed one."""

    words: str
    model: Model


def parameters_of(models: Iterable[Model]) -> tuple[tuple[str, str], ...]:
    """(owner, parameter) of the sensor and of every effect of the catalogue that one of the models has on, in order."""
    on = {effect.name for model in models for effect in model.effects}
    found = [(SENSOR, name) for name in SpadArray.bounds]
    for name, effect in catalogue().items():
        found += [(name, field.name) for field in dataclasses.fields(effect)] if name in on else []
    return tuple(found)


def change_of(model: Model, owner: str, parameter: str) -> Change | None:
    """The model with that parameter noticeably changed; None where it has not the effect on, or gives it no value.

    Of the values that lie a noticeable change away the first is taken that the model can have.
    """
    if owner == SENSOR:
        return _sensor_change(model, parameter)
    place = next((at for at, effect in enumerate(model.effects) if effect.name == owner), None)
    if place is None:
        return None
    effect = model.effects[place]
    declared = _declared(type(effect))[parameter]
    value = getattr(effect, parameter)
    for other in declared.nearby(value):
        try:
            changed = dataclasses.replace(effect, **{parameter: other})
            changed.check(model.sensor)
            effects = [*model.effects[:place], changed, *model.effects[place + 1 :]]
            effects.sort(key=lambda one: STAGES.index(one.stage))  # a word may move it to another stage
            unit = getattr(declared, "unit", "")
            return Change(_words(value, other, unit), dataclasses.replace(model, effects=tuple(effects)))
        except UsageError:
            continue
    return None


def _declared(effect: type[Effect]) -> dict[str, Any]:
    kinds: tuple[Sequence[Any], ...] = (effect.parameters(), effect.lists(), effect.choices(), effect.files())
    return {one.name: one for kind in kinds for one in kind}


def _sensor_change(model: Model, name: str) -> Change | None:
    if name not in model.sensor.numbers():
        return None
    bounds, value = model.sensor.numbers()[name], getattr(model.sensor, name)
    usual = getattr(own(model.sensor), name)
    declared = Parameter(
        name, bounds.unit, bounds.low, bounds.high, usual, bounds.whole, meaning="", noticeable=bounds.noticeable
    )
    for other in declared.nearby(value):
        try:
            return Change(_words(value, other, bounds.unit), model.with_sensor(**{name: other}))
        except UsageError:
            continue
    return None


def _words(before: object, after: object, unit: str) -> str:
    if isinstance(before, Curve) and isinstance(after, Curve):
        largest = max(range(len(before.y)), key=lambda at: abs(before.y[at]))
        return f"the whole curve x {after.y[largest] / before.y[largest]:g}" if before.y[largest] else "the whole curve"
    return f"{_shown(before)} -> {_shown(after)} {unit}".rstrip()


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_shown(one) for one in value)}]"
    return f"{value:g}" if isinstance(value, float) else "left out" if value is None else str(value)
