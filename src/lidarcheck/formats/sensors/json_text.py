"""JSON of vendors: whatever is wrong with the text, one line says so."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NoReturn

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.words import dotted
from lidarcheck.errors import InputError
from lidarcheck.formats.json_lines import locate_json
from lidarcheck.formats.sensors.values import Values

__all__ = ["json_values"]


def json_values(text: str, file: Path, *, as_text: bool = False) -> Values:
    """The values of a JSON document with their lines; `InputError` where it is none, or a key stands twice."""
    try:
        data = json.loads(text, parse_constant=_refuse)
        found, repeated = locate_json(text)
    except json.JSONDecodeError as error:
        what = f"not valid JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        raise InputError(what, file=file, line=error.lineno, fix="correct the line") from None
    except RecursionError:
        raise InputError("lists or objects are nested too deeply", file=file, fix="write it flatter") from None
    except ValueError as error:
        raise InputError(f"not valid JSON: {error}", file=file, fix="use plain numbers and text") from None
    lines = LineIndex(file, found)
    if repeated:
        path, line = repeated[0]
        raise InputError(f"{dotted(path)} stands twice", file=file, line=line, fix="remove one")
    return Values(data, lines, as_text)


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")
