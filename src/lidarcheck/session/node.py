"""What can be computed from the inputs of a session, and what became of it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.session.canonical import key_of
from lidarcheck.session.inputs import Inputs

__all__ = ["Cancelled", "Derived", "Node", "Part", "ProgressCallback"]

ProgressCallback = Callable[[int, int, str], object]
"""Gets (done, of, what now); raises `Cancelled` when nobody waits any more."""


class Cancelled(Exception):
    """Somebody has stopped the work."""


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
    on. `compute` gets a progress callback and gives the value; it reads files through `lidarcheck.formats`.
    """

    name: str
    version: int
    about: Hashable
    files: tuple[Path, ...]
    compute: Callable[[ProgressCallback], Any] = field(compare=False)
    choices: Any = None

    def needs(self, inputs: Inputs, *, wait: bool = True) -> Part:
        """Its part of the inputs; `wait` as for `Digests.of`."""
        return Part(inputs.digests(inputs.with_named(self.files), wait=wait), self.choices)

    def key(self, inputs: Inputs, *, wait: bool = True) -> str:
        """What a value is kept by: two computations with the same key give the same."""
        return self.key_of(self.needs(inputs, wait=wait))

    def key_of(self, part: Part) -> str:
        """The key of a value that is computed from such a part."""
        return key_of(self.name, self.version, part)

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
