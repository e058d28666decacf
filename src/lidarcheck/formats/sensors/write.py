"""The text of a sensor file: TOML with comments, what the vendor's file lacks as a line behind a hash."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import tomli_w

from lidarcheck.formats.sensors.imported import Imported, Lacking
from lidarcheck.printable import printable

__all__ = ["document_text", "table_text"]

_HEAD = (
    "Written by `lidarcheck sensor from`. A key behind a hash is not in the vendor's file: look it up, write its value "
    "and take the hash away."
)
_WIDTH = 120
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ORDER = ("sweep", "range", "linear", "beams", "features")


def document_text(imported: Imported, *, table_file: str = "", head: str = _HEAD) -> str:
    """The sensor file as text; `head`: the comment that it begins with.

    `table_file`: the name of the file that holds `imported.table`, for a sensor that has one. Keys without a table come
    first; every table holds what is known, then what is lacking with a value as an example and what to look up.
    """
    document = {key: value for key, value in imported.document.items() if not isinstance(value, Mapping)}
    tables = {key: dict(value) for key, value in imported.document.items() if isinstance(value, Mapping)}
    if imported.table:
        tables["beams"]["file"] = table_file
    lacking: dict[str, list[Lacking]] = {}
    for entry in imported.lacking:
        lacking.setdefault(entry.key.rpartition(".")[0], []).append(entry)
    lines = [f"# {line}" for line in textwrap.wrap(head, _WIDTH - 2)]
    for remark in imported.remarks:
        lines += _words(remark)
    lines += [line for key, value in document.items() for line in _pair(key, value)]
    lines += _lacking_lines(lacking.pop("", []))
    for name in (*_ORDER, *(key for key in tables if key not in _ORDER)):
        own, missing = tables.get(name, {}), lacking.pop(name, [])
        if name in tables or missing:
            lines += ["", f"[{name}]", *(line for key, value in own.items() for line in _pair(key, value))]
            lines += _lacking_lines(missing)
    assert not lacking, f"no table for {list(lacking)}"
    return "\n".join(lines) + "\n"


def table_text(imported: Imported) -> str:
    """The table of beams as CSV."""
    rows = zip(*(map(repr, column) for column in imported.table.values()), strict=True)
    return "\n".join([",".join(imported.table), *map(",".join, rows)]) + "\n"


def _lacking_lines(entries: Iterable[Lacking]) -> list[str]:
    lines: list[str] = []
    for entry in entries:
        lines += [f"# {line}" for line in _pair(entry.key.rpartition(".")[2], entry.example)]
        lines += _words(entry.look_up)
    return lines


def _words(text: str) -> list[str]:
    """A comment that is no key: it stands farther in."""
    return [f"#   {line}" for line in textwrap.wrap(printable(text), _WIDTH - 4)]


def _pair(key: str, value: Any) -> list[str]:
    """`key = value`, a long list over several lines."""
    name = key if _BARE.fullmatch(key) else _value(key)
    line = f"{name} = {_value(value)}"
    if len(line) <= _WIDTH or not isinstance(value, Sequence) or isinstance(value, str):
        return [line]
    cells = [_value(entry) for entry in value]
    if any(isinstance(entry, str) for entry in value):
        return [f"{name} = [", *(f"  {cell}," for cell in cells), "]"]
    return [f"{name} = [", *(f"  {row}" for row in textwrap.wrap(", ".join(cells), _WIDTH - 2)), "]"]


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        inner = ", ".join(_pair_of(key, entry) for key, entry in value.items())
        return f"{{{inner}}}"
    if isinstance(value, str):
        return tomli_w.dumps({"a": printable(value)})[4:-1]
    if isinstance(value, Sequence):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _pair_of(key: str, value: Any) -> str:
    return f"{key if _BARE.fullmatch(key) else _value(key)} = {_value(value)}"
