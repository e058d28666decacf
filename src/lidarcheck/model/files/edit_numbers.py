"""The sensor's and the materials' numbers in a model file's text: those that change, and nothing else."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from lidarcheck.config.toml_lines import KeyPath, locate
from lidarcheck.model.files.edit_text import shown_value
from lidarcheck.model.files.external_file import directory_key
from lidarcheck.model.files.sensor_file import is_sensor_file
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Program

__all__ = ["changed_numbers", "moved_files", "with_numbers"]

_PAIR = re.compile(
    r"""(?P<head>\s*(?:[\w-]+|"[^"]*"|'[^']*')\s*=\s*)(?P<value>"[^"\\]*"|'[^']*'|[^\s,{}\[\]#"']+)(?P<rest>\s*(?:#.*)?)"""
)
_NUMBER_OF_MATERIAL = ("reflectance", "retro_gain")


def changed_numbers(before: Model, after: Model) -> dict[KeyPath, float | str]:
    """The numbers of sensor and materials that differ, by the way to each in the file; `ValueError` for all else."""
    found: dict[KeyPath, float | str] = {}
    if before.sensor.variant != after.sensor.variant or before.materials.keys() != after.materials.keys():
        raise ValueError("the variant or the list of materials differs")
    own, other = before.sensor.overrides(), after.sensor.overrides()
    for name in {**own, **other}:
        if getattr(before.sensor, name) != getattr(after.sensor, name):
            found["sensor", name] = getattr(after.sensor, name)
    for one in before.external.parameters if before.external is not None else ():
        value = after.sensor.settings[one.name] if isinstance(after.sensor, Program) else one.value
        if value != one.value:
            found["external", "parameters", one.name, "value"] = value
    for number, entry in before.materials.items():
        for key in _NUMBER_OF_MATERIAL:
            if getattr(entry, key) != getattr(after.materials[number], key):
                found["materials", str(number), key] = getattr(after.materials[number], key)
    return found


def moved_files(model: Model, out: Path) -> dict[KeyPath, float | str]:
    """What names the sensor's file, a program's folder and its settings in a file that lies elsewhere than the model's
    own."""
    if model.file is None or model.file.absolute().parent == out.absolute().parent:
        return {}
    place, external = out.absolute().parent, model.external
    found: dict[KeyPath, float | str] = {}
    if model.sensor.file and is_sensor_file(model.sensor.variant):
        found["variant",] = Path(os.path.relpath(model.sensor.file, place)).as_posix()
    if external is None:
        return found
    found["external", "directory"] = directory_key(external, place) or "."
    if external.ini is not None:
        found["external", "ini"] = Path(os.path.relpath(external.ini, place)).as_posix()
    return found


def with_numbers(text: str, numbers: Mapping[KeyPath, float | str]) -> str:
    """The text with these numbers; `ValueError` where one does not stand in a line of its own."""
    if not numbers:
        return text
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    plain = text.removeprefix(mark)
    newline = "\r\n" if "\r\n" in plain else "\n"
    lines = plain.splitlines(keepends=True)
    at = locate(plain)
    new: dict[KeyPath, list[str]] = {}
    for path, value in numbers.items():
        if path in at:
            lines[at[path] - 1] = _replaced(lines[at[path] - 1], value)
        else:
            new.setdefault(path[:-1], []).append(f"{path[-1]} = {shown_value(value)}{newline}")
    # From the end, so that places hold.
    for table in sorted(new, key=lambda table: at.get(table, 0), reverse=True):
        if table in at and not lines[at[table] - 1].lstrip().startswith("["):
            raise ValueError(f"{'.'.join(map(str, table))} is no table with a header of its own")
        if table in at:
            _end_line(lines, at[table] - 1, newline)
            lines[at[table] : at[table]] = new[table]
        else:
            place = _behind_top(lines, at)
            _end_line(lines, place - 1, newline)
            lines[place:place] = [newline, f"[{'.'.join(map(str, table))}]{newline}", *new[table]]
    return mark + "".join(lines)


def _replaced(line: str, value: float | str) -> str:
    body = line.rstrip("\r\n")
    pair = _PAIR.fullmatch(body)
    if pair is None:
        raise ValueError(f"{body.strip()[:40]!r} is no plain key with a number")
    return f"{pair['head']}{shown_value(value)}{pair['rest']}{line[len(body) :]}"


def _behind_top(lines: list[str], at: Mapping[KeyPath, int]) -> int:
    """One behind the last key that stands before the first table, from 0: where a new table can begin."""
    headers = [i for i, line in enumerate(lines) if line.lstrip().startswith("[")]
    top = [line for path, line in at.items() if len(path) == 1 and (not headers or line <= headers[0])]
    return max(top, default=0)


def _end_line(lines: list[str], row: int, newline: str) -> None:
    if 0 <= row < len(lines) and not lines[row].endswith("\n"):
        lines[row] += newline
