"""What something was computed from, as it is written beside it, and whether that is still what is there."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.reading import read_so_far, state_of_file
from lidarcheck.session.canonical import code_identity, key_of
from lidarcheck.session.digests import GONE, Digests
from lidarcheck.session.node import Derived

__all__ = ["COMPUTED_FROM", "changed_since", "origin", "origin_of"]

COMPUTED_FROM = "computed_from"
"""The key of it in a result."""
_SHOWN = {"--quiet", "--no-quiet", "--no-html", "--trust"}
_PLACES = {"--json", "--out", "--html", "--junit", "--plot", "--jobs", "--scheduler", "--into", "--root"}
"""Options that say where results go and how they are made or shown, the second kind with a value."""


def origin(asked: Sequence[str], files: Iterable[Path] = ()) -> dict[str, Any] | None:
    """The content hash of all that this command has read, with what it was asked for, its options, and the code.

    `files`: what was read elsewhere, as by a worker. None where nothing notes what is read. `InputError` where a file
    is not what it was when it was read.
    """
    read = read_so_far()
    if read is None:
        return None
    disk, found = Digests(), {}
    for name in sorted({*read.files, *map(os.path.realpath, files)}):
        then = read.files.get(name)
        if then is not None and state_of_file(name) not in (then, None):
            raise InputError("was changed while the command ran", file=name, fix="run the command again")
        digest = disk.of(name)
        if digest != GONE:
            found[name] = digest
    words = _asked(asked)
    key = key_of("command", 1, [[found.get(os.path.realpath(word), word) for word in words], sorted(found.values())])
    listed = {_short(name): digest for name, digest in found.items()}
    return {"key": key, "asked": words, "files": listed, "code": code_identity()}


def origin_of(derived: Derived | None) -> dict[str, Any]:
    """The same of a result of a session; files with edits that were not saved have the hash of what was shown."""
    if derived is None:
        return {}
    files = {_short(name): digest for name, digest in derived.files.items()}
    return {"key": derived.key, "files": files, "code": code_identity()}


def changed_since(record: Any, places: Sequence[Path] = ()) -> list[str]:
    """Which files of such a record hold something else now, by their names there, and `lidarcheck` for its source.

    Names are relative to where the command ran: they are looked for in `places`, first here. A file that is nowhere
    has changed too.
    """
    if not isinstance(record, Mapping) or not isinstance(record.get("files"), Mapping):
        return []
    disk, changed = Digests(), []
    for name, digest in record["files"].items():
        if not any(disk.of(place / str(name)) == digest for place in (Path(), *places)):
            changed.append(str(name))
    code = record.get("code")
    if isinstance(code, Mapping) and code.get("source") != code_identity()["source"]:
        changed.append("lidarcheck")
    return changed


def _asked(arguments: Sequence[str]) -> list[str]:
    """The command and its options but for those that change no number."""
    words: list[str] = []
    skips = False
    for word in arguments:
        name, equals, _ = word.partition("=")
        if skips:
            skips = False
        elif name in _PLACES:
            skips = not equals
        elif name not in _SHOWN:
            words.append(word)
    return words


def _short(name: str) -> str:
    """A path as seen from here, where it is below; else as it is."""
    here = os.path.relpath(name, os.path.realpath(os.curdir))
    return name if here.startswith(os.pardir) else Path(here).as_posix()
