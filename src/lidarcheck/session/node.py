"""What can be computed from the inputs of a session, and what became of it."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.errors import LidarcheckError, NotThereError
from lidarcheck.session.canonical import key_of
from lidarcheck.session.inputs import Inputs

__all__ = ["NONE", "Cancelled", "Derived", "Entry", "Node", "Part", "ProgressCallback", "function_of", "words_of"]

Entry = str
"""A function as "package.module:function"; it is called with its arguments and `progress`, a `ProgressCallback`."""

ProgressCallback = Callable[[int, int, str], object]
"""Gets (done, of, what now); raises `Cancelled` when nobody waits any more."""


class Cancelled(Exception):
    """Somebody has stopped the work."""


def function_of(entry: Entry) -> Any:
    """The function of an entry."""
    module, _, name = entry.partition(":")
    return getattr(importlib.import_module(module), name)


NONE = "none: "
"""Before why there is nothing to compute, in the place of what has failed."""


def words_of(error: Exception) -> str:
    """Why there is no value."""
    if not isinstance(error, LidarcheckError):
        return f"internal error, {type(error).__name__}: {error}"
    words = "; ".join(error.lines()).removeprefix("error: ")
    return f"{NONE}{words}" if isinstance(error, NotThereError) else words


@dataclass(frozen=True)
class Part:
    """The part of the inputs that a node needs: digests of files by path, and all else."""

    files: tuple[tuple[str, str], ...] = ()
    choices: Any = None


@dataclass(frozen=True)
class Node:
    """Something that is computed from inputs.

    `name`, `version`: of the function; another version gives other results. `about`: which of several it is, as the
    measurement's name and the choices; what was computed last of it is shown until there is something newer. `files`:
    what it reads; the tables that a model among them names count by themselves. `choices`: all else that it depends
    on. `compute` gets a progress callback and gives the value; it reads files through `lidarcheck.formats`. One that a
    worker process can compute has an `entry` and `arguments` in its place, which it depends on too.

    `command`: what a user would type for the same; `facts`: what else there is to say of it, by name.
    """

    name: str
    version: int
    about: Hashable
    files: tuple[Path, ...]
    compute: Callable[[ProgressCallback], Any] | None = field(default=None, compare=False)
    choices: Any = None
    entry: Entry = ""
    arguments: tuple[Any, ...] = ()
    command: str = field(default="", compare=False)
    facts: tuple[tuple[str, str], ...] = field(default=(), compare=False)

    def made(self, on_progress: ProgressCallback) -> Any:
        """Compute its value here."""
        if self.compute is not None:
            return self.compute(on_progress)
        return function_of(self.entry)(*self.arguments, progress=on_progress)

    def needs(self, inputs: Inputs, *, wait: bool = True) -> Part:
        """Its part of the inputs; `wait` as for `Digests.of`."""
        choices = (self.choices, self.entry, self.arguments) if self.entry else self.choices
        return Part(inputs.digests(inputs.with_named(self.files), wait=wait), choices)

    def key(self, inputs: Inputs, *, wait: bool = True) -> str:
        """What a value is kept by: two computations with the same key give the same."""
        return self.key_of(self.needs(inputs, wait=wait))

    def key_of(self, part: Part) -> str:
        """The key of a value that is computed from such a part."""
        files = [(os.path.realpath(path), digest) for path, digest in part.files]
        return key_of(self.name, self.version, [files, part.choices])

    @property
    def identity(self) -> Hashable:
        """What it is, whatever the inputs hold."""
        return self.name, self.about


@dataclass(frozen=True)
class Derived:
    """A value with what it was computed from.

    `files`: the digests of all that its node named or its computation opened, by real path; `edit`: the number of the
    session's last edit then; `seconds`: how long it took; `when`: seconds since the epoch;
    `first`: it was the first of its kind in this process.
    """

    value: Any
    key: str
    files: dict[str, str]
    edit: int
    seconds: float
    when: float
    first: bool = False
