"""The model of a request: as its file has it, with the table that is edited in it."""

from __future__ import annotations

import os
from dataclasses import fields, replace
from typing import Any

from lidarcheck.calibration.number.request import Request
from lidarcheck.effects.base import Curve, Effect
from lidarcheck.effects.finding import make, with_role
from lidarcheck.errors import InputError, NotThereError
from lidarcheck.formats.lut import Axis, load_lut
from lidarcheck.model import load_model
from lidarcheck.model.spec import Model

__all__ = ["check_blooms", "edited_model", "said_of", "with_table"]


def edited_model(request: Request) -> Model:
    """The model, with the table of `lut` along the axis; `InputError` names the file with a fault."""
    model = load_model(os.path.realpath(request.model))
    if request.lut is None:
        return model
    file = os.path.realpath(request.lut)
    lut = load_lut(file)
    table = lut.tables.get(request.axis)
    if table is None:
        what = f"the file has no {request.axis} table"
        raise InputError(what, file=request.lut, fix=f"it has {', '.join(lut.tables)}")
    return with_table(model, request.axis, Curve(tuple(table.x.tolist()), tuple(table.y.tolist()), file))


def check_blooms(model: Model, axis: Axis) -> None:
    """Refuse a sensor whose beams do not hear each other's light: no table says anything of it."""
    why = with_role(f"{axis} blooming").why_not(model.sensor)
    if why:
        raise NotThereError(f"{model.sensor.name} does not bloom: {why}", file=model.file, fix="look at its gap")


def with_table(model: Model, axis: Axis, curve: Curve) -> Model:
    """The model whose bloom along an axis is the table's: its effect keeps all else, or is added."""
    kind = with_role(f"{axis} blooming")
    if not any(isinstance(effect, kind) for effect in model.effects):
        return model.with_(make(kind.name, {"lut": curve}))

    table: Any = {"lut": curve}  # which every effect of that role has
    effects = (replace(effect, **table) if isinstance(effect, kind) else effect for effect in model.effects)
    return replace(model, effects=tuple(effects))


def said_of(model: Model) -> str:
    """All that a model says, wherever its tables are kept: two that say the same show the same."""
    effects = [_placeless(effect) for effect in model.effects]
    return repr((model.sensor, effects, sorted(model.materials.items()), model.external))


def _placeless(effect: Effect) -> Effect:
    """The effect with its tables as if they were no file's."""
    tables: Any = {f.name: getattr(effect, f.name) for f in fields(effect)}
    return replace(effect, **{n: replace(t, file="") for n, t in tables.items() if isinstance(t, Curve)})
