"""All that results are computed from, as it is now: files as they are shown, edits included."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.config.toml_text import toml_of
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.source import read_text
from lidarcheck.reading import reading
from lidarcheck.session.digests import Digests
from lidarcheck.session.own_files import content_hash
from lidarcheck.trust.places import is_permitted

__all__ = ["Inputs", "files_named_by"]

_NAMED: dict[tuple[str, str], tuple[Path, ...]] = {}
"""The files that models name, by path and digest of the model's file."""
_MOST_NAMED = 1000
_LONGEST_PATH = 256


@dataclass(frozen=True)
class Inputs:
    """`edited`: files with edits that are not saved, by real path, with the bytes they are shown with; all other files
    are what the disk has. `edit`: how many edits the session has seen.
    """

    edited: Mapping[str, bytes] = field(default_factory=dict)
    disk: Digests = field(default_factory=Digests, compare=False, repr=False)
    edit: int = field(default=0, compare=False)

    def digest(self, path: str | os.PathLike[str], *, wait: bool = True) -> str:
        """The SHA-256 of a file as it is shown; `wait` as for `Digests.of`."""
        shown = self.edited.get(os.path.realpath(path)) if self.edited else None
        return self.disk.of(path, wait=wait) if shown is None else content_hash(shown)

    def digests(self, paths: Iterable[Path], *, wait: bool = True) -> tuple[tuple[str, str], ...]:
        """Each file with its digest, in the order that they are given in, which a result may depend on."""
        return tuple((os.fspath(path), self.digest(path, wait=wait)) for path in paths)

    def with_named(self, paths: Iterable[Path]) -> tuple[Path, ...]:
        """The files, and those that a model or a scenario among them names: tables, an external program."""
        found: dict[Path, None] = {}
        for path in paths:
            found[path] = None
            if path.suffix.lower() == ".toml":
                found |= dict.fromkeys(self._named(path))
        return tuple(found)

    def _named(self, path: Path) -> tuple[Path, ...]:
        key = (os.path.realpath(path), self.digest(path))
        if key not in _NAMED:
            if len(_NAMED) >= _MOST_NAMED:
                _NAMED.clear()
            with reading(self.edited):
                _NAMED[key] = files_named_by(path)
        return _NAMED[key]


def files_named_by(path: Path) -> tuple[Path, ...]:
    """The files that a model's, a scenario's or a case's file names, directly or through others: a model's tables and
    external program whether they are there or not, of others those that are there. What is wrong with one of them is
    for its reader to say.
    """
    found: dict[str, None] = {}
    waiting = [path]
    while waiting:
        for name in _named_in(waiting.pop()):
            real = os.path.realpath(name)
            if real not in found and real != os.path.realpath(path):
                found[real] = None
                waiting += [Path(real)] if real.endswith(".toml") else []
    return tuple(map(Path, found))


def _named_in(path: Path) -> list[str | Path]:
    from lidarcheck.harness.goldens.provenance import external_files
    from lidarcheck.model import load_model

    with reading() as read, contextlib.suppress(LidarcheckError, OSError, ValueError):
        data = toml_of(read_text(path), path)
        if "variant" not in data and "external" not in data:
            named = (path.parent / text for text in _texts(data))
            return [file for file in named if file.is_file() and is_permitted(file, path)]
    files: list[str | Path] = []
    with reading() as read, contextlib.suppress(LidarcheckError, OSError, ValueError):
        external = load_model(path).external
        files += [] if external is None else external_files(external)
    return [*sorted(read.files), *files]


def _texts(value: object) -> Iterator[str]:
    """Every text in a file that is short enough to be a path."""
    if isinstance(value, str):
        if 0 < len(value) < _LONGEST_PATH and value.isprintable():
            yield value
    elif isinstance(value, Mapping):
        for one in value.values():
            yield from _texts(one)
    elif isinstance(value, list):
        for one in value:
            yield from _texts(one)
