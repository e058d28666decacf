"""Opening somebody else's file: what can go wrong before its content matters."""

from __future__ import annotations

import os
from pathlib import Path

from lidarcheck.errors import InputError

__all__ = ["check_file", "first_bytes", "read_source"]


def check_file(path: str | os.PathLike[str]) -> Path:
    """The path, once it is known to be a file that has content; `InputError` otherwise."""
    file = Path(path)
    try:
        size = file.stat().st_size
        if file.is_dir():
            raise InputError("is a directory, not a file", file=file, fix="name a file in it")
        if not file.is_file():
            raise InputError("is not a regular file", file=file, fix="copy its content into a file first")
    except (OSError, ValueError) as error:
        raise _unreadable(file, error) from error
    if size == 0:
        raise InputError("the file is empty", file=file, fix="was it written completely?")
    return file


def read_source(path: str | os.PathLike[str]) -> bytes:
    """The whole content of a file that has some; `InputError` when it cannot be read."""
    file = check_file(path)
    try:
        return file.read_bytes()
    except OSError as error:
        raise _unreadable(file, error) from error


def first_bytes(path: str | os.PathLike[str], count: int = 65536) -> bytes:
    """The beginning of a file that has content; `InputError` when it cannot be read."""
    file = check_file(path)
    try:
        with file.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise _unreadable(file, error) from error


def _unreadable(file: Path, error: OSError | ValueError) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError("there is no such file", file=file, fix="check the name and the directory")
    if isinstance(error, PermissionError):
        return InputError("the file may not be read", file=file, fix="check its permissions")
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return InputError(f"cannot be read: {reason}", file=file)
