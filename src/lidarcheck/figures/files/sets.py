"""Results of several files: written whole or not at all.

All are made in a directory beside the one they go to, under the names that they will have, so that one may name another
from where it stands. A new directory then takes its place at once. In one that is there the files are exchanged one by
one, signals waiting meanwhile; on an error those that were there are put back, and after a kill in the midst by the
next run. Where nothing can be made beside it, as in a mounted directory, each is written in its place instead.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import is_read_only, left_behind, part_beside

__all__ = ["Folder", "Writer", "as_it_was", "signals_later", "write_set"]

Writer = Callable[[Path], object]
_BEFORE = ".before"
"""In the staging directory: what was where the new files went."""


class Folder(NamedTuple):
    """A directory of results: `fill` puts its files into an empty one, `old` matches the names of an earlier run's."""

    fill: Writer
    old: re.Pattern[str]


def write_set(out: Path, files: Mapping[str, Writer], folders: Mapping[str, Folder] | None = None) -> None:
    """Write all files and folders into the directory `out`, or none: on any error or interrupt all is as it was.

    Each writer gets the path to write, in a directory beside `out` that has its place among the others, and may read
    what those before it wrote. Files of other names in `out` stay. `InputError` names files by where they were to go.
    """
    place = Path(os.path.realpath(out))
    recover(place)
    if not _has_room_beside(place):
        _write_in_place(out, files, folders or {})
        return
    staging = part_beside(place)
    try:
        with _named_as_placed(staging, out):
            staging.mkdir()
            for name, write in files.items():
                write(staging / name)
            for name, folder in (folders or {}).items():
                (staging / name).mkdir()
                folder.fill(staging / name)
                with contextlib.suppress(OSError):  # it is not empty where there is something in it
                    (staging / name).rmdir()
            old = [path for name, folder in (folders or {}).items() for path in _earlier(place / name, folder.old)]
            with signals_later():
                _exchange(staging, place, old)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _has_room_beside(place: Path) -> bool:
    """Whether a directory beside this one can take its place, or what is in it."""
    if not os.access(place.parent, os.W_OK | os.X_OK):
        return False
    return not place.exists() or place.stat().st_dev == place.parent.stat().st_dev


def _write_in_place(out: Path, files: Mapping[str, Writer], folders: Mapping[str, Folder]) -> None:
    with as_it_was([out / name for name in files]):
        for name, write in files.items():
            write(out / name)
        for name, folder in folders.items():
            (out / name).mkdir(exist_ok=True)
            with tempfile.TemporaryDirectory(dir=out, prefix=".", suffix=".part") as new:
                folder.fill(Path(new))
                for path in _earlier(out / name, folder.old):
                    path.unlink()
                for path in Path(new).iterdir():
                    path.replace(out / name / path.name)


@contextlib.contextmanager
def _named_as_placed(staging: Path, out: Path) -> Iterator[None]:
    """Errors name the place that a file was to take, not where it was made."""
    try:
        yield
    except InputError as error:
        if error.file is None or staging not in Path(error.file).parents:
            raise
        file = out / Path(error.file).relative_to(staging)
        raise type(error)(error.what, file=file, line=error.line, fix=error.fix) from error
    except OSError as error:
        what = f"cannot write: {error.strerror or error}"
        raise InputError(what, file=out, fix="nothing was changed; make room or choose another place") from error


def _earlier(folder: Path, old: re.Pattern[str]) -> list[Path]:
    return [path for path in folder.iterdir() if old.fullmatch(path.name)] if folder.is_dir() else []


@contextlib.contextmanager
def as_it_was(files: Iterable[Path]) -> Iterator[None]:
    """The files are as they were when the block, which replaces them at once or not at all, fails or is interrupted."""
    kept: dict[Path, Path | None] = {}
    try:
        for file in files:
            kept[file] = _second_name(file) if file.is_file() else None
        yield
    except BaseException:
        with signals_later():
            for file, name in kept.items():
                with contextlib.suppress(OSError):
                    if name is None:
                        file.unlink(missing_ok=True)
                    else:
                        name.replace(os.path.realpath(file))
        raise
    finally:
        for name in kept.values():
            if name is not None:
                name.unlink(missing_ok=True)


def _second_name(file: Path) -> Path:
    """Another name for the file as it is, which takes no room on the disk where the file system has such names."""
    file = Path(os.path.realpath(file))
    name = part_beside(file)
    try:
        os.link(file, name)
    except OSError:
        shutil.copy2(file, name)
    return name


def _exchange(staging: Path, place: Path, old: list[Path]) -> None:
    """The staged files take their places, and the old ones are gone; or nothing has changed."""
    if not place.exists():
        staging.replace(place)
        return
    new = [path for path in sorted(staging.rglob("*")) if not path.is_dir()]
    targets = {path: place / path.relative_to(staging) for path in new}
    for target in targets.values():
        if is_read_only(target):
            raise InputError(
                "cannot write: it is read-only", file=target, fix="make it writable, or choose another place"
            )
    made: list[Path] = []
    try:
        for target in dict.fromkeys([*old, *targets.values()]):
            if target.exists():
                kept = staging / _BEFORE / target.relative_to(place)
                kept.parent.mkdir(parents=True, exist_ok=True)
                target.replace(kept)
        for path, target in targets.items():
            target.parent.mkdir(exist_ok=True)
            kept = staging / _BEFORE / target.relative_to(place)
            if kept.exists():
                path.chmod(kept.stat().st_mode & 0o7777)
            made.append(target)
            path.replace(target)
    except BaseException:
        for target in made:
            target.unlink(missing_ok=True)
        _put_back(staging, place)
        raise


def _put_back(staging: Path, place: Path) -> None:
    """What was in the place of the new files is there again."""
    for kept in sorted((staging / _BEFORE).rglob("*")):
        if not kept.is_dir():
            with contextlib.suppress(OSError):
                kept.replace(place / kept.relative_to(staging / _BEFORE))


def recover(place: Path) -> None:
    """Remove what a run that was killed has left beside the place, once what it had put aside is back."""
    for staging in left_behind(place):
        if staging.is_dir():
            _put_back(staging, place)
            shutil.rmtree(staging, ignore_errors=True)


@contextlib.contextmanager
def signals_later() -> Iterator[None]:
    """Interrupts and requests to end that come while the block runs are heard when it has ended."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are another thread's
        return
    heard: list[int] = []
    handlers = {one: signal.signal(one, lambda number, _: heard.append(number)) for one in _SIGNALS}
    try:
        yield
    finally:
        for one, handler in handlers.items():
            if handler is not None:
                signal.signal(one, handler)
        if heard:
            signal.raise_signal(heard[0])


_SIGNALS = (signal.SIGINT, signal.SIGTERM)
