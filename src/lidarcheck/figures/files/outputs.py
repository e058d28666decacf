"""Where results are written: checked before the work starts, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError

__all__ = [
    "STANDARD_OUTPUT",
    "as_it_was",
    "check_writable",
    "json_text",
    "make_directory",
    "write_file",
    "write_together",
]

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

    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


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


@contextlib.contextmanager
def as_it_was(files: Iterable[Path]) -> Iterator[None]:
    """The files are as they were when the block fails or is interrupted."""
    old = {file: file.read_bytes() if file.is_file() else None for file in files}
    try:
        yield
    except BaseException:
        for file, content in old.items():
            _put_back(file, content)
        raise


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
