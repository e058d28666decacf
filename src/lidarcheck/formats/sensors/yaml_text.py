"""YAML of vendors: plain values with their lines; no tags, no anchors, no key twice."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.errors import InputError
from lidarcheck.formats.limits import check_bytes
from lidarcheck.formats.sensors.values import Values
from lidarcheck.printable import printable

__all__ = ["yaml_values"]

YAML_BYTES = 1 << 18
"""The parser takes some seconds for a megabyte of short values; the file of a sensor of 128 lasers has 30 kB."""
_AS_TEXT = ("timestamp", "merge", "value")
_PLAIN = ("int", "float", "str", "bool", "null")


def yaml_values(text: str, file: Path) -> Values:
    """The values of a YAML document with their lines. `InputError` where it is none, or where YAML cannot be read."""
    try:
        import yaml
    except ImportError:
        fix = "install PyYAML: pip install 'lidarcheck[import]'"
        raise InputError("the file is YAML, which needs the package PyYAML", file=file, fix=fix) from None
    check_bytes(len(text.encode("utf-8", "replace")), file, YAML_BYTES)
    lines: dict[KeyPath, int] = {}
    loader: Any = None
    try:
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        data = None if node is None else _Walk(loader, file, lines).value(node, ())
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = f"not valid YAML: {printable(str(getattr(error, 'problem', None) or 'it cannot be read'))}"
        line = None if mark is None else mark.line + 1
        raise InputError(what, file=file, line=line, fix="correct the line") from None
    except RecursionError:
        raise InputError("lists or tables are nested too deeply", file=file, fix="write it flatter") from None
    except ValueError as error:
        raise InputError(f"not valid YAML: {printable(str(error))}", file=file, fix="correct it") from None
    finally:
        if loader is not None:
            loader.dispose()
    return Values(data, LineIndex(file, lines), as_text=True)


class _Walk:
    """From the parser's nodes to plain values; a node that is met twice is an alias, which may stand for millions."""

    def __init__(self, loader: Any, file: Path, lines: dict[KeyPath, int]) -> None:
        self.loader, self.file, self.lines = loader, file, lines
        self.met: set[int] = set()

    def value(self, node: Any, path: KeyPath) -> Any:
        line = node.start_mark.line + 1
        if id(node) in self.met:
            raise self.fault("aliases (*name) are not read", line)
        self.met.add(id(node))
        self.lines.setdefault(path, line)
        if isinstance(node.value, str):
            return self.scalar(node, line)
        if node.tag.endswith(":seq"):
            return [self.value(entry, (*path, index)) for index, entry in enumerate(node.value)]
        if not node.tag.endswith(":map"):
            raise self.fault(f"the tag {printable(str(node.tag))[:60]} is not read", line)
        table: dict[str, Any] = {}
        for key_node, entry in node.value:
            if not isinstance(key_node.value, str):
                raise self.fault("a key is no word", key_node.start_mark.line + 1)
            key = key_node.value
            if key in table:
                raise self.fault(f"{printable(key)[:60]} stands twice in one table", key_node.start_mark.line + 1)
            table[key] = self.value(entry, (*path, key))
            self.lines[*path, key] = key_node.start_mark.line + 1
        return table

    def scalar(self, node: Any, line: int) -> Any:
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        if kind in _AS_TEXT:
            return node.value
        if kind not in _PLAIN:
            raise self.fault(f"the tag {printable(node.tag)[:60]} is not read", line)
        if kind in ("int", "float") and len(node.value) > 400:
            raise self.fault("a number of more than 400 digits", line)
        value = self.loader.construct_object(node)
        return value if not isinstance(value, float) or math.isfinite(value) else node.value

    def fault(self, what: str, line: int) -> InputError:
        return InputError(what, file=self.file, line=line, fix="write plain values")
