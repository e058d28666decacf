"""Where results are written: checked before the work starts, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import is_read_only
from lidarcheck.printable import printable_json

__all__ = [
    "STANDARD_OUTPUT",
    "check_writable",
    "json_text",
    "make_directory",
    "same_file",
    "write_file",
]

STANDARD_OUTPUT = "-"


def check_writable(
    path: str | Path, *, option: str, besides: Iterable[str | Path | None] = (), settings: bool = False
) -> None:
    """Refuse now, with an `InputError`, what could not be written after minutes of work; `option` asked for it.

    `besides`: the command's other files, which the output must not replace; None for one that was not given.
    `settings`: whether the output is TOML itself.
    """
    if str(path) == STANDARD_OUTPUT:
        return
    target = Path(path)
    if target.is_dir():
        raise InputError("is a directory", file=target, fix=f"name a file for {option}")
    if target.exists() and not target.is_char_device() and is_read_only(target):
        raise InputError(
            "cannot be written: it is read-only",
            file=target,
            fix="make it writable (chmod u+w), or choose another file",
        )
    parent = Path(os.path.realpath(target)).parent
    if not parent.is_dir():
        raise InputError("its directory does not exist", file=target, fix=f"make {parent} first")
    if not target.exists() and is_read_only(parent):
        raise InputError("its directory cannot be written", file=target, fix="choose another place")
    others = [other for other in besides if other is not None and str(other) != STANDARD_OUTPUT]
    if not target.is_char_device() and any(same_file(target, other) for other in others):
        raise InputError("would replace another file of this command", file=target, fix=f"name another for {option}")
    if target.suffix.lower() == ".toml" and not settings:
        # Scenarios, goldens and models, found by name, are not among the arguments; a report never is TOML.
        raise InputError("is the name of a scenario, golden or model", file=target, fix=f"name another for {option}")


def same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two paths name one file: the same place, through links or not, or two names of one file."""
    try:
        return os.path.realpath(one) == os.path.realpath(other) or Path(one).samefile(other)
    except OSError:
        return False


def write_file(path: str | Path, text: str) -> None:
    """Write text to a file, at once; a device or pipe is written as it is."""
    from lidarcheck.formats.atomic import write_text

    target = Path(path)
    if target.exists() and not target.is_file():
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

    return printable_json(json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False)) + "\n"


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
