"""TOML from strangers: whatever is wrong with the text, one line says so, and a small text takes little time."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from lidarcheck.config.words import printable
from lidarcheck.errors import InputError

__all__ = ["toml_of"]

_DEEPEST = 100
"""Parts of a dotted key, or lists and tables in each other: ten times what any file of a sensor team has. The parser's
time grows with the square of a key's parts, to half a minute for 50 000."""
_PART = r"""(?:[A-Za-z0-9_-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}[ \t]*+\.[ \t]*+){{{_DEEPEST}}}{_PART}")
_AT_LINE = re.compile(r"\s*\(at (?:line (\d+), column \d+|end of document)\)")


def toml_of(text: str, file: Path) -> dict[str, Any]:
    """The values of a TOML document. `InputError` with the line where it is none, or nests too deeply."""
    key = _LONG_KEY.search(text)
    if key is not None:
        line = text.count("\n", 0, key.start()) + 1
        raise InputError(f"a key of more than {_DEEPEST} parts", file=file, line=line, fix="write it shorter")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise _too_deep(file) from None
    except (ValueError, OverflowError) as error:
        what, line = _syntax_fault(str(error), text)
        raise InputError(f"not valid TOML: {what}", file=file, line=line, fix="correct the line") from None
    if _is_deep(data):
        raise _too_deep(file)
    return data


def _too_deep(file: Path) -> InputError:
    return InputError("lists or tables are nested too deeply", file=file, fix="write it flatter")


def _is_deep(data: dict[str, Any]) -> bool:
    """Whether lists and tables lie in each other more than `_DEEPEST` times."""
    layer: list[Any] = [data]
    for _ in range(_DEEPEST):
        inner = (value.values() if isinstance(value, dict) else value for value in layer)
        layer = [value for values in inner for value in values if isinstance(value, dict | list)]
        if not layer:
            return False
    return True


def _syntax_fault(message: str, text: str) -> tuple[str, int]:
    match = _AT_LINE.search(message)
    last_line = text.rstrip("\n").count("\n") + 1
    line = int(match.group(1)) if match and match.group(1) else last_line
    what = _AT_LINE.sub("", message)
    what = what[:1].lower() + what[1:]
    return printable(what), min(line, last_line)
