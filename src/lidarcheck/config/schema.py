"""Reading TOML configuration: strict, all faults at once, each with its line and the nearest valid key.

Declare a class, then load a file into it (`load_toml` of `lidarcheck.formats.config`):

    class Panel(Config):
        distance_m: float = Field(ge=1.0, le=300.0)
        reflectance: float = Field(0.5, ge=0.0, le=1.0)

    panel = load_toml("panel.toml", Panel)

Arrays arrive as tuples (declare `tuple[float, ...]`), paths need `PathText`. A check of several fields belongs in a
`model_validator` that raises `ValueError("what is wrong; what to do")`. A check that needs more than the file is made
afterwards on `parse_toml`'s line index: `raise lines.fault(("panels", 2, "name"), "what", fix="what to do")`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.config.words import allowed, dotted, kind_of, nearest, shown, slots_at
from lidarcheck.errors import ConfigError, InputError

__all__ = ["Config", "LineIndex", "PathText", "validate"]

PathText = Annotated[Path, Field(strict=False)]
"""A path, written as text in the file."""

_ModelT = TypeVar("_ModelT", bound=BaseModel)
_OUT_OF_RANGE = ("greater_than", "greater_than_equal", "less_than", "less_than_equal", "multiple_of")
_OWN_WORDS = ("value_error", "assertion_error")


class Config(BaseModel):
    """A table of a configuration file: unknown keys are faults, types are strict, the values frozen.

    A whole number is taken for a float; text is not taken for a number, nor true or false. NaN and inf are faults.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, validate_default=True)


@dataclass(frozen=True)
class LineIndex:
    """The lines of a file's keys. `file` is named in every fault."""

    file: Path
    lines: Mapping[KeyPath, int] = field(default_factory=dict)

    def line(self, path: Sequence[str | int]) -> int:
        """The line of a key or of the nearest thing around it; the first for the whole document."""
        for end in range(len(path), 0, -1):
            if tuple(path[:end]) in self.lines:
                return self.lines[tuple(path[:end])]
        return 1

    def fault(self, path: Sequence[str | int], what: str, *, fix: str = "") -> InputError:
        """The error for a fault at that key, to raise or to collect for a `ConfigError`."""
        return InputError(what, file=self.file, line=self.line(path), fix=fix)


def validate(data: object, lines: LineIndex, model: type[_ModelT]) -> _ModelT:
    """Check parsed values against a `Config` class; `ConfigError` with all faults, in the file's order."""
    try:
        return model.model_validate(_frozen(data))
    except ValidationError as error:
        found = error.errors(include_url=False)
    except RecursionError:
        raise InputError("lists or tables are nested too deeply", file=lines.file, fix="write it flatter") from None
    faults: dict[tuple[KeyPath, str], InputError] = {}
    paths = [_path_in(data, entry["loc"]) for entry in found]
    for entry, path in zip(found, paths, strict=True):
        # A union says of a list that it is no table, though an entry of it is what is wrong.
        if entry["type"].endswith("_type") and any(
            len(path) < len(other) and other[: len(path)] == path for other in paths
        ):
            continue
        missing = str(entry["loc"][-1]) if entry["type"] == "missing" else ""
        what, fix = _words(entry, path, model)
        # One fault per place: a union reports each of its branches.
        faults.setdefault((path, missing), lines.fault(path, what, fix=fix))
    raise ConfigError(sorted(faults.values(), key=lambda fault: fault.line or 0))


def _frozen(value: object) -> object:
    """The same values with tuples for lists, so that strict classes can hold them unchangeable."""
    if isinstance(value, dict):
        return {key: _frozen(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return tuple(_frozen(entry) for entry in value)
    return value


def _path_in(data: object, loc: Sequence[str | int]) -> KeyPath:
    """The part of pydantic's location that exists in the data; it also names union branches and missing keys."""
    path: list[str | int] = []
    for part in loc:
        if isinstance(data, dict) and (part in data or str(part) in data):
            key = part if part in data else str(part)
            data = data[key]
            path.append(key)
        elif isinstance(data, (list, tuple)) and isinstance(part, int) and part < len(data):
            data = data[part]
            path.append(part)
    return tuple(path)


def _words(entry: Mapping[str, Any], path: KeyPath, model: type[BaseModel]) -> tuple[str, str]:
    """What is wrong, and what to do about it."""
    kind, loc, value, name = entry["type"], tuple(entry["loc"]), entry["input"], dotted(path)
    if kind == "missing":
        fix = f"add it: {_allowed_at(model, loc, path)}"
        return f"{dotted((*path, str(loc[-1])))} is missing", _misspelled(str(loc[-1]), value, model, loc) + fix
    if kind == "extra_forbidden":
        return f"unknown key {name}", _nearest_key(model, loc)
    if loc and loc[-1] == "[key]":
        key = f"the key {shown(value)} in {dotted(path[:-1])} is not valid"
        return key, f"use {_allowed_at(model, (*loc[:-2], '[key]'), path)}"
    if kind in _OWN_WORDS:
        what, _, fix = str(entry["ctx"]["error"]).partition("; ")
        plain = isinstance(value, (dict, BaseModel)) or not name or what.startswith(name)
        return what if plain else f"{name} = {shown(value)}: {what}", fix
    if kind.startswith("union_tag"):
        tag = str(entry["ctx"]["discriminator"]).strip("'")
        what = f"unknown {tag} {shown(entry['ctx']['tag'])}" if "tag" in entry["ctx"] else f"{tag} is missing"
        return f"{name}: {what}", f"use {_allowed_at(model, (*loc, tag), path)}"
    use = f"use {_allowed_at(model, loc, path)}"
    if kind in ("literal_error", "enum"):
        return f"{name} = {shown(value)} is not a valid choice", use + _near_choice(value, model, loc)
    found = f"{name} = {shown(value)}" if name and not isinstance(value, dict) else name or "the document"
    return f"{found} {_what_is_wrong(kind, value)}", use


def _what_is_wrong(kind: str, value: object) -> str:
    if kind in _OUT_OF_RANGE:
        return "is out of range"
    if kind.endswith(("too_short", "too_long", "pattern_mismatch")):
        return "is not valid"
    return f"is {kind_of(value)}"


def _allowed_at(model: type[BaseModel], loc: KeyPath, path: KeyPath) -> str:
    slots = slots_at(model, loc) or slots_at(model, path)
    return " or ".join(dict.fromkeys(allowed(slot) for slot in slots)) or "another value"


def _misspelled(name: str, table: object, model: type[BaseModel], loc: KeyPath) -> str:
    """`rename "KEY", or ` where a table that may have other keys holds one spelled much like the missing one."""
    if not isinstance(table, Mapping):
        return ""
    classes = [slot.annotation for slot in slots_at(model, loc[:-1]) if hasattr(slot.annotation, "model_fields")]
    if not classes or any(known.model_config.get("extra") != "allow" for known in classes):
        return ""
    own = {key for known in classes for key in known.model_fields}
    near = nearest(name, [key for key in table if key not in own])
    return f"rename {shown(near)}, or " if near else ""


def _near_choice(value: object, model: type[BaseModel], loc: KeyPath) -> str:
    choices = [str(choice) for slot in slots_at(model, loc) for choice in get_args(slot.annotation)]
    near = nearest(value, choices) if isinstance(value, str) else None
    return f"; did you mean {shown(near)}?" if near else ""


def _nearest_key(model: type[BaseModel], loc: KeyPath) -> str:
    tables = [slot.annotation for slot in slots_at(model, loc[:-1]) if hasattr(slot.annotation, "model_fields")]
    keys = sorted({info.alias or name for table in tables for name, info in table.model_fields.items()})
    near = nearest(str(loc[-1]), keys)
    if near:
        return f"did you mean {near}?"
    return f"valid keys are {', '.join(keys)}" if keys else "remove it"
