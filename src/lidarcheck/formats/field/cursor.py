"""The values of a serialised message, one after the other: CDR as ROS 2 has it, or ROS 1's own, without alignment."""

from __future__ import annotations

import struct
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.table import quoted

__all__ = ["Cursor"]

_SIZES = {"b": 1, "B": 1, "?": 1, "h": 2, "H": 2, "i": 4, "I": 4, "f": 4, "q": 8, "Q": 8, "d": 8}
_CDR = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
"""Of the encapsulations that hold plain values: the order of bytes, and what the longest are aligned to."""


class Cursor:
    """A place in a message. Each method gives the next value; `InputError` where the message ends before it."""

    def __init__(self, content: bytes, encoding: str, path: Path) -> None:
        self.content, self.path, self.encoding = content, path, encoding
        self.at, self.start, self.order, self.most = 0, 0, "<", 1
        if encoding == "cdr":
            found = _CDR.get(int.from_bytes(content[:2], "big")) if len(content) >= 4 else None
            if found is None:
                raise self.fault("its head is none of CDR")
            self.order, self.most = found
            self.at = self.start = 4
        elif encoding != "ros1":
            what = f"the messages are encoded as {quoted(encoding)}"
            raise InputError(what, file=path, fix="record them as CDR (ROS 2) or in a ROS 1 bag")

    def fault(self, why: str) -> InputError:
        """The error for a message that is not what its type says."""
        return InputError(f"a message is damaged: {why}", file=self.path, fix="record it again, or leave it out")

    def values(self, kinds: str) -> tuple[int | float, ...]:
        """Numbers, a letter of `struct` each."""
        found: list[int | float] = []
        for kind in kinds:
            size = _SIZES[kind]
            self.align(size)
            found.append(struct.unpack(f"{self.order}{kind}", self.take(size))[0])
        return tuple(found)

    def whole(self, kind: str = "I") -> int:
        """One whole number."""
        return int(self.values(kind)[0])

    def align(self, size: int) -> None:
        """Go on to where a value of this size may begin."""
        self.at += -(self.at - self.start) % min(size, self.most)

    def take(self, count: int) -> bytes:
        """The next bytes."""
        if count > len(self.content) - self.at:
            raise self.fault("it ends too early")
        found = self.content[self.at : self.at + count]
        self.at += count
        return found

    def text(self) -> str:
        """A text, without the zero that ends it in CDR."""
        return self.take(self.whole()).rstrip(b"\0").decode("utf-8", "replace")

    def head(self) -> tuple[int, str]:
        """A `std_msgs/Header`: its time [ns] and the name of its frame."""
        if self.encoding == "ros1":
            self.whole()  # a sequence number
        seconds, nanoseconds = self.whole("i" if self.encoding == "cdr" else "I"), self.whole()
        return seconds * 10**9 + nanoseconds, self.text()
