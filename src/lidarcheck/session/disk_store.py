"""Results that took long, in the project's `.lidarcheck/cache/`, for the next start and for what memory lacks.

A project may be a stranger's, and unpacking what somebody else has packed can run anything. So each entry is sealed
with a secret of this user, outside of every project: one that this user has not written is not unpacked.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import hmac
import os
import pickle
import re
import secrets
from pathlib import Path
from typing import Any

import lidarcheck
from lidarcheck.errors import InputError
from lidarcheck.session.node import Derived
from lidarcheck.session.own_files import make_own_directory, own_place_in

__all__ = ["CACHE_BYTES", "WORTH_S", "DiskStore"]

CACHE_BYTES = 500_000_000
"""All entries together; those that were not read for longest go first."""
WORTH_S = 1.0
"""What took less is sooner computed again than looked for."""
_LARGEST = 0.25
"""Of all that may be kept, for one entry."""
_MAGIC = b"lidarcheck result 1\n"
_SEAL_BYTES = 32
_NAME = re.compile(r"[0-9a-f]{64}\.result")
_SHOWS = ("figures", "session", "tui")
"""Packages that a key does not cover, and whose classes may be in an entry."""


class DiskStore:
    """The entries of a project; for any thread and several processes. `fault`: why nothing is kept, empty if it is."""

    def __init__(self, root: Path, most: int = CACHE_BYTES) -> None:
        self.root, self.most = root, most
        self.fault = ""
        self._secret: bytes | None = None

    def get(self, key: str) -> Derived | None:
        """What is kept under a key; an entry that is damaged, or that somebody else has sealed, is removed."""
        secret, path = self._own_secret(), self._path(key)
        if secret is None or path is None:
            return None
        try:
            packed = path.read_bytes()
        except OSError:
            return None
        found = _unpacked(packed, path.name, secret)
        with contextlib.suppress(OSError):
            if found is None:
                path.unlink()
            else:
                os.utime(path)  # it was used now
        return found

    def put(self, derived: Derived) -> None:
        """Keep a result that took long enough; where that cannot be, `fault` says why."""
        secret, path = self._own_secret(), self._path(derived.key)
        if derived.seconds <= WORTH_S or secret is None or path is None:
            return
        try:
            packed = _packed(derived, path.name, secret)
        except Exception:  # noqa: BLE001 - a value that cannot be packed is kept in memory alone
            return
        if len(packed) > _LARGEST * self.most:
            return
        from lidarcheck.formats.atomic import write_bytes

        try:
            make_own_directory(self.root, "cache")
            write_bytes(path, packed)
            self.fault = ""
        except InputError as error:
            self.fault = "; ".join(error.lines()).removeprefix("error: ")
        self._make_room()

    def _path(self, key: str) -> Path | None:
        """Where the entry of a key lies. A newer lidarcheck may show results otherwise, and looks elsewhere."""
        name = hashlib.sha256(f"{key} {_source_of_shown()}".encode()).hexdigest()
        try:
            return own_place_in(self.root, "cache", f"{name}.result")
        except InputError as error:
            self.fault = "; ".join(error.lines()).removeprefix("error: ")
            return None

    def _make_room(self) -> None:
        """Remove what was not read for longest; another process may do so at the same time."""
        found: list[tuple[float, int, Path]] = []
        with contextlib.suppress(OSError, InputError):
            for path in own_place_in(self.root, "cache", "").iterdir():
                if _NAME.fullmatch(path.name):
                    stat = path.stat()
                    found.append((stat.st_mtime, stat.st_size, path))
        total = sum(size for _, size, _ in found)
        for _, size, path in sorted(found):
            if total <= self.most:
                break
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size

    def _own_secret(self) -> bytes | None:
        if self._secret is None:
            try:
                self._secret = _secret_of_user()
            except (OSError, RuntimeError) as error:  # RuntimeError: there is no home directory
                self.fault = str(error)
        return self._secret


def _packed(derived: Derived, name: str, secret: bytes) -> bytes:
    payload = pickle.dumps((derived.key, derived.value, derived.files, derived.seconds, derived.when))
    return _MAGIC + _seal(payload, name, secret) + payload


def _unpacked(packed: bytes, name: str, secret: bytes) -> Derived | None:
    start = len(_MAGIC) + _SEAL_BYTES
    seal, payload = packed[len(_MAGIC) : start], packed[start:]
    if not packed.startswith(_MAGIC) or not hmac.compare_digest(seal, _seal(payload, name, secret)):
        return None
    try:
        key, value, files, seconds, when = pickle.loads(payload)  # sealed by this user
    except Exception:  # noqa: BLE001 - of classes that are no longer there
        return None
    return Derived(value, key, files, 0, seconds, when)


def _seal(payload: bytes, name: str, secret: bytes) -> bytes:
    return hmac.digest(secret, name.encode() + payload, "sha256")


@functools.cache
def _source_of_shown() -> str:
    """SHA-256 over the source of the packages in `_SHOWS`."""
    root, digest = Path(lidarcheck.__file__).resolve().parent, hashlib.sha256()
    for path in sorted(path for package in _SHOWS for path in (root / package).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _secret_of_user() -> bytes:
    """The secret, made at the first call on a machine; `OSError` where it cannot be kept, or others could read it."""
    from lidarcheck.jit import base_directory

    path = base_directory() / f"results-{os.getuid()}.secret"
    try:
        return _read_secret(path)
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    descriptor = os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    try:
        os.write(descriptor, secrets.token_bytes(_SEAL_BYTES))
        os.fsync(descriptor)
        with contextlib.suppress(FileExistsError):
            os.link(new, path)  # whole, or that of another process
    finally:
        os.close(descriptor)
        new.unlink()
    return _read_secret(path)


def _read_secret(path: Path) -> bytes:
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        stat: Any = os.fstat(descriptor)
        if stat.st_uid != os.getuid() or stat.st_mode & 0o077:
            raise PermissionError(f"{path} can be read by others; remove it")
        content = os.read(descriptor, _SEAL_BYTES + 1)
    finally:
        os.close(descriptor)
    if len(content) != _SEAL_BYTES:
        raise OSError(f"{path} is damaged; remove it")
    return content
