"""Plain words for what a configuration may hold, taken from the pydantic class that checks it."""

from __future__ import annotations

import datetime
import difflib
import json
import math
import re
import types
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.printable import printable

__all__ = ["Slot", "allowed", "dotted", "kind_of", "nearest", "printable", "shown", "slots_at"]

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_LONGEST_KEY = 80
"""Letters of a key that a message spells out."""
_SEQUENCES = (tuple, list, set, frozenset, Sequence)


class Slot(NamedTuple):
    """A place for a value: its type, the constraints on it, its unit, and words of its own in their place."""

    annotation: Any
    constraints: tuple[Any, ...] = ()
    unit: str = ""
    words: str = ""


def shown(value: object, length: int = 60) -> str:
    """A value as TOML spells it, cut to `length` characters."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, dict):
        return "a table"
    elif isinstance(value, (list, tuple)):
        text = "[" + ", ".join(shown(entry, 20) for entry in value[:8]) + (", ...]" if len(value) > 8 else "]")
    elif isinstance(value, int) and abs(value) > 10**40:
        return "a very large number"
    else:
        text = str(value)
    text = printable(text)
    return text if len(text) <= length else text[: length - 4] + " ..."


def dotted(path: Iterable[str | int]) -> str:
    """A key path as TOML spells it, list indices in brackets, from 0."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
            continue
        key = part if _BARE_KEY.fullmatch(part) and len(part) <= _LONGEST_KEY else shown(part)
        text += f".{key}" if text else key
    return text


def nearest(word: str, choices: Iterable[str]) -> str | None:
    """The choice that is spelled most like the word, if any is."""
    by_lower = {choice.lower(): choice for choice in choices}
    found = difflib.get_close_matches(word.lower(), list(by_lower), n=1, cutoff=0.6)
    return by_lower[found[0]] if found else None


def kind_of(value: object) -> str:
    """What a value is: text, a whole number, a list, ..."""
    if isinstance(value, float) and not math.isfinite(value):
        return "not a finite number"
    kinds: tuple[tuple[Any, str], ...] = (
        (type(None), "nothing"),
        (bool, "a truth value"),
        (str, "text"),
        (int, "a whole number"),
        (float, "a number with a fraction"),
        ((list, tuple), "a list"),
        (dict, "a table"),
        ((datetime.date, datetime.time), "a date or time"),
    )
    return next((name for kind, name in kinds if isinstance(value, kind)), type(value).__name__)


def allowed(slot: Slot) -> str:
    """What may stand there: `a whole number from 0 to 100`, `"SMART" or "SLIM"`, `a list of text`."""
    annotation, unit = slot.annotation, f" {slot.unit}" if slot.unit else ""
    origin = get_origin(annotation)
    if slot.words:
        return slot.words
    if origin is Annotated:
        return allowed(_annotated(annotation))
    if origin is Literal:
        return _either([shown(choice) for choice in get_args(annotation)])
    if origin in (Union, types.UnionType):
        parts = [allowed(slot._replace(annotation=part)) for part in get_args(annotation) if not _is_none(part)]
        return _either(list(dict.fromkeys(parts)))
    if annotation is bool:
        return "true or false"
    if annotation in (int, float):
        kind = "a whole number" if annotation is int else "a number"
        return f"{kind}{_interval(slot.constraints)}{unit}"
    if annotation is str or annotation is Path:
        return _text(slot, "text" if annotation is str else "a path in quotes")
    if _is_class(annotation, _SEQUENCES) or _is_class(origin, _SEQUENCES):
        entries = [part for part in get_args(annotation) if part is not Ellipsis]
        kinds = dict.fromkeys(allowed(Slot(entry)) for entry in entries)
        return f"a list{_length(slot.constraints)}" + (f", each entry {_either(list(kinds))}" if kinds else "")
    if annotation is Any:
        return "any value"
    return "a table"


def slots_at(model: type[BaseModel], path: KeyPath) -> list[Slot]:
    """What the class holds at that path; several for a union, none where it has no such place.

    The path may name branches of unions, as pydantic's locations do, and end in `[key]` for a table's keys themselves.
    """
    leaves = [Slot(model)]
    for part in path:
        below = [leaf for slot in leaves for step in _step(slot, part) for leaf in _leaves(step)]
        leaves = below or [slot for slot in leaves if _is_branch(slot.annotation, part)]
    return leaves


def _step(slot: Slot, part: str | int) -> list[Slot]:
    annotation, origin, arguments = slot.annotation, get_origin(slot.annotation), get_args(slot.annotation)
    if _is_class(annotation, BaseModel):
        for name, info in annotation.model_fields.items():
            if part in (name, info.alias):
                return [_of_field(info)]
        return []
    if _is_class(origin, Mapping) and len(arguments) == 2:
        return [Slot(arguments[1], words=allowed(Slot(arguments[0])) if part == "[key]" else "")]
    if _is_class(origin, _SEQUENCES) and isinstance(part, int):
        entries = [argument for argument in arguments if argument is not Ellipsis]
        return [Slot(entries[min(part, len(entries) - 1)])] if entries else []
    return []


def _is_branch(annotation: Any, part: str | int) -> bool:
    """Whether a union's branch is the one that pydantic calls `part`: by its class name or by its tag."""
    if not _is_class(annotation, BaseModel):
        return False
    tags = (get_args(info.annotation) for info in annotation.model_fields.values())
    return annotation.__name__ == part or any(part in tag for tag in tags)


def _leaves(slot: Slot) -> list[Slot]:
    """The slot without `Annotated` and unions around it."""
    origin = get_origin(slot.annotation)
    if origin is Annotated:
        inner = _annotated(slot.annotation)
        return _leaves(
            Slot(
                inner.annotation,
                slot.constraints + inner.constraints,
                slot.unit or inner.unit,
                slot.words or inner.words,
            )
        )
    if origin in (Union, types.UnionType):
        parts = [part for part in get_args(slot.annotation) if not _is_none(part)]
        return [leaf for part in parts for leaf in _leaves(slot._replace(annotation=part))]
    return [slot]


def _of_field(info: FieldInfo) -> Slot:
    extra = info.json_schema_extra
    known = extra if isinstance(extra, dict) else {}
    return Slot(info.annotation, tuple(info.metadata), str(known.get("unit", "")), str(known.get("words", "")))


def _annotated(annotation: Any) -> Slot:
    inner, *metadata = get_args(annotation)
    slot = Slot(inner)
    for entry in metadata:
        field = _of_field(entry) if isinstance(entry, FieldInfo) else Slot(None, (entry,))
        slot = Slot(inner, slot.constraints + field.constraints, slot.unit or field.unit, slot.words or field.words)
    return slot


def _interval(constraints: Iterable[Any]) -> str:
    low, above, high, below = (_constraint(constraints, name) for name in ("ge", "gt", "le", "lt"))
    if low is not None and high is not None:
        return f" from {_number(low)} to {_number(high)}"
    lower = f"of at least {_number(low)}" if low is not None else f"above {_number(above)}" if above is not None else ""
    upper = f"at most {_number(high)}" if high is not None else f"below {_number(below)}" if below is not None else ""
    if lower and upper:
        return f" {lower} and {upper}"
    return f" {lower}" if lower else f" of {upper}" if high is not None else f" {upper}" if upper else ""


def _length(constraints: Iterable[Any]) -> str:
    low, high = _constraint(constraints, "min_length"), _constraint(constraints, "max_length")
    if low is not None and high is not None:
        return f" of {low} to {high} entries" if low != high else f" of {low} entries"
    return f" of at least {low}" if low is not None else f" of at most {high}" if high is not None else ""


def _text(slot: Slot, kind: str) -> str:
    pattern = next((p for c in slot.constraints if (p := getattr(c, "pattern", None))), None)
    if pattern is not None:
        return f"{kind} of the form {getattr(pattern, 'pattern', pattern)}"
    return f"{kind}, not empty" if _constraint(slot.constraints, "min_length") else kind


def _constraint(constraints: Iterable[Any], name: str) -> Any:
    return next((value for c in constraints if (value := getattr(c, name, None)) is not None), None)


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def _either(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + f" or {words[-1]}"


def _is_none(annotation: Any) -> bool:
    return annotation is None or annotation is type(None)


def _is_class(candidate: Any, kinds: Any) -> bool:
    return isinstance(candidate, type) and issubclass(candidate, kinds)
