"""USD as text: the attributes of the first prim that is a lidar, as plain values."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from lidarcheck.config.schema import LineIndex
from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.values import Values

__all__ = ["usda_values"]

_ATTRIBUTE = re.compile(
    r"^[ \t]*(?:\w+[ \t]+){0,3}\w+(?:\[\])?[ \t]+(omni:sensor:Core:[\w:]+)[ \t]*=[ \t]*", re.MULTILINE
)
_PRIM = re.compile(r'^[ \t]*def[ \t]+OmniLidar[ \t]+"([^"\n]{1,200})"', re.MULTILINE)
_LIST = re.compile(r"\[([-+0-9.eE,\s]*)\]")
_ONE = re.compile(r'"([^"\n]*)"|([-+0-9.eE]+)')


def usda_values(text: str, file: Path) -> Values:
    """The attributes `omni:sensor:Core:...` with their lines; `InputError` where one stands twice or is not plain."""
    found: dict[str, Any] = {}
    lines: dict[tuple[str | int, ...], int] = {}
    at, line = 0, 1
    for match in _ATTRIBUTE.finditer(text):
        line += text.count("\n", at, match.start(1))
        at, name = match.start(1), match[1]
        if name in found:
            what = f"{name} stands twice: the file describes several lidars"
            raise InputError(what, file=file, line=line, fix="keep one of them")
        many, one = _LIST.match(text, match.end()), _ONE.match(text, match.end())
        if many:
            found[name] = [_number(cell) for cell in many[1].split(",") if cell.strip()]
        elif one:
            found[name] = one[1] if one[1] is not None else _number(one[2])
        else:
            raise InputError(f"{name} is no number, text or list", file=file, line=line, fix="write its value out")
        lines[name,] = line
    prim = _PRIM.search(text)
    return Values({**found, "name": prim[1] if prim else None}, LineIndex(file, lines), as_text=True)


def _number(cell: str) -> Any:
    try:
        return float(cell)
    except ValueError:
        return cell.strip()
