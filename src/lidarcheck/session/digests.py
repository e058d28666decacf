"""What files hold, as SHA-256, which is computed again only where a file may have changed."""

from __future__ import annotations

import hashlib
import os
import threading
import time
from pathlib import Path
from typing import NamedTuple

__all__ = ["GONE", "UNKNOWN", "Digests"]

GONE, UNKNOWN = "gone", "unknown"
"""In the place of a digest: no such file, or none that can be read; a large file that changed and is not read yet."""
_AT_ONCE_BYTES = 4_000_000
"""Up to this size a file is read where somebody waits for it: some milliseconds."""
_SETTLED_NS = 2_000_000_000
"""A file that was written later than so long before it was read may be written again without another time: file
systems count in steps of up to 2 s. Its digest is not believed for long."""


class _Stat(NamedTuple):
    size: int
    written_ns: int
    changed_ns: int
    number: int


class _Known(NamedTuple):
    stat: _Stat | None
    digest: str
    settled: bool


class Digests:
    """The digests of files, by path; for any thread."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}
        self._told: dict[str, str] = {}
        self._lock = threading.Lock()

    def of(self, path: str | os.PathLike[str], *, wait: bool = True) -> str:
        """The digest of what a file holds now, or `GONE`; without `wait` `UNKNOWN` for a large one that changed."""
        name, stat = os.fspath(path), _stat(path)
        known = self._known.get(name)
        if known is not None and known.stat == stat and known.settled:
            return known.digest
        if stat is not None and stat.size > _AT_ONCE_BYTES and not wait:
            return UNKNOWN if known is None or known.stat != stat else known.digest
        settled = stat is None or time.time_ns() - max(stat.written_ns, stat.changed_ns) > _SETTLED_NS
        digest = GONE if stat is None else _digest(Path(path))
        with self._lock:
            # What was written while it was read has another state now, and is read again.
            self._known[name] = _Known(stat, digest, settled)
            self._told.setdefault(name, digest)
        return digest

    def changed(self) -> list[str]:
        """The files known here that hold something else than at the last call, or than when they became known."""
        found = []
        for name in list(self._known):
            digest = self.of(name)
            if self._told[name] != digest:
                self._told[name] = digest
                found.append(name)
        return found


def _stat(path: str | os.PathLike[str]) -> _Stat | None:
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return None
    return _Stat(found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)


def _digest(path: Path) -> str:
    try:
        if not path.is_file():
            return GONE
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return GONE
