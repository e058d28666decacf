"""A model around somebody else's program as a file can hold it."""

from __future__ import annotations

from dataclasses import replace

from lidarcheck.effects.base import STAGES
from lidarcheck.effects.finding import make, with_role
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Material, Program

__all__ = ["settled"]


def _returned(material: Material) -> float:
    return material.reflectance * (material.retro_gain if material.kind == "retro" else 1.0)


def settled(model: Model) -> Model:
    """The same model with what a fit has made of the program's numbers and materials in the words of a file.

    The numbers stand in `[external.parameters]`. A material's entry says what the program is taken to have, so that
    another reflectance is an effect. A model without a program stays as it is.
    """
    program = model.sensor
    if not isinstance(program, Program):
        return model
    effects = list(model.effects)
    for number, known in program.known.items():
        before, after = _returned(known), _returned(model.materials[number])
        if before != after and before > 0.0:
            factor = {"factor": after / before, "material_id": number}
            effects.insert(0, make(with_role("reflectance").name, factor))
    effects.sort(key=lambda effect: STAGES.index(effect.stage))
    return replace(model, effects=tuple(effects), materials=dict(program.known), external=model.as_written)
