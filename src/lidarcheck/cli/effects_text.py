"""What there is to say about an effect: for a person, for JSON, and for the documentation."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.terminal import Column, paragraphs, table

if TYPE_CHECKING:
    from lidarcheck.effects import Effect

__all__ = ["TREE", "example", "explanation", "facts", "listing", "node_names"]

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

ALL = (Column("effect"), Column("stage"), Column("what it does to the data"))
ONE = (
    Column("parameter"),
    Column("unit"),
    Column("lowest", right=True),
    Column("highest", right=True),
    Column("typical", right=True),
    Column("meaning"),
)
FILES = (Column("file"), Column("kind"), Column("meaning"))


def facts(effect: type[Effect]) -> dict[str, Any]:
    """For JSON."""
    return {
        "name": effect.name,
        "stage": effect.stage,
        "summary": effect.summary(),
        "description": inspect.getdoc(effect) or "",
        "tree": list(effect.tree),
        "parameters": {p.name: p.to_dict() | {"whole": p.whole} for p in effect.parameters()},
        "files": {f.name: f.to_dict() for f in effect.files()},
    }


def listing(chosen: Mapping[str, type[Effect]]) -> str:
    """A table of effects, a line each."""
    return table(ALL, [(effect.name, effect.stage, effect.summary()) for effect in chosen.values()])


def explanation(effect: type[Effect], picture: str = "") -> str:
    """All about one effect; `picture` shows what it does. What a model file says stands last, alone."""
    parts = [f"{effect.name} ({effect.stage})\n", f"{paragraphs(inspect.getdoc(effect) or '')}\n"]
    parts.append(f"{paragraphs(f'Effect tree (PerCollECT/LidarLimbs): {node_names(effect)}')}\n")
    rows = [(p.name, p.unit, f"{p.low:g}", f"{p.high:g}", f"{p.typical:g}", p.meaning) for p in effect.parameters()]
    if rows:
        parts.append(table(ONE, rows))
    files = [(f.name, f.kind, f.meaning) for f in effect.files()]
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
    """How a model file asks for an effect: its typical values, and its files as comments."""
    lines = ["[[effects]]", f'name = "{effect.name}"']
    lines += [f"{p.name} = {p.typical!r}" for p in effect.parameters()]
    lines += [f'# {f.name} = "tables.ini"  # {f.meaning}' for f in effect.files()]
    return "".join(f"{indent}{line}\n" for line in lines)
