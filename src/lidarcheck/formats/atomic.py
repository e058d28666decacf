"""Writing a file whole or not at all: temporary file, fsync, rename."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from lidarcheck.errors import InputError

__all__ = ["atomic_path", "atomic_write", "write_bytes", "write_text"]


_FULL = (errno.ENOSPC, errno.EDQUOT)


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; when the block ends well it is synced and takes `path`'s place.

    On any error or interrupt the temporary file is removed and `path` is as it was. The file keeps the permissions it
    had; a symbolic link is followed, so the file it points at is replaced. `InputError` when it cannot be written.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        # Renaming a file over a device such as /dev/null would take it from everyone.
        kind = "a directory" if target.is_dir() else "not a regular file"
        raise InputError(f"cannot write: it is {kind}", file=path, fix="name another file")
    temporary: Path | None = None
    try:
        temporary = _new_beside(target)
        yield temporary
        if target.exists():
            temporary.chmod(target.stat().st_mode & 0o7777)
        _sync(temporary)
        temporary.replace(target)
        temporary = None
    except OSError as error:
        remedy = "free some space" if error.errno in _FULL else "choose another place"
        fix = f"nothing was changed; {remedy}"
        raise InputError(f"cannot write: {error.strerror or error}", file=path, fix=fix) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
    # The file is in its place; some file systems cannot sync a directory, and a system may not open one.
    with contextlib.suppress(OSError):
        _sync(target.parent)


@contextlib.contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """Like `atomic_path`, yielding the temporary file open for writing bytes."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        yield stream


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Replace the file's content at once."""
    with atomic_write(path) as stream:
        stream.write(content)


def write_text(path: str | os.PathLike[str], content: str) -> None:
    """Replace the file's content at once, UTF-8, newlines as given."""
    write_bytes(path, content.encode("utf-8"))


def _new_beside(target: Path) -> Path:
    """An empty file of a new name, with the permissions of any new file.

    Not `tempfile`: its files are private, and to learn what others get means to change the umask of all threads.
    """
    path = target.with_name(f".{target.name[:32]}.{secrets.token_hex(8)}.part")
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return path


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
