"""TOML files: their values, the lines of their keys, and both held against a `Config` class."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from lidarcheck.config.schema import LineIndex, validate
from lidarcheck.config.toml_lines import locate
from lidarcheck.config.toml_text import toml_of
from lidarcheck.formats.source import read_text

__all__ = ["load_toml", "parse_toml"]

_ModelT = TypeVar("_ModelT", bound=BaseModel)


def load_toml(path: str | os.PathLike[str], model: type[_ModelT]) -> _ModelT:
    """Read a TOML file into a `Config` class.

    `InputError` when it cannot be read as TOML, `ConfigError` with all faults, in the file's order, when keys or values
    are wrong.
    """
    data, lines = parse_toml(path)
    return validate(data, lines, model)


def parse_toml(path: str | os.PathLike[str]) -> tuple[dict[str, Any], LineIndex]:
    """A TOML file's values and the lines of its keys. `InputError` with the parser's line when it is not TOML."""
    file = Path(path)
    text = read_text(file)
    return toml_of(text, file), LineIndex(file, locate(text))
