"""What was done so far, on disk: an interrupted run of the gap workflow goes on where it stopped."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import shutil
import threading
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np

from lidarcheck import __version__
from lidarcheck.errors import InputError, UsageError
from lidarcheck.workers.identity import source_of_results

__all__ = ["Checkpoint", "checkpoint_key"]

_log = logging.getLogger(__name__)
_FILE, _LOCK = "notebook.jsonl", "lock"


def checkpoint_key(hashes: Mapping[str, str], model: object, seed: int, exclude: Iterable[str] = ()) -> str:
    """A key that only the same work has: the same files, model, seed, exclusions and the same source of lidarcheck."""
    parts = {
        "hashes": dict(sorted(hashes.items())),
        "model": repr(model),
        "seed": seed,
        "exclude": sorted(exclude),
        "program": f"{__version__} {source_of_results()}",
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


class Checkpoint:
    """Named values, each on disk as soon as it is put; for one run at a time.

    `path`: a directory of its own, made when it is not there. What another `key` left there is thrown away, and so is,
    with a warning, what is damaged; a last line that was cut off costs only itself. Values are what JSON holds and
    numpy arrays, which come back as lists; numbers come back as the same bits. `get` and `put` may be called from
    several threads. `UsageError` when another run works in the directory, `InputError` when it cannot be written.
    Release it with `close`, or with `discard` when all is done; as a context manager it closes itself.
    """

    def __init__(self, path: Path, key: str) -> None:
        self.path = Path(path)
        self._guard = threading.Lock()
        self._values: dict[str, str] = {}
        self._stream: IO[bytes] | None = None
        try:
            self._lock = _locked(self.path)
            try:
                self._open(key)
            except BaseException:
                os.close(self._lock)
                raise
        except OSError as error:
            raise self._unwritable(error) from error

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __len__(self) -> int:
        """How many values there are."""
        return len(self._values)

    def get(self, name: str) -> Any | None:
        """What was put under that name, each time a copy of its own; None where there is nothing."""
        with self._guard:
            text = self._values.get(name)
        return None if text is None else json.loads(text)

    def put(self, name: str, value: Any) -> Any:
        """Keep a value; returns what `get` will give, so that a run that goes on sees what the first one saw."""
        text = json.dumps(_listed(value))
        with self._guard:
            if self._stream is None:
                raise UsageError("the checkpoint is closed", fix="put values before it is closed")
            try:
                self._stream.write(_line([name, text]))
                self._stream.flush()
                os.fsync(self._stream.fileno())
            except OSError as error:
                raise self._unwritable(error) from error
            self._values[name] = text
        return json.loads(text)

    def close(self) -> None:
        """Let others work in the directory; what was put stays for the next run."""
        with self._guard:
            if self._stream is not None:
                with contextlib.suppress(OSError):  # what could not be written has been said by `put`
                    self._stream.close()
                self._stream = None
                os.close(self._lock)

    def discard(self) -> None:
        """All is done: remove the directory, then let others in."""
        with self._guard:
            shutil.rmtree(self.path, ignore_errors=True)
        self.close()

    def _open(self, key: str) -> None:
        file = self.path / _FILE
        kept = self._read(file, key)
        if kept:
            # What a cut-off line left behind is overwritten by the next one.
            self._stream = os.fdopen(_not_followed(file, os.O_RDWR), "r+b")
            self._stream.truncate(kept)
            self._stream.seek(kept)
        else:
            self._stream = os.fdopen(_not_followed(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), "wb")
            self._stream.write(_line(["key", key]))
            self._stream.flush()

    def _read(self, file: Path, key: str) -> int:
        """Take over what the file holds; returns the length of its whole lines, 0 to start afresh."""
        if not file.exists():
            return 0
        content = file.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        try:
            entries = [_entry(line) for line in whole.splitlines()]
        except ValueError:
            _log.warning("%s is damaged: what an earlier run did is done again", file)
            return 0
        if not entries or entries[0] != ("key", key):
            return 0
        self._values = dict(entries[1:])
        return len(whole)

    def _unwritable(self, error: OSError) -> InputError:
        fix = "free some space" if "space" in str(error) else "choose a place that can be written"
        return InputError(f"cannot keep what is done: {error.strerror or error}", file=self.path, fix=fix)


def _not_followed(path: Path, flags: int) -> int:
    """Open a file, and not what a link there leads to: somebody may have committed one."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def _line(entry: list[str]) -> bytes:
    text = json.dumps(entry).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _entry(line: bytes) -> tuple[str, str]:
    check, _, text = line.partition(b" ")
    if int(check, 16) != zlib.crc32(text):
        raise ValueError("checksum")
    name, value = json.loads(text)
    return str(name), str(value)


def _listed(value: Any) -> Any:
    """Plain lists, dictionaries and numbers; `TypeError` for what JSON cannot give back."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        strange = [key for key in value if not isinstance(key, str)]
        if strange:
            raise TypeError(f"a checkpoint's keys are text, not {strange[0]!r}")
        return {key: _listed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_listed(item) for item in value]
    return value


def _locked(directory: Path) -> int:
    """An open lock file of the directory that nobody else holds; the system frees it when the process ends."""
    try:
        import fcntl
    except ImportError:  # a system without it; two runs at once are then the user's to avoid
        directory.mkdir(parents=True, exist_ok=True)
        return _not_followed(directory / _LOCK, os.O_CREAT | os.O_RDWR)
    while True:
        directory.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = _not_followed(directory / _LOCK, os.O_CREAT | os.O_RDWR)
        except FileNotFoundError:
            continue  # a run that has just ended removed the directory
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            what = f"another run works in {directory.parent}"
            raise UsageError(what, fix="wait until it has ended, or name another --out") from None
        if _is_there(directory / _LOCK, descriptor):
            return descriptor
        os.close(descriptor)


def _is_there(path: Path, descriptor: int) -> bool:
    """Whether the locked file is still the one of that name: the run that held it may have removed it."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
