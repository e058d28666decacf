"""Where the interface keeps what is its own: below the project's `.lidarcheck/`, out of version control."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.trust.places import own_place

__all__ = ["content_hash", "file_key", "make_own_directory", "own_directory", "own_file", "own_place_in"]

_NEEDED = {"tui": "what is edited would not survive a crash", "cache": "results are not there at the next start"}


def own_directory(root: Path, name: str = "tui") -> Path:
    """`.lidarcheck/tui/` of a project, or another there, whether it is there or not."""
    return root / ".lidarcheck" / name


def own_place_in(root: Path, name: str, file: str) -> Path:
    """A path in such a directory; `InputError` where a link is in the way."""
    return own_place(own_directory(root, name) / file, root)


def make_own_directory(root: Path, name: str = "tui") -> Path:
    """The same, made if need be; `InputError` where that cannot be."""
    directory = own_directory(root, name)
    try:
        for made in (directory.parent, directory):  # and not the project's own, where somebody has removed it
            own_place(made, root).mkdir(exist_ok=True)
    except OSError as error:
        fix = f"{_NEEDED[name]}: make the project's directory writable"
        raise InputError(f"cannot make the directory: {error.strerror}", file=directory, fix=fix) from error
    ignore = own_place(directory.parent / ".gitignore", root)
    if not ignore.exists():
        from lidarcheck.formats.atomic import write_text

        write_text(ignore, "*\n")
    return directory


def own_file(root: Path, name: str) -> Path:
    """A file in that directory, made if need be, to write to; `InputError` where that cannot be, or a link is there."""
    return own_place(make_own_directory(root) / name, root)


def file_key(path: Path) -> str:
    """A short name for a file, the same however its path was spelled."""
    real = os.path.realpath(path)
    stem = "".join(letter if letter.isprintable() else "_" for letter in path.stem[:24])
    return f"{stem}-{hashlib.sha256(os.fsencode(real)).hexdigest()[:12]}"


def content_hash(content: bytes) -> str:
    """A content's SHA-256, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()
