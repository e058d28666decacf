"""Adding it: the model file with the effects in their place, and what that changes, to read before it is taken."""

from __future__ import annotations

import difflib
from pathlib import Path

from lidarcheck.model.files.edit_text import effect_lines, shown_value, steps
from lidarcheck.model.files.settled import settled
from lidarcheck.model.files.write import WrittenModel, placeless, rewritten_text, write_model
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Material

__all__ = ["WrittenModel", "model_diff", "rewritten_text", "write_model"]


def model_diff(before: Model, after: Model) -> list[str]:
    """What differs between two models, in the words of their files: lines that begin with `-`, `+` or two blanks.

    Section by section: sensor, materials, then the effects in the order of the light's way; what is the same is left
    out. An effect that is new has all its lines, one that has changed its name and what changed.
    """
    before, after = settled(before), settled(after)
    directory = Path.cwd() if before.file is None else before.file.absolute().parent
    lines = _difference(_sensor_lines(before), _sensor_lines(after))
    for number in sorted({*before.materials, *after.materials}):
        lines += _difference(*(_material_lines(number, model.materials.get(number)) for model in (before, after)))
    for step in steps(before.effects, after.effects):
        if step.old is None or step.new is None or placeless(step.old) != placeless(step.new):
            old, new = ([] if effect is None else effect_lines(effect, directory) for effect in (step.old, step.new))
            lines += _difference(old, new)
    return lines + _difference(_program_lines(before), _program_lines(after))


def _program_lines(model: Model) -> list[str]:
    """Somebody else's program, and its numbers as they stand."""
    external = model.as_written
    if external is None:
        return []
    lines = ["[external]", *external.command, external.module, str(external.ini), str(external.reads)]
    numbers = (
        (f"[external.parameters.{one.name}]", f"value = {shown_value(one.value)}") for one in external.parameters
    )
    return lines + [line for pair in numbers for line in pair]


def _sensor_lines(model: Model) -> list[str]:
    overrides = {name: shown_value(value) for name, value in model.sensor.overrides().items()}
    lines = [f'variant = "{model.sensor.variant}"']
    return [*lines, "[sensor]", *(f"{name} = {value}" for name, value in overrides.items())] if overrides else lines


def _material_lines(number: int, material: Material | None) -> list[str]:
    if material is None:
        return []
    lines = [f"[materials.{number}]", f"name = {shown_value(material.name)}"]
    lines += [f"reflectance = {shown_value(material.reflectance)}", f'kind = "{material.kind}"']
    return [*lines, f"retro_gain = {shown_value(material.retro_gain)}"] if material.kind == "retro" else lines


def _difference(old: list[str], new: list[str]) -> list[str]:
    """The lines of one section, those that differ marked, and none where all are the same."""
    if old == new:
        return []
    marked = []
    for kind, i, i_end, j, j_end in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind == "equal":
            # A heading and a name say what is changed; other lines that stay say nothing.
            marked += [f"  {line}" for line in old[i:i_end] if line.startswith(("[", "name = "))]
        else:
            marked += [f"- {line}" for line in old[i:i_end]] + [f"+ {line}" for line in new[j:j_end]]
    return marked
