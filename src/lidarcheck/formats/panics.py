"""Keeping the panic text of a Rust library off standard error: what went wrong is said once, in one line."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import threading
from collections.abc import Iterator

__all__ = ["panics_unsaid"]

_ALONE = threading.Lock()
_STANDARD_ERROR = 2
_PANIC = b"panicked at "


@contextlib.contextmanager
def panics_unsaid(needed: bool = True) -> Iterator[None]:
    """While the block runs, standard error is held back; afterwards it is written, unless a panic stands in it.

    A Rust library writes to the file descriptor, where nothing in Python sees it. One thread at a time may hold it.
    """
    with contextlib.ExitStack() as stack:
        if needed:
            stack.enter_context(_ALONE)
            with contextlib.suppress(OSError, ValueError):  # nobody listens
                stack.enter_context(_held_back())
        yield


@contextlib.contextmanager
def _held_back() -> Iterator[None]:
    if sys.stderr is not None:
        sys.stderr.flush()
    kept = os.dup(_STANDARD_ERROR)
    try:
        with tempfile.TemporaryFile() as held:
            os.dup2(held.fileno(), _STANDARD_ERROR)
            try:
                yield
            finally:
                if sys.stderr is not None:
                    sys.stderr.flush()
                os.dup2(kept, _STANDARD_ERROR)
                held.seek(0)
                said = held.read()
                if said and _PANIC not in said:
                    os.write(_STANDARD_ERROR, said)
    finally:
        os.close(kept)
