"""Where a command writes: checked before the work starts, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from lidarcheck.cli.terminal import emit
from lidarcheck.errors import InputError, UsageError

__all__ = ["alone", "as_it_was", "check_twice", "check_writable", "json_text", "write_result"]

STANDARD_OUTPUT = "-"


def check_twice(files: Iterable[Path]) -> None:
    """Refuse a file that is named twice: it would count as two measurements."""
    seen: set[str] = set()
    for file in files:
        place = os.path.realpath(file)
        if place in seen:
            raise UsageError(f"{file} is named twice", fix="name each file once")
        seen.add(place)


def check_writable(path: str | Path, *, option: str, besides: Iterable[str | Path | None] = ()) -> None:
    """Refuse now, with an `InputError`, what could not be written after minutes of work; `option` asked for it.

    `besides`: the command's other files, which the output must not replace; None for one that was not given.
    """
    if str(path) == STANDARD_OUTPUT:
        return
    target = Path(path)
    if target.is_dir():
        raise InputError("is a directory", file=target, fix=f"name a file for {option}")
    if target.exists() and not os.access(target, os.W_OK):
        raise InputError("cannot be written", file=target, fix="check its permissions, or choose another file")
    parent = Path(os.path.realpath(target)).parent
    if not parent.is_dir():
        raise InputError("its directory does not exist", file=target, fix=f"make {parent} first")
    if not target.exists() and not os.access(parent, os.W_OK):
        raise InputError("its directory cannot be written", file=target, fix="choose another place")
    places = (os.path.realpath(other) for other in besides if other is not None and str(other) != STANDARD_OUTPUT)
    if os.path.realpath(target) in places and not target.is_char_device():
        raise InputError("would replace another file of this command", file=target, fix=f"name another for {option}")
    if target.suffix.lower() == ".toml":
        # Scenarios, goldens and models, found by name, are not among the arguments; a report never is TOML.
        raise InputError("is the name of a scenario, golden or model", file=target, fix=f"name another for {option}")


@contextlib.contextmanager
def as_it_was(files: Iterable[Path]) -> Iterator[None]:
    """The files are as they were when the block fails or is interrupted."""
    old = {file: file.read_bytes() if file.is_file() else None for file in files}
    try:
        yield
    except BaseException:
        for file, content in old.items():
            with contextlib.suppress(OSError):
                if content is None:
                    file.unlink(missing_ok=True)
                else:
                    file.write_bytes(content)
        raise


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


def write_result(path: str | Path, text: str) -> None:
    """Write text to a file, at once; `-` is standard output, and a device or pipe is written as it is."""
    from lidarcheck.formats.atomic import write_text

    target = Path(path)
    if str(path) == STANDARD_OUTPUT:
        emit(text)
    elif target.exists() and not target.is_file():
        # Renaming a file over /dev/null would take it from everyone.
        try:
            target.write_text(text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write: {error.strerror or error}", file=path) from error
    else:
        write_text(target, text)


def json_text(value: Any) -> str:
    """JSON for machines: dataclasses and numpy values as plain ones; what is not finite is null."""
    from lidarcheck.formats.plain import plain

    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
