"""JSON from strangers: whatever is wrong with the text, one line says so."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, NoReturn

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError
from lidarcheck.formats.json_lines import locate_json

__all__ = ["LOCATED", "json_of", "too_deep"]

LOCATED = 1 << 20
"""Characters of a text in which lines are looked up: a second's work. A longer one holds its numbers in few lines."""
_CONSTANT = re.compile(r'"(?:[^"\\]++|\\.)*+"|(NaN|Infinity)')


def json_of(text: str, file: Path, *, once: bool = False) -> Any:
    """The values of a JSON document, numbers finite as they are written.

    `once`: whether a key may stand but once in an object. `InputError` with the line where the text is none.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_once if once else None)
    except json.JSONDecodeError as error:
        what = f"not valid JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        raise InputError(what, file=file, line=error.lineno, fix="correct the line") from None
    except RecursionError:
        raise too_deep(file) from None
    except ValueError as error:
        line = _line_of_constant(text)
        raise InputError(f"not valid JSON: {error}", file=file, line=line, fix="use plain numbers and text") from None
    except _TwiceError as error:
        json_of(text, file)  # what is wrong behind it goes first: lines are found in valid text alone
        [key] = error.args
        repeated = locate_json(text)[1] if len(text) <= LOCATED else []
        line = next((line for path, line in repeated if path[-1] == key), None)
        raise InputError(f"{shown(key)} stands twice in one object", file=file, line=line, fix="remove one") from None


def too_deep(file: Path) -> InputError:
    """The error for values that lie in each other too often."""
    return InputError("lists or objects are nested too deeply", file=file, fix="write it flatter")


class _TwiceError(Exception):
    """A key that stands again in its object."""


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for key, value in pairs:
        if key in table:
            raise _TwiceError(key)
        table[key] = value
    return table


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")


def _line_of_constant(text: str) -> int | None:
    """The line of the first NaN or Infinity outside of quotes; None where there is none."""
    for match in _CONSTANT.finditer(text):
        if match[1]:
            return text.count("\n", 0, match.start()) + 1
    return None
