"""Writing a file whole or not at all: temporary file, fsync, rename.

What a process leaves that is killed meanwhile bears its number, and goes when the same place is next written.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import socket
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import IO

from lidarcheck.errors import InputError

__all__ = [
    "READ_ONLY_FIX",
    "atomic_path",
    "atomic_write",
    "is_read_only",
    "left_behind",
    "part_beside",
    "write_bytes",
    "write_text",
]


READ_ONLY_FIX = "make it writable (chmod u+w), or name another file"
_FULL = (errno.ENOSPC, errno.EDQUOT)


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; when the block ends well it is synced and takes `path`'s place.

    On any error or interrupt the temporary file is removed and `path` is as it was. The file keeps the permissions it
    had; a symbolic link is followed, so the file it points at is replaced. `InputError` when it cannot be written, and
    when it is read-only: renaming could replace it, but its owner has ruled that out.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        # Renaming a file over a device such as /dev/null would take it from everyone.
        kind = "a directory" if target.is_dir() else "not a regular file"
        raise InputError(f"cannot write: it is {kind}", file=path, fix="name another file")
    if is_read_only(target):
        raise InputError("cannot write: it is read-only", file=path, fix=READ_ONLY_FIX)
    for left in left_behind(target):
        left.unlink(missing_ok=True)
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


def is_read_only(path: str | os.PathLike[str]) -> bool:
    """Whether the file or directory is there and nobody may write it; the superuser could, and must not by accident."""
    try:
        return not Path(path).stat().st_mode & 0o222 or not os.access(path, os.W_OK)
    except OSError:
        return False


def part_beside(target: Path) -> Path:
    """A new name beside the target, for what is to take its place: of this process, on this machine."""
    return target.with_name(f".{target.name[:32]}.{_home()}{os.getpid():x}-{secrets.token_hex(4)}.part")


def left_behind(target: Path) -> list[Path]:
    """What processes of this machine that have ended left beside a target."""
    name = re.compile(rf"\.{re.escape(target.name[:32])}\.{_home()}([0-9a-f]+)-[0-9a-f]{{8}}\.part")
    try:
        parts = [(path, name.fullmatch(path.name)) for path in target.parent.iterdir() if path.suffix == ".part"]
    except OSError:
        return []
    return [path for path, match in parts if match and not _is_alive(int(match[1], 16))]


@cache
def _home() -> str:
    """Where the process numbers of this process mean something: the machine, and what it calls its container."""
    try:
        space = str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        space = ""
    return hashlib.sha256(f"{socket.gethostname()} {space}".encode()).hexdigest()[:8] + "-"


def _is_alive(process: int) -> bool:
    """Whether the process has not ended; where none can be asked, it has not."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _new_beside(target: Path) -> Path:
    """An empty file of a new name, with the permissions of any new file.

    Not `tempfile`: its files are private, and to learn what others get means to change the umask of all threads.
    """
    path = part_beside(target)
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return path


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
