"""Talking with a process that stays up: through its standard input and output, neither of which may block for ever."""

from __future__ import annotations

import contextlib
import os
import select
import time

from lidarcheck.model.external.process import Child, exit_words, failure, last_words
from lidarcheck.model.spec import External

__all__ = ["LONGEST_LINE", "Pipe"]

LONGEST_LINE = 1 << 20
"""Bytes; an answer is far shorter."""
_CHUNK = 1 << 20
_SLICE_MS = 100
_END_S = 1.0
"""How long a process that closed its output may take to end."""


class Pipe:
    """Bytes to and from a `Child` with pipes. Every method raises `ExternalModelError` where the process has ended, or
    when `seconds` are over.
    """

    def __init__(self, child: Child, external: External) -> None:
        self._child, self._external = child, external
        self._in, self._out = child.stdin.fileno(), child.stdout.fileno()
        os.set_blocking(self._in, False)
        os.set_blocking(self._out, False)
        self._read = bytearray()

    def send(self, data: bytes, seconds: float) -> None:
        """Write all of it."""
        end, rest = time.monotonic() + seconds, memoryview(data)
        while rest:
            self._wait(self._in, select.POLLOUT, end, seconds)
            try:
                rest = rest[os.write(self._in, rest[:_CHUNK]) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                self._ended()

    def line(self, seconds: float) -> bytes:
        """The next line, without its end."""
        end, seen = time.monotonic() + seconds, 0
        while (at := self._read.find(b"\n", seen)) < 0:
            seen = len(self._read)
            if seen > LONGEST_LINE:
                what = f"wrote a line of more than {LONGEST_LINE} bytes to its standard output"
                raise failure(what, self._external, self._said(), "let it write to standard error")
            self._more(end, seconds)
        return self._taken(at + 1)[:-1]

    def take(self, size: int, seconds: float) -> bytes:
        """So many bytes."""
        end = time.monotonic() + seconds
        while len(self._read) < size:
            self._more(end, seconds)
        return self._taken(size)

    @property
    def waiting(self) -> bytes:
        """What has been read and not yet been taken, or can be read at once."""
        with contextlib.suppress(BlockingIOError):
            while more := os.read(self._out, _CHUNK):
                self._read += more
        return bytes(self._read)

    def _taken(self, size: int) -> bytes:
        taken = bytes(self._read[:size])
        del self._read[:size]
        return taken

    def _more(self, end: float, seconds: float) -> None:
        self._wait(self._out, select.POLLIN, end, seconds)
        try:
            more = os.read(self._out, _CHUNK)
        except BlockingIOError:
            return
        if not more:
            self._ended()
        self._read += more

    def _wait(self, descriptor: int, event: int, end: float, seconds: float) -> None:
        poll = select.poll()
        poll.register(descriptor, event)
        while not poll.poll(_SLICE_MS):  # an interrupt that another thread gets must not wait for the end
            if time.monotonic() > end:
                what = f"took longer than {seconds:g} s"
                raise failure(what, self._external, self._said(), "raise timeout_s or make it faster")

    def _ended(self) -> None:
        code = self._child.wait(_END_S)
        what = "closed its standard output" if code is None else exit_words(code)
        raise failure(f"{what} before it had answered", self._external, self._said(), "run it by hand")

    def _said(self) -> str:
        return last_words(self._child.log)
