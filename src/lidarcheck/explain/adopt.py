"""Adding it: the model file with the effects in their place, and what that changes, to read before it is taken."""

from __future__ import annotations

import dataclasses
import difflib
import logging
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.effects import Effect
from lidarcheck.errors import LidarcheckError
from lidarcheck.explain.model_text import edited, effect_lines, shown_value, steps
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.config import LineIndex
from lidarcheck.formats.toml_lines import locate
from lidarcheck.model.file import load_model, model_of, save_model
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Material

__all__ = ["WrittenModel", "model_diff", "write_model"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class WrittenModel:
    """A model file that was written. `rewritten`: why the text of the source could not be kept; empty if it was."""

    path: Path
    rewritten: str = ""


def write_model(source: Path | str, model: Model, out: Path | str) -> WrittenModel:
    """Write `model` as the text of the model file `source` with its effects put in, changed or taken out.

    All else of the text stays byte for byte: comments, order, line ends; files are named anew from `out`'s directory.
    Reading it gives `model` again. Where the text cannot be edited so, or where the model differs from the source in
    more than effects, the file is written anew as `save_model` does, and the result and a warning say why. Whole or
    not at all. Raises as `load_model` does for the source and `save_model` for `out`.
    """
    source, out = Path(source), Path(out)
    before = load_model(source)
    try:
        text = _text(source, before, model, out)
    except ValueError as error:
        _log.warning("%s: comments and layout of %s are not kept: %s", out, source, error)
        save_model(model, out)
        return WrittenModel(out, str(error))
    write_text(out, text)
    return WrittenModel(out)


def model_diff(before: Model, after: Model) -> list[str]:
    """What differs between two models, in the words of their files: lines that begin with `-`, `+` or two blanks.

    Section by section: sensor, materials, then the effects in the order of the light's way; what is the same is left
    out. An effect that is new has all its lines, one that has changed its name and what changed.
    """
    directory = Path.cwd() if before.file is None else before.file.absolute().parent
    lines = _difference(_sensor_lines(before), _sensor_lines(after))
    for number in sorted({*before.materials, *after.materials}):
        lines += _difference(*(_material_lines(number, model.materials.get(number)) for model in (before, after)))
    for step in steps(before.effects, after.effects):
        if step.old is None or step.new is None or _placeless(step.old) != _placeless(step.new):
            old, new = ([] if effect is None else effect_lines(effect, directory) for effect in (step.old, step.new))
            lines += _difference(old, new)
    if before.external != after.external:
        lines += _difference(*([] if model.external is None else ["[external]"] for model in (before, after)))
    return lines


def _text(source: Path, before: Model, model: Model, out: Path) -> str:
    """The edited text; `ValueError`, with the reason in words, where it would not be the model's."""
    if model.external is not None or before.external is not None:
        raise ValueError("an external model has no effects")
    if _placeless_model(dataclasses.replace(before, effects=())) != _placeless_model(
        dataclasses.replace(model, effects=())
    ):
        raise ValueError("the sensor or the materials differ, too")
    directories = source.absolute().parent, out.absolute().parent
    text = edited(source.read_bytes().decode("utf-8"), before.effects, model.effects, *directories)
    plain = text.removeprefix("\ufeff")
    try:
        again = model_of(tomllib.loads(plain), LineIndex(out, locate(plain)))
    except (LidarcheckError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"its text cannot be edited piece by piece ({str(error).splitlines()[0]})") from error
    if _placeless_model(again) != _placeless_model(model):
        raise ValueError("its text cannot be edited piece by piece")
    return text


def _placeless_model(model: Model) -> Model:
    """The model without its file's name, and with one spelling for the files that its effects name."""
    return dataclasses.replace(model, file=None, effects=tuple(_placeless(effect) for effect in model.effects))


def _placeless(effect: Effect) -> Effect:
    curves = {file.name: getattr(effect, file.name) for file in effect.files()}
    real: dict[str, Any] = {
        name: dataclasses.replace(curve, file=os.path.realpath(curve.file))
        for name, curve in curves.items()
        if curve is not None
    }
    return dataclasses.replace(effect, **real) if real else effect


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
