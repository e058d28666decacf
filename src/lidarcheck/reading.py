"""What a computation reads, and edits that are not saved in the place of what is on the disk.

Every reader of this package opens somebody's file through `source`, which asks here: inside of `reading` each file is
noted, and one that is being edited has the content that it is shown with.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.errors import InputError

__all__ = ["Reading", "apart", "note", "read_so_far", "reading", "shown_content", "state_of_file"]


@dataclass
class Reading:
    """`edited`: contents by real path; `files`: the real paths that were opened, with size and time then, None for what
    was not there; `taken`: those of `edited` that were read so.
    """

    edited: Mapping[str, bytes] = field(default_factory=dict)
    files: dict[str, tuple[int, int] | None] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)


_NOW: ContextVar[Reading | None] = ContextVar("reading", default=None)


@contextlib.contextmanager
def reading(edited: Mapping[str, bytes] | None = None) -> Iterator[Reading]:
    """Note what this thread reads while the block runs, and read `edited` instead of those files.

    Blocks nest: what the inner one reads is noted by the outer one too.
    """
    outer = _NOW.get()
    inner = Reading(edited if edited is not None else outer.edited if outer else {})
    before = _NOW.set(inner)
    try:
        yield inner
    finally:
        _NOW.reset(before)
        if outer is not None:
            outer.files = inner.files | outer.files
            outer.taken |= inner.taken


@contextlib.contextmanager
def apart() -> Iterator[None]:
    """What is read while the block runs is not noted: it counts by what was made of it, not by its bytes."""
    outer = _NOW.get()
    before = _NOW.set(Reading(outer.edited if outer else {}))
    try:
        yield
    finally:
        _NOW.reset(before)


def read_so_far() -> Reading | None:
    """What was read in the innermost block; None outside of one."""
    return _NOW.get()


def state_of_file(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    """Size and time of a file, which differ when it is written again; None where there is none."""
    try:
        stat = Path(path).stat()
    except (OSError, ValueError):
        return None
    return stat.st_size, stat.st_mtime_ns


def _noted(now: Reading, path: str | os.PathLike[str]) -> str:
    real = os.path.realpath(path)
    if real not in now.files:
        now.files[real] = state_of_file(real)
    return real


def shown_content(path: str | os.PathLike[str]) -> bytes | None:
    """The content that a file is shown with, where it is being edited; None where the disk has it."""
    now = _NOW.get()
    if now is None:
        return None
    real = _noted(now, path)
    if real in now.edited:
        now.taken.add(real)
    return now.edited.get(real)


def note(path: str | os.PathLike[str]) -> None:
    """A file is about to be read from the disk; `InputError` where it is shown with edits that are not there."""
    now = _NOW.get()
    if now is None:
        return
    real = _noted(now, path)
    if real in now.edited:
        raise InputError("has edits that are not saved, and is read from the disk", file=path, fix="save it first")
