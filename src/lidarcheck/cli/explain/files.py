"""The three files of an explanation: a place that is checked before the work, and written all or none."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.explain.files import MODEL, PAGE, REPORT
from lidarcheck.figures.files.outputs import make_directory, same_file
from lidarcheck.figures.files.sets import write_set
from lidarcheck.formats.atomic import is_read_only

__all__ = ["MODEL", "PAGE", "REPORT", "check_directory", "check_not_read", "make_directory", "write_set"]


def check_directory(out: Path, case: Path) -> None:
    """Refuse now, with an `InputError`, a place that could not be written after minutes of work."""
    if os.path.realpath(out) in (os.path.realpath(case), os.path.realpath(case.parent if case.is_file() else case)):
        raise InputError(
            "is the case's own directory, whose model.toml would be replaced", file=out, fix="name another for --out"
        )
    if out.exists() and not out.is_dir():
        raise InputError("is not a directory", file=out, fix="name a directory for --out")
    where = Path(os.path.realpath(out))
    if not out.exists():
        where = where.parent
        if not where.is_dir():
            raise InputError("its directory does not exist", file=out, fix=f"make {where} first")
    if is_read_only(where) or not os.access(where, os.X_OK):
        raise InputError("cannot be written", file=out, fix="check its permissions, or choose another place")
    for name in (REPORT, MODEL, PAGE):
        place = out / name
        if place.is_dir() or is_read_only(place):
            raise InputError("cannot be replaced", file=place, fix="move it away, or choose another --out")


def check_not_read(out: Path, read: Iterable[Path]) -> None:
    """Refuse a place where a result would replace a file that the case, or its model, consists of."""
    places = [out / name for name in (REPORT, MODEL, PAGE)]
    for file in read:
        for place in places:
            if same_file(file, place):
                raise InputError("would replace a file of the case", file=place, fix="name another for --out")
