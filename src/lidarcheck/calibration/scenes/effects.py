"""The model with the effects that a comparison asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lidarcheck.config.words import nearest
from lidarcheck.effects import Effect, find, make
from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model

__all__ = ["chosen_effects"]


def chosen_effects(
    model: Model, *, only: Sequence[str] | None = None, without: Sequence[str] = ()
) -> tuple[Model, tuple[str, ...]]:
    """The model with `only` these effects, or `without` those; and the names of those that it did not have.

    An effect of `only` that the model has keeps its parameters, another is added with its typical ones. `UsageError`:
    an unknown name, with the nearest; one to be left out that the model does not have.
    """
    own = [effect.name for effect in model.effects]
    for name in without:
        if name not in own:
            find(name)
            near = nearest(name, own)
            has = f"it has {', '.join(own)}" if own else "it has none"
            fix = f"did you mean {near}?" if near else has
            raise UsageError(f"the model has no effect {name!r} to leave out", file=model.file, fix=fix)
        model = model.without(name)
    if only is None:
        return model, ()
    added = tuple(dict.fromkeys(name for name in only if name not in own))
    for name in only:
        reason = find(name).why_not(model.sensor)
        if reason and name in added:
            raise UsageError(f"{name} means nothing for {model.sensor.name}: {reason}", fix=f"leave {name} out")
    chosen = replace(model, effects=tuple(effect for effect in model.effects if effect.name in only))
    for name in added:
        chosen = chosen.with_(_typical(name))
    return chosen, added


def _typical(name: str) -> Effect:
    try:
        return make(name, {})
    except (TypeError, UsageError) as error:
        what = f"{name} is not in the model and has no typical parameters"
        raise UsageError(what, fix=f"add it to the model file; see lidarcheck effects {name}") from error
