"""Writing a changed model: the text of the file that it came from, with its numbers and effects in their place."""

from __future__ import annotations

import dataclasses
import logging
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.toml_lines import locate
from lidarcheck.effects import Effect
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.atomic import write_text
from lidarcheck.model.files.edit_numbers import changed_numbers, moved_files, with_numbers
from lidarcheck.model.files.edit_text import edited
from lidarcheck.model.files.model_file import dump_model, load_model, model_of
from lidarcheck.model.files.settled import settled
from lidarcheck.model.spec import External, Model

__all__ = ["WrittenModel", "placeless", "rewritten_text", "write_model"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class WrittenModel:
    """A model file that was written. `rewritten`: why the text of the source could not be kept; empty if it was."""

    path: Path
    rewritten: str = ""


def write_model(source: Path | str, model: Model, out: Path | str) -> WrittenModel:
    """Write `model` as the text of the model file `source` with its effects put in, changed or taken out, and the
    numbers of its sensor and materials changed.

    All else of the text stays byte for byte: comments, order, line ends; files are named anew from `out`'s directory.
    Reading it gives `model` again. Where the text cannot be edited so, or where the model differs from the source in
    more than that, the file is written anew as `save_model` does, and the result and a warning say why. Whole or
    not at all. Raises as `load_model` does for the source and `save_model` for `out`.
    """
    source, out = Path(source), Path(out)
    text, rewritten = rewritten_text(source, model, out)
    if rewritten:
        _log.warning("%s: comments and layout of %s are not kept: %s", out, source, rewritten)
    write_text(out, text)
    return WrittenModel(out, rewritten)


def rewritten_text(source: Path, model: Model, out: Path) -> tuple[str, str]:
    """What `write_model` would write, and why the text of the source could not be kept; empty if it was."""
    try:
        return _text(source, load_model(source), model, out), ""
    except ValueError as error:
        return dump_model(model, out), str(error)


def _text(source: Path, before: Model, model: Model, out: Path) -> str:
    """The edited text; `ValueError`, with the reason in words, where it would not be the model's."""
    model = settled(model)
    if (model.external is None) != (before.external is None):
        raise ValueError("one of the two models is a program")
    directories = source.absolute().parent, out.absolute().parent
    changed = changed_numbers(before, model) | moved_files(before, out)
    text = with_numbers(source.read_bytes().decode("utf-8"), changed)
    text = edited(text, before.effects, model.effects, *directories)
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
    external = model.external
    if external is not None:
        real = {name: path and Path(os.path.realpath(path)) for name, path in _places(external).items()}
        external = dataclasses.replace(external, **real)  # type: ignore[arg-type]
    effects = tuple(placeless(effect) for effect in model.effects)
    sensor = model.sensor
    if sensor.file:
        sensor = dataclasses.replace(sensor, variant="", file=os.path.realpath(sensor.file), plain=None)
    return dataclasses.replace(model, file=None, sensor=sensor, effects=effects, external=external)


def _places(external: External) -> dict[str, Path | None]:
    return {"directory": external.directory, "ini": external.ini}


def placeless(effect: Effect) -> Effect:
    """The effect with one spelling for the files that it names."""
    curves = {file.name: getattr(effect, file.name) for file in effect.files()}
    real: dict[str, Any] = {
        name: dataclasses.replace(curve, file=os.path.realpath(curve.file))
        for name, curve in curves.items()
        if curve is not None
    }
    return dataclasses.replace(effect, **real) if real else effect
