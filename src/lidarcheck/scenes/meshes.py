"""Meshes from files: STL, OBJ, PLY and GLB, read by trimesh."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.limits import MESH_BYTES, check_bytes
from lidarcheck.scenes.facets import Facets
from lidarcheck.scenes.mesh_files import check_glb, mesh_content
from lidarcheck.trust.places import named_file

__all__ = ["SUFFIXES", "load_mesh"]

SUFFIXES = (".stl", ".obj", ".ply", ".glb")
Up = Literal["z", "y"]


def load_mesh(path: Path, material: int, *, scale: float = 1.0, up: Up | None = None) -> Facets:
    """The triangles of a mesh file, its numbers times `scale` being metres.

    `up`: the axis that points up in the file, turned to Z; by default that which the format prescribes, Y in GLB, else
    Z. A mesh with Y up looks along +Z, which becomes +X. `InputError` with the file for whatever is wrong with it.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{suffix or 'a name without suffix'} is no mesh format", file=path, fix=_formats())
    if not path.is_file():
        raise InputError("there is no such mesh file", file=path, fix="check the name and the directory")
    if path.stat().st_size == 0:
        raise InputError("the mesh file is empty", file=path, fix="was it written completely?")
    check_bytes(path.stat().st_size, path, MESH_BYTES)
    triangles = _triangles(path, suffix[1:]) * scale
    if not np.all(np.isfinite(triangles)):
        raise InputError("the mesh has corners that are not finite", file=path, fix="export it again")
    if (up or ("y" if suffix == ".glb" else "z")) == "y":
        triangles = triangles[..., [2, 0, 1]]
    return Facets(triangles, np.full(len(triangles), material, dtype=np.int32))


def _triangles(path: Path, kind: str) -> Any:
    import trimesh

    if kind == "glb":
        check_glb(path)
    source = io.BytesIO(mesh_content(path, kind))
    # Colours and textures say nothing here, and would be looked for in further files.
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    if kind == "glb":  # of the others everything stands in the file
        options = {"resolver": _further_files(path)}
    try:
        with warnings.catch_warnings():
            # So numpy says that it stopped at something that is no number.
            warnings.filterwarnings("error", category=DeprecationWarning, message="string or file could not be read")
            mesh = trimesh.load_mesh(source, file_type=kind, process=False, **options)
        triangles = np.asarray(mesh.triangles, dtype=np.float64)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001
        # Whatever trimesh's readers stumble over, it is the file that is not what it should be.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"not a readable {kind.upper()} mesh: {reason[:120]}", file=path, fix=_formats()) from None
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3):
        what = f"not a readable {kind.upper()} mesh: its corners do not have three coordinates each"
        raise InputError(what, file=path, fix=_formats())
    if not len(triangles):
        raise InputError("the mesh has no triangles", file=path, fix="export surfaces, not points or lines")
    return triangles


def _formats() -> str:
    return f"use a mesh of the format {', '.join(SUFFIXES)}"


def _further_files(path: Path) -> Any:
    """What trimesh asks for the files that a mesh names by their place, none of them outside of its project."""
    from trimesh.resolvers import FilePathResolver

    class Further(FilePathResolver):
        def get(self, name: str) -> bytes:
            return named_file(path, name.strip()).read_bytes()

    return Further(str(path))
