"""Where the keys of a TOML document stand: the standard parser gives values without positions.

The scan trusts that the text is valid, so call it on text that `tomllib` has accepted.
"""

from __future__ import annotations

import bisect
import re
import tomllib

__all__ = ["KeyPath", "locate"]

KeyPath = tuple[str | int, ...]
"""The way to a value: table keys and list indices from 0, e.g. `("effects", 1, "name")`."""

_BLANK = re.compile(r"(?:[ \t\n]+|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_STRINGS = (
    re.compile(r'"""(?:\\.|[^\\])*?"{3,5}', re.DOTALL),
    re.compile(r"'''.*?'{3,5}", re.DOTALL),
    re.compile(r'"(?:\\.|[^"\\\n])*"'),
    re.compile(r"'[^'\n]*'"),
)
_SCALAR = re.compile(r"[^,\]}#\n]+")


def locate(text: str) -> dict[KeyPath, int]:
    """The line, from 1, on which each table, key and list entry of a valid TOML document begins.

    A table that is only implied (`a` in `[a.b]`) has the line of its first mention. `ValueError` where the text is
    not TOML.
    """
    return _Scanner(text.replace("\r\n", "\n")).run()


class _Scanner:
    """One pass over the text; `pos` is always at the next unread character."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.pos = 0
        self.found: dict[KeyPath, int] = {}
        self.table_counts: dict[KeyPath, int] = {}
        self.line_ends = [match.start() for match in re.finditer("\n", text)]

    def run(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        self.skip(_BLANK)
        while self.pos < len(self.text):
            if self.peek() == "[":
                table = self.header()
            else:
                self.pair(table)
            self.skip(_BLANK)
        return self.found

    def header(self) -> KeyPath:
        line = self.line()
        repeated = self.text.startswith("[[", self.pos)
        self.pos += 2 if repeated else 1
        parts = self.key_parts()
        self.pos += 2 if repeated else 1
        path: KeyPath = ()
        for part in parts[:-1]:
            path = self.step_in((*path, part), line)
        path = (*path, parts[-1])
        if not repeated:
            self.found[path] = line
            return path
        self.table_counts[path] = self.table_counts.get(path, 0) + 1
        return self.step_in(path, line)

    def step_in(self, path: KeyPath, line: int) -> KeyPath:
        """The table at `path`, the last one where it is repeated."""
        self.found.setdefault(path, line)
        if path in self.table_counts:
            path = (*path, self.table_counts[path] - 1)
            self.found.setdefault(path, line)
        return path

    def pair(self, table: KeyPath) -> None:
        line = self.line()
        path = table
        for part in self.key_parts():
            path = (*path, part)
            self.found.setdefault(path, line)
        self.expect("=")
        self.value(path)

    def key_parts(self) -> list[str]:
        parts = []
        while True:
            self.skip(_SPACE)
            parts.append(self.key())
            self.skip(_SPACE)
            if self.peek() != ".":
                return parts
            self.pos += 1

    def key(self) -> str:
        bare = _BARE_KEY.match(self.text, self.pos)
        if bare:
            self.pos = bare.end()
            return bare.group()
        start = self.pos
        self.string()
        key: str = tomllib.loads(f"key = {self.text[start : self.pos]}")["key"]
        return key

    def value(self, path: KeyPath) -> None:
        self.skip(_SPACE)
        opening = self.peek()
        if opening == "[":
            self.array(path)
        elif opening == "{":
            self.inline_table(path)
        elif opening in ('"', "'"):
            self.string()
        else:
            self.take(_SCALAR)

    def array(self, path: KeyPath) -> None:
        self.pos += 1
        index = 0
        self.skip(_BLANK)
        while self.peek() != "]":
            self.found[(*path, index)] = self.line()
            self.value((*path, index))
            index += 1
            self.next_entry("]")
        self.pos += 1

    def inline_table(self, path: KeyPath) -> None:
        self.pos += 1
        self.skip(_BLANK)
        while self.peek() != "}":
            self.pair(path)
            self.next_entry("}")
        self.pos += 1

    def next_entry(self, closing: str) -> None:
        self.skip(_BLANK)
        if self.peek() != closing:
            self.expect(",")
            self.skip(_BLANK)

    def string(self) -> None:
        for pattern in _STRINGS:
            match = pattern.match(self.text, self.pos)
            if match:
                self.pos = match.end()
                return
        raise ValueError(f"line {self.line()}: not a TOML string")

    def expect(self, character: str) -> None:
        if self.peek() != character:
            raise ValueError(f"line {self.line()}: {character!r} expected")
        self.pos += 1

    def take(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.pos)
        if not match:
            raise ValueError(f"line {self.line()}: not a TOML value")
        self.pos = match.end()

    def skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.pos)
        if match:
            self.pos = match.end()

    def peek(self) -> str:
        return self.text[self.pos : self.pos + 1]

    def line(self) -> int:
        return bisect.bisect_left(self.line_ends, self.pos) + 1
