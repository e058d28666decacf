"""JSON of vendors: whatever is wrong with the text, one line says so, and a small text takes little time and memory."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.config.words import shown
from lidarcheck.errors import InputError
from lidarcheck.formats.json_lines import locate_json
from lidarcheck.formats.sensors.values import Values

__all__ = ["json_values"]

_LOCATED = 1 << 20
"""Characters of a text whose lines are looked up: a second's work. A longer one is a pattern, in few lines."""


def json_values(text: str, file: Path) -> Values:
    """The values of a JSON document with their lines; `InputError` where it is none, or a key stands twice."""
    try:
        data = json.loads(text, parse_constant=_refuse, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        what = f"not valid JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        raise InputError(what, file=file, line=error.lineno, fix="correct the line") from None
    except RecursionError:
        raise InputError("lists or objects are nested too deeply", file=file, fix="write it flatter") from None
    except ValueError as error:
        raise InputError(
            f"not valid JSON: {error}", file=file, fix="use plain numbers and text, each key once"
        ) from None
    return Values(data, LineIndex(file, _Lines(text)), as_text=True)


class _Lines(Mapping[KeyPath, int]):
    """Where the keys stand, looked up when somebody asks."""

    def __init__(self, text: str) -> None:
        self.text = text

    @functools.cached_property
    def found(self) -> dict[KeyPath, int]:
        try:
            return locate_json(self.text)[0] if len(self.text) <= _LOCATED else {}
        except RecursionError:
            return {}

    def __getitem__(self, path: KeyPath) -> int:
        return self.found[path]

    def __iter__(self) -> Iterator[KeyPath]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for at, key in enumerate(keys) if key in keys[:at])
        raise ValueError(f"{shown(twice)} stands twice in one object")
    return table
