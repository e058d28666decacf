"""Where a command writes: checked before the work starts, written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lidarcheck.cli.terminal import emit
from lidarcheck.errors import InputError

__all__ = ["check_writable", "json_text", "write_result"]

STANDARD_OUTPUT = "-"


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
