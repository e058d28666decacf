"""Where the keys of a JSON document stand, and which of them stand twice.

The scan trusts that the text is valid, so call it on text that `json` has accepted.
"""

from __future__ import annotations

import json
import re

from lidarcheck.config.toml_lines import KeyPath

__all__ = ["locate_json"]

_SPACE = re.compile(r"[ \t\r\n]*")
_SCALAR = re.compile(r"[^,\]}\s]+")


def locate_json(text: str) -> tuple[dict[KeyPath, int], list[tuple[KeyPath, int]]]:
    """The line, from 1, of each key and list entry of a valid JSON document, and the keys that stand there again."""
    scanner = _Scanner(text)
    scanner.value(())
    return scanner.found, scanner.repeated


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.pos = 0
        self.counted = (0, 1)
        self.found: dict[KeyPath, int] = {}
        self.repeated: list[tuple[KeyPath, int]] = []

    def value(self, path: KeyPath) -> None:
        opening = self.next_character()
        if opening == "{":
            self.entries(path, "}")
        elif opening == "[":
            self.entries(path, "]")
        elif opening == '"':
            self.string()
        else:
            match = _SCALAR.match(self.text, self.pos)
            if not match:
                raise ValueError(f"line {self.line()}: not a JSON value")
            self.pos = match.end()

    def entries(self, path: KeyPath, closing: str) -> None:
        self.pos += 1
        index = 0
        while self.next_character() != closing:
            line = self.line()
            part: str | int = index
            if closing == "}":
                part = self.string()
                self.next_character()
                self.pos += 1
            if (*path, part) in self.found:
                self.repeated.append(((*path, part), line))
            self.found.setdefault((*path, part), line)
            self.value((*path, part))
            if self.next_character() == ",":
                self.pos += 1
            index += 1
        self.pos += 1

    def string(self) -> str:
        text: str
        text, self.pos = json.decoder.scanstring(self.text, self.pos + 1)  # type: ignore[attr-defined]
        return text

    def next_character(self) -> str:
        match = _SPACE.match(self.text, self.pos)
        if match:
            self.pos = match.end()
        return self.text[self.pos : self.pos + 1]

    def line(self) -> int:
        position, line = self.counted
        self.counted = (self.pos, line + self.text.count("\n", position, self.pos))
        return self.counted[1]
