"""How effects are found by name: those of this folder and of plugins.

The model, the commands and the documentation know effects through `catalogue()` alone. Empirical terms, which describe
data and explain nothing, are found in the same way and stand apart.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lidarcheck.effects.base import STAGES, Effect
from lidarcheck.effects.parameters import Curve, FileParameter
from lidarcheck.effects.plugins import plugins
from lidarcheck.errors import UsageError

__all__ = ["catalogue", "check_order", "empirical_terms", "find", "make", "with_role"]


@functools.cache
def catalogue() -> Mapping[str, type[Effect]]:
    """All effects by name, in the order of the light's way and then of their names; no empirical terms."""
    return {name: effect for name, effect in _found().items() if not effect.empirical}


@functools.cache
def empirical_terms() -> Mapping[str, type[Effect]]:
    """The empirical terms by name, in the order of the light's way: what describes data that no effect explains."""
    return {name: effect for name, effect in _found().items() if effect.empirical}


@functools.cache
def _found() -> Mapping[str, type[Effect]]:
    """The effects of all files here and of plugins by name, in the order of the light's way and then of their names."""
    found: dict[str, type[Effect]] = {}
    for room in ("lidarcheck.effects", "lidarcheck.effects.empirical"):
        for module in pkgutil.iter_modules(importlib.import_module(room).__path__):
            found |= _effects_in(importlib.import_module(f"{room}.{module.name}"))
    for plugin in plugins():
        more = _effects_in(plugin)
        for name in more.keys() & found.keys():
            raise UsageError(f"a plugin has an effect {name!r}, as lidarcheck itself has", fix="give it another name")
        found |= more
    return dict(sorted(found.items(), key=lambda item: (STAGES.index(item[1].stage), item[0])))


def _effects_in(thing: object) -> dict[str, type[Effect]]:
    """The effects that a module has, or the one that an object is, by name."""
    values = [*vars(thing).values()] if inspect.ismodule(thing) else [thing]
    classes = (value for value in values if isinstance(value, type) and issubclass(value, Effect))
    return {value.name: value for value in classes if "name" in vars(value)}


def find(name: str) -> type[Effect]:
    """The effect or empirical term of that name; `UsageError` with the nearest one otherwise."""
    effects = _found()
    if name not in effects:
        raise UsageError(f"there is no effect {name!r}", fix=_did_you_mean(name, effects))
    return effects[name]


def with_role(role: str) -> type[Effect]:
    """The one effect of the catalogue that has this role; `LookupError` where there is none or more than one."""
    found = [effect for effect in catalogue().values() if effect.role == role]
    if len(found) != 1:
        raise LookupError(f"{len(found)} effects have the role {role!r}")
    return found[0]


def make(name: str, parameters: Mapping[str, Any], read: Callable[[FileParameter, str], Curve] | None = None) -> Effect:
    """A configured effect; `UsageError` for an unknown name or parameter, or a value out of its range.

    `read` turns the path that a file parameter has in a model file into its curve.
    """
    effect = find(name)
    files = {f.name: f for f in effect.files()}
    known = [f.name for f in dataclasses.fields(effect)]
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
