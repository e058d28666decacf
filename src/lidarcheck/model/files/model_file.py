"""The model file: TOML with the variant, overrides of the sensor, materials and effects, or an external command."""

from __future__ import annotations

import functools
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ConfigDict, Field, create_model

from lidarcheck.config.schema import Config, LineIndex, validate
from lidarcheck.effects.base import Curve, Effect, FileParameter, in_detector
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.lut import load_lut
from lidarcheck.formats.materials import MaterialId, MaterialTable, materials_of
from lidarcheck.model.files.external_file import (
    ExternalTable,
    document_of,
    external_of,
    faults_of,
    foreign_numbers,
    sensor_around,
)
from lidarcheck.model.files.sensor_file import is_sensor_file, sensor_of_model
from lidarcheck.model.files.settled import settled
from lidarcheck.model.spec import Model
from lidarcheck.sensor import VARIANTS, Material, Sensor
from lidarcheck.sensor.schema import overrides_table, program_overrides
from lidarcheck.trust.places import named_file

__all__ = ["dump_model", "load_model", "model_of", "save_model"]


class _EffectTable(Config):
    """Its parameters are the effect's own, so any further key is kept."""

    model_config = ConfigDict(extra="allow")
    name: str


class _ModelTable(Config):
    variant: str
    sensor: Any = None
    materials: dict[MaterialId, MaterialTable] = Field(default_factory=dict)
    effects: tuple[_EffectTable, ...] = ()


class _ExternalModel(_ModelTable):
    variant: str = VARIANTS[0]
    sensor: program_overrides() = program_overrides()()  # type: ignore[valid-type]
    external: ExternalTable


def load_model(path: str | os.PathLike[str]) -> Model:
    """Read a sensor model from TOML.

    `InputError` when the file cannot be read, `ConfigError` with every fault, its line and its fix. Materials that a
    scan needs and the table lacks are found when that scan is simulated.
    """
    data, lines = parse_toml(path)
    return model_of(data, lines)


def model_of(data: dict[str, Any], lines: LineIndex) -> Model:
    """The model of a parsed file, or of a table inside another file; faults as `load_model`."""
    return _external_model(data, lines) if "external" in data else _built_in_model(data, lines)


def save_model(model: Model, path: str | os.PathLike[str]) -> None:
    """Write a model so that `load_model` gives an equal one back; atomic. Raises as `dump_model` does."""
    write_text(path, dump_model(model, path))


def dump_model(model: Model, path: str | os.PathLike[str]) -> str:
    """The text of a model's file, were it written there.

    Only numbers that differ from the variant's own are written. `ConfigError` when the model holds values that no file
    may have.
    """
    directory = Path(path).absolute().parent
    model = settled(model)
    text = tomli_w.dumps(_document(model, directory))
    parsed = tomllib.loads(text)
    lines = LineIndex(Path(path))
    validate(parsed, lines, _ExternalModel if model.external else _table_class(model.sensor))
    faults = _detector_faults(model.effects, model.sensor, lines)
    if faults:
        raise ConfigError(faults)
    return text


def _built_in_model(data: dict[str, Any], lines: LineIndex) -> Model:
    faults: list[InputError] = []
    effects = _effects(data.get("effects"), lines, faults)
    sensor = _variant(data, lines, faults)
    try:
        table = validate(data, lines, _table_class(sensor))
        if not faults and (overrides := table.sensor.model_dump(exclude_none=True, exclude_defaults=True)):
            sensor = sensor_of_model(table.variant, overrides, lines)
    except ConfigError as error:
        faults += error.faults
    if not faults:
        faults = _detector_faults(effects, sensor, lines)
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    materials = materials_of(table.materials, lines)
    return Model(sensor, materials, effects, file=lines.file)


def _table_class(sensor: Sensor) -> type[_ModelTable]:
    """The keys of a model of this sensor: `[sensor]` has its detector's numbers."""
    overrides = overrides_table(type(sensor))
    table: type[_ModelTable] = create_model("_ModelTable", __base__=_ModelTable, sensor=(overrides, overrides()))
    return table


def _variant(data: Mapping[str, Any], lines: LineIndex, faults: list[InputError]) -> Sensor:
    """The sensor that a model's `variant` names, without overrides; a built-in one beside a fault."""
    variant = data.get("variant")
    if isinstance(variant, str):
        try:
            return sensor_of_model(variant, {}, lines)
        except ConfigError as error:
            faults += error.faults
        except InputError as error:
            faults.append(error)
    return Sensor.of(VARIANTS[0])


def _effects(entries: object, lines: LineIndex, faults: list[InputError]) -> tuple[Any, ...]:
    """The configured effects; faults of their names, parameters and order are added to `faults`."""
    if not isinstance(entries, list) or not entries:
        return ()
    from lidarcheck.effects import check_order, make

    made: list[Any] = []
    for index, table in enumerate(entries):
        if not isinstance(table, dict) or not isinstance(table.get("name"), str):
            continue
        parameters = {key: value for key, value in table.items() if key != "name"}
        try:
            made.append(make(table["name"], parameters, functools.partial(_curve, lines, index)))
        except ConfigError as error:
            faults += error.faults
        except InputError as error:
            faults.append(error)
        except UsageError as error:
            faults.append(_effect_fault(error, index, parameters, lines))
    if len(made) == len(entries):
        for end in range(2, len(made) + 1):
            try:
                check_order(made[:end])
            except UsageError as error:
                faults.append(lines.fault(("effects", end - 1), error.what, fix=error.fix))
                break
    return tuple(made)


def _curve(lines: LineIndex, index: int, parameter: FileParameter, path: str) -> Curve:
    """The table of a LUT file that a model names by a path relative to its own, for one of its effects."""
    file = named_file(lines.file.absolute(), path, lines.line(("effects", index, parameter.name)))
    axis = parameter.kind.removeprefix("lut.")
    table = {str(name): table for name, table in load_lut(file).tables.items()}.get(axis)
    if table is None:
        raise InputError(f"the file has no {axis} table", file=file, fix=f"{parameter.name} needs one: add it")
    return Curve(tuple(table.x.tolist()), tuple(table.y.tolist()), str(file))


def _detector_faults(effects: Sequence[Effect], sensor: Sensor, lines: LineIndex) -> list[InputError]:
    """A fault for the first effect that means nothing for the sensor, lies beyond its beams, or makes one which cannot
    be, such as a dead time below the ON time."""
    for index, effect in enumerate(effects):
        try:
            effect.check(sensor)
            sensor = in_detector(effect, sensor)
        except UsageError as error:
            return [_effect_fault(error, index, effect.settings(), lines)]
    return []


def _effect_fault(error: UsageError, index: int, parameters: Mapping[str, Any], lines: LineIndex) -> InputError:
    """The fault at the line of the parameter that the error speaks of, else at the effect's."""
    named = [key for key in parameters if re.search(rf"(?<!\w){re.escape(key)}(?!\w)", error.what)]
    longest = max(named, key=len, default="name")
    return lines.fault(("effects", index, longest), error.what, fix=error.fix)


def _external_model(data: dict[str, Any], lines: LineIndex) -> Model:
    faults: list[InputError] = []
    effects = _effects(data.get("effects"), lines, faults)
    described = _variant({"variant": VARIANTS[0], **data}, lines, faults)
    foreign = foreign_numbers(data, described, lines)
    own = {key: value for key, value in data.items() if key != "sensor" or not foreign}
    try:
        table = validate(own, lines, _ExternalModel)
        materials = materials_of(table.materials, lines)
        faults += foreign + faults_of(table.external, materials, lines)
        if not faults and (overrides := table.sensor.model_dump(exclude_none=True, exclude_defaults=True)):
            described = sensor_of_model(table.variant, overrides, lines)
    except ConfigError as error:
        faults += [*foreign, *error.faults]
    if not faults:
        external = external_of(table.external, lines)
        sensor = sensor_around(external, described, materials)
        faults = _detector_faults(effects, sensor, lines)
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return Model(sensor, materials, effects, external, lines.file)


def _document(model: Model, directory: Path) -> dict[str, Any]:
    sensor, external = model.sensor, model.external
    alone = external is not None and not (model.materials or model.effects or sensor.overrides())
    document: dict[str, Any] = {} if alone and sensor.variant == VARIANTS[0] else {"variant": sensor.variant}
    if sensor.file and is_sensor_file(sensor.variant):
        document["variant"] = Path(os.path.relpath(sensor.file, directory)).as_posix()
    if overrides := sensor.overrides():
        document["sensor"] = {name: _plain(value) for name, value in overrides.items()}
    if external is not None:
        document["external"] = document_of(external, directory)
    if model.materials:
        document["materials"] = {str(number): _material_table(entry) for number, entry in model.materials.items()}
    if model.effects:
        document["effects"] = [_effect_table(effect, directory) for effect in model.effects]
    return document


def _material_table(material: Material) -> dict[str, Any]:
    table = {"name": material.name, "reflectance": float(material.reflectance), "kind": material.kind}
    return {**table, "retro_gain": float(material.retro_gain)} if material.kind == "retro" else table


def _effect_table(effect: Effect, directory: Path) -> dict[str, Any]:
    """Its name and parameters; files by their paths from the model file's directory."""
    table = {"name": effect.name, **_plain(effect.settings())}
    for parameter in effect.files():
        if parameter.name in table:
            table[parameter.name] = Path(os.path.relpath(table[parameter.name], directory)).as_posix()
    return table


def _plain(value: Any) -> Any:
    """The same value in TOML's own types, numpy scalars unwrapped."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    return value.item() if hasattr(value, "item") else value
