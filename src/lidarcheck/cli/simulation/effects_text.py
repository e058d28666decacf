"""What there is to say about an effect: for a person, for JSON, and for the documentation."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.terminal import columns, paragraphs, table

if TYPE_CHECKING:
    from lidarcheck.effects import Effect

__all__ = ["EMPIRICAL", "TREE", "example", "explanation", "facts", "listing", "node_names"]

TREE: Mapping[int, str] = {
    72: "blooming",
    84: "crosstalk",
    86: "sunlight",
    87: "extinction",
    89: "backscatter",
    101: "shot noise",
    102: "motion scan",
    105: "multi-echo",
    108: "multipath",
    109: "broadened pulse",
    118: "split beam",
    142: "saturation",
}
"""Nodes of the perception-sensor effect tree PerCollECT/LidarLimbs that effects are named by."""

EMPIRICAL = "empirical: describes, does not explain"
"""What is said of every term that is no effect of the catalogue."""

ALL = columns("effect", "stage", "what it does to the data")
_NUMBERS = ("lowest", "highest", "typical", "noticeable")
ONE = columns("parameter", "unit", *_NUMBERS, "meaning", right=_NUMBERS)
LISTS = columns(
    "list", "unit", "lowest", "highest", "noticeable", "example", "meaning", right=("lowest", "highest", "noticeable")
)
WORDS = columns("word", "one of", "example", "meaning")
FILES = columns("file", "kind", "noticeable", "meaning", right=("noticeable",))


def facts(effect: type[Effect]) -> dict[str, Any]:
    """For JSON; of an empirical term also that it is one, its lists and its words."""
    more = {
        "empirical": True,
        "lists": {p.name: p.to_dict() for p in effect.lists()},
        "choices": {p.name: p.to_dict() for p in effect.choices()},
    }
    return {
        "name": effect.name,
        "stage": effect.stage,
        "summary": effect.summary(),
        "description": inspect.getdoc(effect) or "",
        "tree": list(effect.tree),
        "detectors": list(effect.detectors()),
        "unfit": dict(effect.unfit),
        "around_program": effect.around_program(),
        "parameters": {p.name: p.to_dict() | {"whole": p.whole} for p in effect.parameters()},
        "files": {f.name: f.to_dict() for f in effect.files()},
    } | (more if effect.empirical else {})


def listing(chosen: Mapping[str, type[Effect]], terms: Mapping[str, type[Effect]] | None = None) -> str:
    """A table of effects, a line each; empirical terms apart, in a table of their own."""
    effects = table(ALL, [_line(effect) for effect in chosen.values()])
    return f"{effects}\n{EMPIRICAL}\n{table(ALL, [_line(term) for term in terms.values()])}" if terms else effects


def _line(effect: type[Effect]) -> tuple[str, str, str]:
    summary = effect.summary().removeprefix("Empirical: ")
    return effect.name, effect.stage, summary[:1].upper() + summary[1:]


def explanation(effect: type[Effect], picture: str = "") -> str:
    """All about one effect; `picture` shows what it does. What a model file says stands last, alone."""
    kind = f"{effect.stage}; {EMPIRICAL}" if effect.empirical else effect.stage
    parts = [f"{effect.name} ({kind})\n", f"{paragraphs(inspect.getdoc(effect) or '')}\n"]
    parts.append(f"{paragraphs(f'Effect tree (PerCollECT/LidarLimbs): {node_names(effect)}')}\n")
    parts += [f"{paragraphs(f'Not for the detector {kind}: {reason}.')}\n" for kind, reason in effect.unfit.items()]
    if outside := effect.around_program():
        parts.append(f"{paragraphs(f'Around a program ([external]): {outside}.')}\n")
    rows = [
        (p.name, p.unit, f"{p.low:g}", p.highest, f"{p.typical:g}", f"{p.noticeable:g}", p.meaning)
        for p in effect.parameters()
    ]
    if rows:
        parts.append(table(ONE, rows))
    words = [(p.name, ", ".join(p.choices), p.example or "", p.meaning) for p in effect.choices()]
    if words:
        parts.append(table(WORDS, words))
    lists = [
        (p.name, p.unit, *(f"{number:g}" for number in (p.low, p.high, p.noticeable)), _numbers(p.example), p.meaning)
        for p in effect.lists()
    ]
    if lists:
        parts.append(table(LISTS, lists))
    files = [(f.name, f.kind, f"{100.0 * f.noticeable:g} %", f.meaning) for f in effect.files()]
    if files:
        parts.append(table(FILES, files))
    if picture:
        parts.append(picture)
    parts.append(f"In a model file:\n{example(effect, '  ')}")
    return "\n".join(parts)


def node_names(effect: type[Effect]) -> str:
    """The effect's nodes in the effect tree, in words."""
    named = [f"{node} {TREE[node]}" if node in TREE else str(node) for node in effect.tree]
    return ", ".join(named) or "it has no node for this"


def example(effect: type[Effect], indent: str = "") -> str:
    """How a model file asks for an effect: its typical values and examples, and its files as comments."""
    lines = ["[[effects]]", f'name = "{effect.name}"']
    lines += [f"{p.name} = {p.typical!r}" for p in effect.parameters()]
    lines += [f"{name} = {_toml(value)}" for name, value in effect.example().items()]
    lines += [f'# {f.name} = "tables.ini"  # {f.meaning}' for f in effect.files()]
    return "".join(f"{indent}{line}\n" for line in lines)


def _toml(value: str | tuple[float, ...]) -> str:
    return f'"{value}"' if isinstance(value, str) else _numbers(value)


def _numbers(values: tuple[float, ...]) -> str:
    return f"[{', '.join(map(repr, values))}]" if values else ""
