"""The three files of an explanation: a place that is checked before the work, and written all or none."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.explain.places import MODEL, PAGE, REPORT

__all__ = ["MODEL", "PAGE", "REPORT", "check_directory", "check_not_read", "make_directory", "write_together"]


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
    if not os.access(where, os.W_OK | os.X_OK):
        raise InputError("cannot be written", file=out, fix="check its permissions, or choose another place")
    for name in (REPORT, MODEL, PAGE):
        place = out / name
        if place.is_dir() or (place.exists() and not os.access(place, os.W_OK)):
            raise InputError("cannot be replaced", file=place, fix="move it away, or choose another --out")


def check_not_read(out: Path, read: Iterable[Path]) -> None:
    """Refuse a place where a result would replace a file that the case, or its model, consists of."""
    places = {os.path.realpath(out / name): out / name for name in (REPORT, MODEL, PAGE)}
    for file in read:
        if os.path.realpath(file) in places:
            raise InputError(
                "would replace a file of the case", file=places[os.path.realpath(file)], fix="name another for --out"
            )


def make_directory(out: Path) -> None:
    """The directory is there afterwards, and files can be made in it."""
    probe = out / f".{secrets.token_hex(8)}.part"
    try:
        out.mkdir(exist_ok=True)
        probe.write_bytes(b"x")
    except OSError as error:
        raise InputError(
            f"cannot be written: {error.strerror or error}", file=out, fix="choose another place"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def write_together(out: Path, writers: Mapping[str, Callable[[Path], object]]) -> None:
    """Each writer gets a path to write beside its file's own; only when all have succeeded do they take their places.

    The last writer gets the file's own path, and must replace that at once or not at all. On any error or interrupt
    all files are as they were.
    """
    *first, last = writers
    old = (out / last).read_bytes() if (out / last).is_file() else None
    beside = {name: out / f".{name}.{secrets.token_hex(8)}.part" for name in first}
    written = False
    try:
        for name in first:
            writers[name](beside[name])
        writers[last](out / last)
        written = True
        for name in first:
            beside[name].replace(out / name)
    except BaseException as error:
        if written:
            _put_back(out / last, old)
        if isinstance(error, OSError):
            what = f"cannot write: {error.strerror or error}"
            raise InputError(what, file=out, fix="nothing was changed; make room or choose another place") from error
        raise
    finally:
        for path in beside.values():
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)


def _put_back(file: Path, content: bytes | None) -> None:
    with contextlib.suppress(OSError):
        if content is None:
            file.unlink(missing_ok=True)
        else:
            file.write_bytes(content)
