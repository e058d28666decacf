"""`lidarcheck effects`: what a model can name."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.options import JsonFlag, Quiet
from lidarcheck.cli.outputs import json_text
from lidarcheck.cli.terminal import Column, emit, hush, paragraphs, table

if TYPE_CHECKING:
    from lidarcheck.effects import Effect

__all__ = ["effects"]

ALL = (Column("effect"), Column("stage"), Column("what it does to the data"))
ONE = (
    Column("parameter"),
    Column("unit"),
    Column("lowest", right=True),
    Column("highest", right=True),
    Column("typical", right=True),
    Column("meaning"),
)


def effects(
    name: Annotated[str | None, Parameter(help="The effect to explain; all by default.")] = None,
    /,
    *,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """List the effects that a model can name, or explain one."""
    hush(quiet)
    from lidarcheck.effects import catalogue, find

    chosen = catalogue() if name is None else {name: find(name)}
    if json:
        facts = [_facts(effect) for effect in chosen.values()]
        emit(json_text(facts if name is None else facts[0]))
    elif name is None:
        emit(_list(chosen))
    else:
        emit(_explain(chosen[name]))
    return 0


def _facts(effect: type[Effect]) -> dict[str, Any]:
    return {
        "name": effect.name,
        "stage": effect.stage,
        "summary": effect.summary(),
        "description": inspect.getdoc(effect) or "",
        "parameters": {p.name: p.to_dict() for p in effect.parameters()},
    }


def _list(chosen: Mapping[str, type[Effect]]) -> str:
    return table(ALL, [(effect.name, effect.stage, effect.summary()) for effect in chosen.values()])


def _explain(effect: type[Effect]) -> str:
    rows = [(p.name, p.unit, f"{p.low:g}", f"{p.high:g}", f"{p.typical:g}", p.meaning) for p in effect.parameters()]
    text = f"{effect.name} ({effect.stage})\n\n{paragraphs(inspect.getdoc(effect) or '')}\n\n"
    example = "\n".join([f'  name = "{effect.name}"', *(f"  {p.name} = {p.typical:g}" for p in effect.parameters())])
    return f"{text}{table(ONE, rows)}\nIn a model file:\n  [[effects]]\n{example}\n"
