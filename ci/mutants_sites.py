"""Where an error can be put into the source, and what stands there then: `drawn` takes some of all `sites`."""

from __future__ import annotations

import ast
import copy
import itertools
import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutants_rules import (
    are_reals,
    called,
    is_draw,
    is_key_of_beams,
    is_silent,
    is_silent_call,
    is_tiny,
    spares_work,
    stands_in,
)

KINDS = ("comparison", "constant", "arithmetic", "dropped", "swapped")
SKIPPED = (
    "effects/search",  # what a search must know of an effect
    "effects/base.py",  # how effects are declared, found and described
    "effects/finding.py",
    "effects/parameters.py",  # bounds and help texts of parameters
    "effects/plugins.py",
    "model/__init__.py",  # names for those who import them
    "model/cuda",  # needs a GPU
    "model/external",  # another program and its files
    "model/fidelity.py",  # checks of what a user asks
    "model/files",
    "model/incremental.py",  # what inference keeps of a frame
    "model/fast/store.py",  # where the library of echoes lies
    "model/lane_math.py",  # exponentials and logarithms, as `elementary`: tests hold them to the last digits
    "model/reference.py",  # minutes a scenario; the exact chain is held to it by tests, and it by them to the chain
    "model/spec.py",  # a model with or without an effect, for inference
    "model/sharing.py",  # which thread does what
    "model/trace.py",  # expected traces, for plots
    "model/showcase",  # demonstrations of `lidarcheck effects`
)
"""Files that change no echoes, or whose echoes no scenario has."""

_COMMUTE = {"minimum", "maximum", "min", "max", "hypot", "isclose", "logaddexp", "dot", "gcd", "einsum", "whole"}
_COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_CALCULATED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
    ast.MatMult: ast.Mult,
}


@dataclass(frozen=True)
class Mutant:
    """An error in `file`, below `src/lidarcheck`: `was` becomes `now` where `line` of the source becomes `then`.

    `row`: the first row of that line; `lines`: first and last row of the statement, of a compound one its head;
    `inside`: whether that is in a function, so that it runs when this is called; `begin`, `end`: the bytes replaced.
    """

    file: str
    kind: str
    row: int
    line: str
    then: str
    was: str
    now: str
    lines: tuple[int, int]
    inside: bool
    begin: int
    end: int

    def __str__(self) -> str:
        return f"{self.file}:{self.row}: {self.kind}: {self.was} -> {self.now} in {self.line}"

    def applied(self, source: bytes) -> bytes:
        """The source with the error."""
        return source[: self.begin] + self.now.encode() + source[self.end :]


def drawn(package: Path, seed: int, count: int, only: str = "") -> list[Mutant]:
    """`count` mutants of the model and the effects, as many of each kind, the same for the same seed.

    Files are alike, however long: the law of an effect has few lines. `only`: in files in whose path it occurs.
    """
    draw = random.Random(seed)
    kinds = _piles(package, only)
    taken: list[_Site] = []
    while len(taken) < count and any(kinds.values()):
        for pile in kinds.values():
            if pile:
                of_file = pile[draw.randrange(len(pile))]
                taken.append(of_file.pop(draw.randrange(len(of_file))))
                pile[:] = [of_file for of_file in pile if of_file]
    return [site.mutant() for site in taken[:count]]


def piles(package: Path, only: str = "") -> dict[str, list[list[Mutant]]]:
    """All mutants, by kind and file: what `drawn` draws from."""
    kinds = _piles(package, only).items()
    return {kind: [[site.mutant() for site in of_file] for of_file in pile] for kind, pile in kinds}


def _piles(package: Path, only: str) -> dict[str, list[list[_Site]]]:
    files = [path for part in ("effects", "model") for path in sorted((package / part).rglob("*.py"))]
    names = {path.relative_to(package).as_posix(): path for path in files}
    found = [site for name, path in names.items() if not _skipped(name) for site in _sites(name, path.read_bytes())]
    return {kind: _by_file(site for site in found if site.kind == kind and only in site.file.name) for kind in KINDS}


def _by_file(found: Iterable[_Site]) -> list[list[_Site]]:
    return [list(group) for _, group in itertools.groupby(found, key=lambda site: site.file.name)]


def sites(file: str, source: bytes) -> list[Mutant]:
    """All errors that this file can be given: each differs from the source, and is Python."""
    return [site.mutant() for site in _sites(file, source)]


def _skipped(name: str) -> bool:
    return any(name == skipped or name.startswith(f"{skipped}/") for skipped in SKIPPED)


class _File:
    """A source file, and where its lines begin."""

    def __init__(self, name: str, source: bytes) -> None:
        self.name, self.source = name, source
        self.rows = source.decode().splitlines()
        self.starts = list(itertools.accumulate((len(row) for row in source.splitlines(keepends=True)), initial=0))

    def at(self, node: ast.AST) -> tuple[int, int]:
        """The bytes of a node, first and after the last."""
        place: Any = node
        return (
            self.starts[place.lineno - 1] + place.col_offset,
            self.starts[place.end_lineno - 1] + place.end_col_offset,
        )


@dataclass(frozen=True)
class _Site:
    file: _File
    kind: str
    place: _Place
    changed: ast.AST

    def mutant(self) -> Mutant:
        place = self.place
        node: Any = place.node
        begin, end = self.file.at(node)
        now = ast.unparse(self.changed)
        now = now if isinstance(node, ast.stmt) or isinstance(self.changed, ast.Name) else f"({now})"
        first, behind = self.file.starts[node.lineno - 1], self.file.starts[node.end_lineno]
        source = self.file.source
        return Mutant(
            file=self.file.name,
            kind=self.kind,
            row=node.lineno,
            line=_joined(source[first:behind]),
            then=_joined(source[first:begin] + now.encode() + source[end:behind]),
            was=_joined(source[begin:end]),
            now=now,
            lines=place.lines,
            inside=place.inside,
            begin=begin,
            end=end,
        )


def _joined(source: bytes) -> str:
    """In one line."""
    return " ".join(source.decode().split())


def _sites(name: str, source: bytes) -> list[_Site]:
    file = _File(name, source)
    return [
        _Site(file, kind, place, changed)
        for place in _places(ast.parse(source).body, inside=False)
        for kind, changed in _changes(place.node, place.known)
    ]


@dataclass(frozen=True)
class _Place:
    node: ast.AST
    lines: tuple[int, int]
    inside: bool
    known: frozenset[str]
    """Names that the function has already given a value to."""


def _places(body: list[ast.stmt], *, inside: bool, known: frozenset[str] = frozenset()) -> Iterator[_Place]:
    """Statements and expressions of a body that can change results."""
    for statement in body:
        if is_silent(statement, inside=inside):
            continue
        if isinstance(statement, ast.FunctionDef):
            given = statement.args
            names = {argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)}
            yield from _places(statement.body, inside=True, known=frozenset(names))
        elif isinstance(statement, ast.ClassDef):
            yield from _places(statement.body, inside=False)
        else:
            head = _head(statement)
            lines = (statement.lineno, max(_end(node) for node in head) if head else statement.lineno)
            if not hasattr(statement, "body"):
                yield _Place(statement, (statement.lineno, _end(statement)), inside, known)
            sparing = spares_work(statement, known)
            for node in head:
                for part in _expressions(node):
                    if not (sparing and part is node):
                        yield _Place(part, lines, inside, known)
            for block in ("body", "orelse", "finalbody"):
                yield from _places(getattr(statement, block, []), inside=inside, known=known)
            known = known | {node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and _stored(node)}


def _head(statement: ast.stmt) -> list[ast.expr]:
    """The expressions that a statement evaluates itself, without its annotation and the statements below it."""
    parts: list[ast.expr] = []
    for name, value in ast.iter_fields(statement):
        if name != "annotation":
            parts += [item for item in (value if isinstance(value, list) else [value]) if isinstance(item, ast.expr)]
            parts += [
                item.context_expr
                for item in (value if isinstance(value, list) else [])
                if hasattr(item, "context_expr")
            ]
    return parts


def _expressions(node: ast.AST) -> Iterator[ast.expr]:
    """An expression and all in it that is no text."""
    if isinstance(node, ast.JoinedStr) or is_silent_call(node) or stands_in(node):
        return
    if isinstance(node, ast.expr):
        yield node
    for child in [node.left] if is_key_of_beams(node) else ast.iter_child_nodes(node):
        yield from _expressions(child)


def _stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _end(node: ast.AST) -> int:
    return getattr(node, "end_lineno", 0) or 0


def _changes(node: ast.AST, known: frozenset[str]) -> Iterator[tuple[str, ast.AST]]:
    """What can stand in the place of a node, by kind; nodes inside it are asked for themselves."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        others = _COMPARED[type(node.ops[0])]
        for other in others[1:] if are_reals(node) else others:
            yield "comparison", _with(node, ops=[other()])
    elif isinstance(node, ast.BoolOp):
        yield "comparison", _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "comparison", node.operand
    elif isinstance(node, ast.Constant) and type(node.value) in (bool, int, float):
        for value in _others(node.value):
            yield "constant", ast.Constant(value)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "arithmetic", node.operand
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in _CALCULATED and not _of_texts(node):
        yield "arithmetic", _with(node, op=_CALCULATED[type(node.op)]())
    elif isinstance(node, ast.Call) and called(node.func) not in _COMMUTE:
        for at in range(len(node.args) - 1):
            first, second = node.args[at : at + 2]
            same = ast.dump(first) == ast.dump(second) or (at == 0 and is_draw(node))
            if not same and not isinstance(first, ast.Starred) and not isinstance(second, ast.Starred):
                yield "swapped", _with(node, args=[*node.args[:at], second, first, *node.args[at + 2 :]])
    if isinstance(node, ast.stmt) and _can_be_dropped(node, known):
        yield "dropped", ast.Pass()


def _others(value: bool | int | float) -> tuple[bool | int | float, ...]:
    if isinstance(value, bool):
        return (not value,)
    if is_tiny(value):
        return ()
    if isinstance(value, int):
        return (value + 1, value - 1) if value > 0 else (value + 1,)
    return (1.1 * value, 2.0 * value) if value and value * 2.0 not in (value, 0.0) else (1.0,)


def _can_be_dropped(node: ast.stmt, known: frozenset[str]) -> bool:
    """Whether what follows still has the names it needs."""
    if isinstance(node, ast.AugAssign | ast.Expr | ast.Break | ast.Continue):
        return True
    if not isinstance(node, ast.Assign):
        return False
    names = [
        part for target in node.targets for part in ast.walk(target) if isinstance(part, ast.Name) and _stored(part)
    ]
    return all(name.id in known for name in names)


def _of_texts(node: ast.BinOp | ast.AugAssign) -> bool:
    parts = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.value,)
    return any(isinstance(part, ast.JoinedStr) or isinstance(getattr(part, "value", None), str) for part in parts)


def _with(node: ast.AST, **fields: object) -> ast.AST:
    changed = copy.copy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed
