"""Scene files: what may stand in one, and the scene that it describes.

A scene is a TOML file, or a table `scene` in another one, or the name of a scene that comes with lidarcheck. Reading
finds all faults at once, each with its line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from lidarcheck.config.schema import Config, LineIndex, PathText, validate
from lidarcheck.config.words import nearest, shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.materials import MaterialId, MaterialTable, materials_of
from lidarcheck.scan import IdealScan
from lidarcheck.scenes import Optics, Scene
from lidarcheck.scenes.files.objects import is_file, objects_of
from lidarcheck.scenes.files.shapes import Mesh, ObjectTable, ShapeTable, Velocity
from lidarcheck.scenes.files.spans import Span, beyond
from lidarcheck.scenes.sampling import MAX_SUB_BEAMS
from lidarcheck.sensor import VARIANTS, Material, Sensor, shipped
from lidarcheck.trust.places import named_file

__all__ = [
    "SamplingTable",
    "SceneFile",
    "SceneTable",
    "build_scene",
    "builtin_names",
    "builtin_path",
    "load_scene",
    "scene_of",
]

_OWN_KEYS = ("description", "materials", "scene")
_NO_MATERIALS = ("object", "copies", "sides")
_ID = re.compile(r"0|[1-9][0-9]{0,8}")


def _check_id(text: str) -> str:
    if not _ID.fullmatch(text):
        raise ValueError("not a material's number")
    return text


def _not_empty(tables: tuple[ShapeTable, ...]) -> tuple[ShapeTable, ...]:
    if not tables:
        raise ValueError("the scene has no objects; add an [[objects]] table")
    return tables


_MaterialId = Annotated[
    str, AfterValidator(_check_id), Field(json_schema_extra={"words": "a material's number, from 0"})
]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class OpticsTable(Config):
    """An `[optics.<material>]` table."""

    mirror: _Share = 0.0
    transmission: _Share = 0.0

    @model_validator(mode="after")
    def _no_more_than_falls_in(self) -> OpticsTable:
        if self.mirror + self.transmission > 1.0 + 1e-12:
            total = self.mirror + self.transmission
            raise ValueError(f"mirror + transmission = {total:g} is above 1; what falls in is shared between them")
        return self


class SamplingTable(Config):
    """A `[sampling]` table: which beams are cast, and how; see `lidarcheck.scenes.Scene.ideal`.

    None: as the sensor has it.
    """

    layers: Span | None = None
    points: Span | None = None
    sub_beams: Annotated[int, Field(ge=1, le=MAX_SUB_BEAMS)] | None = None
    second_hits: bool = True
    swept: bool = False
    velocity_m_s: Velocity = (0.0, 0.0, 0.0)
    yaw_deg_s: Annotated[float, Field(ge=-360.0, le=360.0, json_schema_extra={"unit": "deg/s"})] = 0.0
    max_range_m: Annotated[float, Field(gt=0.0, le=1000.0, json_schema_extra={"unit": "m"})] | None = None

    def resolved(self, sensor: Sensor) -> SamplingTable:
        """The same for that sensor, with its numbers in the place of those that the file leaves out."""
        beams = sensor.beams
        own: dict[str, Any] = {
            "layers": (0, beams.layers - 1),
            "points": (0, beams.points - 1),
            "sub_beams": 1 if sensor.sub_rays == (1, 1) else None,
            "max_range_m": sensor.max_range_m,
        }
        return self.model_copy(update={key: value for key, value in own.items() if getattr(self, key) is None})


class SceneTable(Config):
    """What a scene consists of."""

    objects: Annotated[tuple[ObjectTable, ...], AfterValidator(_not_empty)]
    optics: dict[_MaterialId, OpticsTable] = Field(default_factory=dict)
    sampling: SamplingTable = SamplingTable()


class _Heading(Config):
    """What a scene file holds besides the scene; `materials` names a TOML file with such a table, or is one."""

    description: Annotated[str, Field(min_length=1)] = "a scene"
    materials: PathText | dict[str, Any] | None = None
    scene: dict[str, Any] | None = None


class _MaterialsFile(Config):
    materials: dict[str, Any]


class _Materials(Config):
    materials: dict[MaterialId, MaterialTable]


@dataclass(frozen=True)
class SceneFile:
    """A scene file, read.

    `name`: the file's name without `.toml`. `materials`: by number, None where the file has no table of them.
    `sampling`: which beams it asks for, and how; `places`: file and line of each of its keys. `files`: all that was
    read: the scene's own, materials, meshes.
    """

    name: str
    path: Path
    description: str
    scene: Scene
    sampling: SamplingTable
    materials: Mapping[int, Material] | None = None
    files: tuple[Path, ...] = ()
    places: Mapping[str, tuple[Path, int]] = field(default_factory=dict)

    def ideal(self, sensor: Sensor | None = None, **changes: Any) -> IdealScan:
        """The ideal scan as the file's sampling asks for it, with `changes` by the names of `Scene.ideal`.

        `ConfigError` with the line of the sampling's layers or points that the sensor does not have.
        """
        sensor = shipped(VARIANTS[0]) if sensor is None else sensor
        for name, (file, line) in self.places.items():
            wrong = None if name in changes else beyond(name, getattr(self.sampling, name), sensor.beams)
            if wrong is not None:
                raise ConfigError([InputError(wrong[0], file=file, line=line, fix=wrong[1])])
        ideal = self.scene.ideal(sensor, **{**self.sampling.model_dump(), **changes})
        return replace(ideal, file=str(self.path))

    def sampled_as(self, table: SamplingTable | None, lines: LineIndex) -> SceneFile:
        """The same with what another file's `[sampling]` says, key by key; `lines` are that file's."""
        if table is None:
            return self
        changes = {key: getattr(table, key) for key in table.model_fields_set}
        places = {**self.places, **_places(table, lines)}
        return replace(self, sampling=self.sampling.model_copy(update=changes), places=places)


def builtin_names() -> tuple[str, ...]:
    """The scenes that come with lidarcheck, in alphabetical order."""
    return tuple(sorted(file.stem for file in _builtin().glob("*.toml")))


def builtin_path(name: str) -> Path:
    """The file of a scene that comes with lidarcheck; `UsageError` with the nearest name where there is none."""
    if name not in builtin_names():
        near = nearest(name, builtin_names())
        fix = f"did you mean {near}?" if near else "lidarcheck scene --list shows those that there are"
        raise UsageError(f"there is no scene {shown(name)}", fix=fix)
    return _builtin() / f"{name}.toml"


def _builtin() -> Path:
    return Path(str(resources.files("lidarcheck.scenes").joinpath("builtin")))


def load_scene(path: Path | str) -> SceneFile:
    """Read a scene file and the files that it names, by paths relative to it.

    The scene's tables stand at the top or in `[scene]`. `InputError` when a file cannot be read, `ConfigError` with
    every fault and its line.
    """
    data, lines = parse_toml(path)
    heading = validate({key: data[key] for key in _OWN_KEYS if key in data}, lines, _Heading)
    if "scene" in data:
        stray = [lines.fault((key,), f"{key} stands beside [scene]", fix="move it into [scene]") for key in data
                 if key not in _OWN_KEYS]  # fmt: skip
        if stray:
            raise ConfigError(stray)
        content, inner = data["scene"], _inside(lines, "scene")
    else:
        content, inner = {key: value for key, value in data.items() if key not in _OWN_KEYS}, lines
    materials = _materials(heading, data, lines)
    file = _scene_file(content, inner, Path(path).stem)
    if materials is not None:
        _check_materials(file, materials, content, inner)
    named = [_named(heading.materials, lines)] if isinstance(heading.materials, Path) else []
    facts: dict[str, Any] = {"path": Path(path), "description": heading.description, "materials": materials}
    return replace(file, files=(*file.files, *named), **facts)


def scene_of(value: object, lines: LineIndex, key: str = "scene") -> SceneFile:
    """The scene that a key of another file speaks of: a built-in's name, a path from that file, or a table.

    `lines`: that whole file's. Faults as `load_scene`, those of the reference itself at the key's line.
    """
    if isinstance(value, dict):
        return _scene_file(value, _inside(lines, key), lines.file.stem)
    if not isinstance(value, str):
        what = f"{key} = {shown(value)} is not a scene"
        fix = "use the name of a scene that lidarcheck has, a path in quotes or a table"
        raise ConfigError([lines.fault((key,), what, fix=fix)])
    if value in builtin_names():
        return load_scene(builtin_path(value))
    file = named_file(lines.file, value, lines.line((key,)))
    if not is_file(file):
        near = nearest(value, builtin_names())
        fix = f"did you mean {near}?" if near else "give its path from this file's directory, or the name of a built-in"
        raise ConfigError([lines.fault((key,), f"{key} = {shown(value)} is neither a file nor a built-in", fix=fix)])
    return load_scene(file)


def build_scene(table: SceneTable, directory: Path, lines: LineIndex) -> Scene:
    """The scene of a table; mesh files are looked for from `directory`, `lines` counts from the table's own keys.

    Objects without an ID of their own are numbered from 1 in the order of the file. `ConfigError` with all faults.
    """
    objects = objects_of(table.objects, directory, lines)
    optics = {int(number): Optics(entry.mirror, entry.transmission) for number, entry in table.optics.items()}
    try:
        return Scene(tuple(objects), optics)
    except UsageError as error:
        raise ConfigError([lines.fault(("objects",), error.what, fix=error.fix)]) from None


def _scene_file(content: dict[str, Any], lines: LineIndex, name: str) -> SceneFile:
    table = validate(content, lines, SceneTable)
    scene = build_scene(table, lines.file.parent, lines)
    meshes = dict.fromkeys(lines.file.parent / shape.file for shape in table.objects if isinstance(shape, Mesh))
    files = (lines.file, *meshes)
    return SceneFile(
        name, lines.file, "a scene", scene, table.sampling, files=files, places=_places(table.sampling, lines)
    )


def _places(table: SamplingTable, lines: LineIndex) -> dict[str, tuple[Path, int]]:
    """Where the spans of a table `sampling` stand."""
    named = [name for name in ("layers", "points") if name in table.model_fields_set]
    return {name: (lines.file, lines.line(("sampling", name))) for name in named}


def _materials(heading: _Heading, data: dict[str, Any], lines: LineIndex) -> dict[int, Material] | None:
    """The table of materials, in the file itself or in one that it names; faults as in a model file."""
    if heading.materials is None:
        return None
    if isinstance(heading.materials, Path):
        file = _named(heading.materials, lines)
        if not is_file(file):
            what = f"materials = {shown(str(heading.materials))} is not a file"
            raise ConfigError([lines.fault(("materials",), what, fix="give its path from the scene's directory")])
        data, lines = parse_toml(file)
        validate(data, lines, _MaterialsFile)
    return materials_of(validate({"materials": data["materials"]}, lines, _Materials).materials, lines)


def _named(materials: Path, lines: LineIndex) -> Path:
    return named_file(lines.file, materials, lines.line(("materials",)))


def _check_materials(
    file: SceneFile, materials: Mapping[int, Material], content: Mapping[str, Any], lines: LineIndex
) -> None:
    """A fault for each table of objects with a material that the file's own table lacks."""
    things = iter(file.scene.objects)
    faults = []
    for index, entry in enumerate(content["objects"]):
        used = {int(m) for _ in range(entry.get("copies", 1)) for m in np.unique(next(things).material_id)}
        lacking = sorted(used - set(materials))
        if lacking:
            key = next(
                (key for key, value in entry.items() if value == lacking[0] and key not in _NO_MATERIALS), "shape"
            )
            what = f"objects[{index}] has material {lacking[0]}, which the table of materials lacks"
            faults.append(lines.fault(("objects", index, key), what, fix=f"add [materials.{lacking[0]}]"))
    if faults:
        raise ConfigError(faults)


def _inside(lines: LineIndex, key: str) -> LineIndex:
    """The lines of a table's own keys."""
    return LineIndex(lines.file, {path[1:]: line for path, line in lines.lines.items() if path[0] == key})
