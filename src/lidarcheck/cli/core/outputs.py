"""Where a command writes: a file, or standard output; and files that it must not write, or read, twice."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.command import ARGUMENTS
from lidarcheck.cli.core.terminal import emit
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.files.outputs import STANDARD_OUTPUT, check_writable, json_text, same_file, write_file
from lidarcheck.figures.files.sets import as_it_was

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile

__all__ = [
    "alone",
    "as_it_was",
    "check_twice",
    "check_writable",
    "files_given",
    "json_text",
    "same_file",
    "with_origin",
    "write_result",
]


def check_twice(files: Iterable[Path | FrameFile]) -> None:
    """Refuse a file that is named twice: it would count as two measurements."""
    seen: list[Path] = []
    for file in files:
        place = Path(str(file))  # of a frame in a file of several with its number
        if any(same_file(place, other) for other in seen):
            raise UsageError(f"{file} is named twice", fix="name each file once")
        seen.append(place)


def files_given(*given: str | Path | None) -> list[Path]:
    """The files that arguments name, by themselves, by a folder or by a pattern; None for one that was not given."""
    from lidarcheck.cases.source import files_in

    return files_in(*(one for one in given if one is not None))


@contextlib.contextmanager
def alone(file: Path, content: bytes) -> Iterator[None]:
    """Nobody else edits the file while the block runs; refused where it no longer holds what was read of it."""
    with file.open("rb") as stream:
        with contextlib.suppress(ImportError, OSError):  # a system, or a file system, may have no locks
            import fcntl

            fcntl.flock(stream, fcntl.LOCK_EX)
        if file.read_bytes() != content:
            raise InputError("was changed by somebody else meanwhile", file=file, fix="run the command again")
        yield


def with_origin(document: Mapping[str, Any], files: Iterable[Path] = ()) -> dict[str, Any]:
    """A result with what it was computed from: the files that the command has read, and `files` besides."""
    from lidarcheck.session.origin import COMPUTED_FROM, origin

    found = origin(ARGUMENTS.get(), files)
    return dict(document) if found is None else {**document, COMPUTED_FROM: found}


def write_result(path: str | Path, text: str) -> None:
    """Write text to a file, at once; `-` is standard output, and a device or pipe is written as it is."""
    if str(path) == STANDARD_OUTPUT:
        emit(text)
    else:
        write_file(path, text)
