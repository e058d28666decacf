"""The library on disk: a file a block, below the cache directory, named by hashes of the source and of what it is of.

Whoever fills a block writes it beside the others' and renames it, so that processes may do so at the same time: they
write the same. A file begins with its digest; one that does not fit its digest is filled again. The oldest files go
where all together are large.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.jit import base_directory, source_hash

__all__ = ["MOST_BYTES", "load", "path_of", "save"]

MOST_BYTES = 1 << 30
"""Of all libraries together."""
_DIGEST = hashlib.sha256().digest_size
_log = logging.getLogger(__name__)


def path_of(source: Any, part: int | str) -> Path:
    """The file of a block, or of what has that name. `source`: all that it depends on but the model's code."""
    key = hashlib.sha256(repr(tuple(source)).encode()).hexdigest()
    return base_directory() / "echoes" / source_hash()[:16] / f"{key[:16]}-{part}.npz"


def load(path: Path) -> dict[str, npt.NDArray[Any]] | None:
    """The arrays of a file by name; None where there is none that reads back whole."""
    try:
        content = path.read_bytes()
        with contextlib.suppress(OSError):
            os.utime(path)  # what is used stays
    except OSError:
        return None
    digest, body = content[:_DIGEST], content[_DIGEST:]
    if hashlib.sha256(body).digest() != digest:
        return None
    with np.load(io.BytesIO(body), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def save(path: Path, arrays: dict[str, npt.NDArray[Any]]) -> None:
    """Write a file, or say once that it cannot be."""
    body = io.BytesIO()
    np.savez(body, **arrays)  # type: ignore[arg-type]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as stream:
            stream.write(hashlib.sha256(body.getbuffer()).digest())
            stream.write(body.getbuffer())
    except (OSError, InputError):
        _note(path.parent)
        return
    _prune(path.parents[1])


@functools.cache
def _note(directory: Path) -> None:
    _log.warning("%s cannot be written: the echo library is filled anew in each run; set LIDARCHECK_CACHE", directory)


def _prune(base: Path) -> None:
    """Remove the files that were used longest ago until the rest is small enough; others may do so as well."""
    files: list[tuple[float, int, Path]] = []
    for path in base.rglob("*"):
        with contextlib.suppress(OSError):
            if path.is_file():
                files.append((path.stat().st_mtime, path.stat().st_size, path))
    total = 0
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > MOST_BYTES:
            with contextlib.suppress(OSError):
                path.unlink()
                path.parent.rmdir()  # fails where it holds more
