"""One editor a file: a lock that the system drops when its holder dies, however it dies."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
from pathlib import Path

__all__ = ["FileLock"]


class FileLock:
    """An advisory lock on a lock file, which stays in place: removing it would let two have it at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor: int | None = None

    @property
    def held(self) -> bool:
        """Whether this instance has the lock."""
        return self._descriptor is not None

    def take(self) -> bool:
        """Take the lock if nobody has it; whether this instance has it now. `OSError` where files cannot be locked."""
        if self._descriptor is not None:
            return True
        descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return False
        except OSError:
            os.close(descriptor)
            raise
        self._descriptor = descriptor
        # It is ours from here on. Who has it is a courtesy, for which a full disk may have no room.
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode(), 0)
        return True

    def holder(self) -> str:
        """Who has the lock, in words."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            holder = json.loads(self.path.read_text(encoding="utf-8"))
            return f"process {int(holder['pid'])} on {str(holder['host'])[:64]}"
        return "another process"

    def drop(self) -> None:
        """Give the lock back."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
