"""The objects of a scene file: each table's surface, put where it stands, with its copies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.words import shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.scenes import Facets, SceneObject
from lidarcheck.scenes.facets import placed
from lidarcheck.scenes.files.shapes import Mesh, ShapeTable
from lidarcheck.trust.places import named_file

__all__ = ["MAX_TRIANGLES", "is_file", "objects_of"]

MAX_TRIANGLES = 20_000_000
"""Of a scene with all copies: the corners alone take 1.4 GB."""


def objects_of(tables: Sequence[ShapeTable], directory: Path, lines: LineIndex) -> list[SceneObject]:
    """The objects of the tables `objects`, by whose index `lines` has them; files are looked for from `directory`.

    Objects without an ID of their own are numbered from 1 in the order of the file. `ConfigError` with all faults.
    """
    surfaces, faults = _surfaces(tables, directory, lines)
    objects: list[SceneObject] = []
    next_object = 1
    for index, (shape, facets) in enumerate(zip(tables, surfaces, strict=True)):
        first = next_object if shape.object is None else shape.object
        next_object = max(next_object, first + shape.copies)
        try:
            objects += _objects(shape, facets, first) if facets else []
        except UsageError as error:
            faults.append(lines.fault(("objects", index), error.what, fix=error.fix))
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return objects


def _surfaces(
    tables: Sequence[ShapeTable], directory: Path, lines: LineIndex
) -> tuple[list[Facets | None], list[InputError]]:
    """The surface of each table of objects, without its copies; None where it has a fault.

    `ConfigError` when there are too many triangles: nothing further is worth reading.
    """
    surfaces: list[Facets | None] = []
    faults: list[InputError] = []
    triangles = 0
    for index, shape in enumerate(tables):
        try:
            facets = _facets(shape, index, directory, lines)
        except InputError as error:
            faults.append(error)
            surfaces.append(None)
            continue
        surfaces.append(facets)
        triangles += len(facets.triangles_m) * shape.copies
        if triangles > MAX_TRIANGLES:
            what = f"objects[{index}] with its copies brings the scene to {triangles} triangles"
            fix = f"at most {MAX_TRIANGLES}: fewer copies, a coarser mesh or fewer sides"
            raise ConfigError([*faults, lines.fault(("objects", index), what, fix=fix)])
    return surfaces, faults


def _facets(shape: ShapeTable, index: int, directory: Path, lines: LineIndex) -> Facets:
    if not isinstance(shape, Mesh):
        return shape.facets(directory)
    if not is_file(named_file(lines.file, shape.file, lines.line(("objects", index, "file")))):
        what = f"objects[{index}].file = {shown(str(shape.file))} is not a file"
        raise lines.fault(("objects", index, "file"), what, fix="give its path from the scene's directory")
    try:
        return shape.facets(directory)
    except InputError as error:
        what = f"objects[{index}].file: {shape.file}: {error.what}"
        raise lines.fault(("objects", index, "file"), what, fix=error.fix) from None


def _objects(shape: ShapeTable, facets: Facets, first: int) -> list[SceneObject]:
    made = []
    name = shape.name or str(shape.shape)  # type: ignore[attr-defined]
    for copy in range(shape.copies):
        position = np.asarray(shape.position_m) + copy * np.asarray(shape.step_m)
        there = placed(
            facets, tuple(position.tolist()), yaw_deg=shape.yaw_deg, pitch_deg=shape.pitch_deg, roll_deg=shape.roll_deg
        )
        label = name if shape.copies == 1 else f"{name} {copy + 1}"
        made.append(SceneObject(there.triangles_m, there.material_id, first + copy, shape.velocity_m_s, label))
    return made


def is_file(path: Path) -> bool:
    """Whether there is such a file; not where the name cannot be one."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
