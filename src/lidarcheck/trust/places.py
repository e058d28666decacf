"""Which files a project's files may name: those of the project, and those of folders that the user permits.

A stranger's model, scenario or case must not make lidarcheck open, and quote in a message, what lies elsewhere.
"""

from __future__ import annotations

import os
from pathlib import Path

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError
from lidarcheck.permissions import given
from lidarcheck.trust.user_file import user_file, user_file_path

__all__ = ["MARKS", "check_place", "is_permitted", "named_file", "own_place", "project_of"]

_OWN = ".lidarcheck"
MARKS = ("dataset.toml", "case.toml", "scenarios", ".git")
"""What the folder of a project holds; `scenarios` is a folder."""


def project_of(file: str | os.PathLike[str]) -> Path:
    """The project that a file belongs to: the nearest folder above with one of `MARKS`, else the file's own folder.

    What lidarcheck keeps in a folder's `.lidarcheck` belongs to that folder.
    """
    own = Path(os.path.abspath(file)).parent  # noqa: PTH100 - a link in the path is the user's own way to the file
    above = (own, *own.parents)
    kept = next((folder.parent for folder in above if folder.name == _OWN), own)
    return next((folder for folder in above if _is_project(folder)), kept)


def _is_project(folder: Path) -> bool:
    return any((folder / mark).is_dir() if mark == "scenarios" else (folder / mark).exists() for mark in MARKS)


def named_file(naming: str | os.PathLike[str], name: str | os.PathLike[str], line: int | None = None) -> Path:
    """The path of a file that another one names by its path from there.

    `InputError`, before it is looked at, where it is neither in the project of the naming file nor permitted; links
    are followed. `line`: where it is named.
    """
    path = Path(naming).parent / name
    check_place(path, naming, line)
    return path


def check_place(path: Path, naming: str | os.PathLike[str], line: int | None = None) -> None:
    """Refuse a path outside of the project of the naming file, and of what the user permits; see `named_file`."""
    if is_permitted(path, naming):
        return
    is_link = os.path.realpath(path) != os.path.abspath(path)  # noqa: PTH100 - without following links
    which = "" if Path(naming) == path else f"{shown(str(path), 200)} "
    what = f"{which}leads out of the project {project_of(naming)}{' by a link' if is_link else ''}"
    real = Path(os.path.realpath(path)).parent
    fix = f"move it into the project, or permit its folder: --root {real}, or roots in {user_file_path()}"
    raise InputError(what, file=naming, line=line, fix=fix)


def is_permitted(path: Path, naming: str | os.PathLike[str]) -> bool:
    """Whether a path is in the project of the naming file, or below a folder that the user permits."""
    if _is_below(path, project_of(naming)) or any(_is_below(path, root) for root in given().roots):
        return True
    return any(_is_below(path, root) for root in user_file().roots)


def own_place(path: Path, root: Path) -> Path:
    """A path below `root` where lidarcheck writes or removes unasked, such as a proposal's.

    `InputError` where a part of it below `root` is a link: somebody may have committed one that leads elsewhere.
    """
    for part in (path, *path.parents):
        if part == root or part == part.parent:
            break
        if part.is_symlink():
            fix = "remove the link: lidarcheck makes a file or folder of its own there"
            raise InputError("is a link, and nothing is written or removed through it", file=part, fix=fix)
    return path


def _is_below(path: Path, folder: Path) -> bool:
    try:
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
    except (OSError, ValueError):  # a zero byte in a name, a circle of links
        return False
