"""JSON of vendors, with the lines of its keys."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.formats.json_lines import locate_json
from lidarcheck.formats.json_text import LOCATED, json_of
from lidarcheck.formats.sensors.values import Values

__all__ = ["json_values"]


def json_values(text: str, file: Path) -> Values:
    """The values of a JSON document with their lines; `InputError` where it is none, or a key stands twice."""
    data = json_of(text, file, once=True)
    return Values(data, LineIndex(file, _Lines(text)), as_text=True)


class _Lines(Mapping[KeyPath, int]):
    """Where the keys stand, looked up when somebody asks."""

    def __init__(self, text: str) -> None:
        self.text = text

    @functools.cached_property
    def found(self) -> dict[KeyPath, int]:
        """The line of each key; none of a long text, or of one that nests too deeply to be looked up."""
        try:
            return locate_json(self.text)[0] if len(self.text) <= LOCATED else {}
        except RecursionError:
            return {}

    def __getitem__(self, path: KeyPath) -> int:
        return self.found[path]

    def __iter__(self) -> Iterator[KeyPath]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)
