"""What the user permits on the command line, beyond what a project brings: programs that run, folders that are read.

One thing a process, for all of its threads. Workers of a pool begin with that of the process that started them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Permissions", "given", "grant", "granted"]


@dataclass(frozen=True, slots=True)
class Permissions:
    """`trust`: any program that a model names may run; `roots`: folders whose files any file may name, absolute."""

    trust: bool = False
    roots: tuple[Path, ...] = ()


_given = Permissions()


def given() -> Permissions:
    """What was permitted in this process."""
    return _given


def grant(permissions: Permissions) -> None:
    """Permit this from now on, and nothing else."""
    global _given
    _given = permissions


@contextlib.contextmanager
def granted(permissions: Permissions) -> Iterator[None]:
    """Permit this, and nothing else, while the block runs."""
    before = given()
    grant(permissions)
    try:
        yield
    finally:
        grant(before)
