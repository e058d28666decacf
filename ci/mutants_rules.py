"""What `mutants_sites.py` leaves alone: statements that give no result, and errors that cannot change one."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import TypeGuard

_SILENT_CALLS = {"debug", "info", "warning", "error", "warn", "progress", "parameter", "list_parameter"}
_SILENT_CALLS |= {"choice_parameter", "file_parameter", "isinstance", "cast", "TypeVar", "getLogger"}
_SILENT_CALLS |= {"get_close_matches", "errstate", "narrow"}
_SILENT_CALLS |= {"run_external", "simulate_on_cuda", "reference_echoes"}
_CHECKS = ("check", "_check", "_refuse", "refuse", "needs")
_TEXTS = {"__repr__", "__str__", "__hash__", "__getstate__", "__post_init__", "to_dict", "in_words"}
_ELSEWHERE = {"draw_avalanches", "count_beams", "trace_beams", "light_after_effects", "_stored", "affordable"}
_ELSEWHERE |= {"simulate_frames"}
"""Functions that give no echoes: traces and light for plots and for the search of what a model lacks; whether a file of
the library is sound, and whether it pays. And frames that programs are asked for at once."""
_ROUNDS = {"philox", "philox_round", "_wide_product", "_high_word_of"}
"""The rounds of the random numbers: others are as random; tests hold them to known answers."""
_NOT_HERE = ("TYPE_CHECKING", ", Program)", "model.external is not None")
"""What is asked before a branch that nothing of this package runs in: somebody else's program does."""
_NAMES = {"__all__", "tree", "name", "empirical", "_KNOT_LIMIT", "_CHUNK", "CHUNK", "_BLOCK", "_KEPT", "_WORTH_BEAMS"}
_NAMES |= {"_ROOM"}
"""Names whose value is no result: texts, bounds, and how much is worked on at a time or kept for the next time."""
_REAL = re.compile(r"(.*_)?(m|mm|ns|deg|rad|signal|uniforms?|draws?|drawn|draw_before|draw_behind|chance|rates?|share)")
"""Words of real numbers: a unit, a share, a rate, a random number."""
_TINY = 1e-6


def is_silent(statement: ast.stmt, *, inside: bool) -> bool:
    """Whether it is a check, a text, a declaration, or gives no echoes."""
    if isinstance(statement, ast.FunctionDef):
        what = ast.unparse(statement.returns) if statement.returns else ""
        return (
            statement.name in _TEXTS | _ELSEWHERE | _ROUNDS
            or statement.name.startswith(_CHECKS)
            or what.endswith("Error")
        )
    if isinstance(statement, ast.If):
        asked = ast.unparse(statement.test)
        return isinstance(statement.body[-1], ast.Raise) or any(word in asked for word in _NOT_HERE)
    if isinstance(statement, ast.Expr):
        checks = isinstance(statement.value, ast.Call) and called(statement.value.func).startswith(_CHECKS)
        return isinstance(statement.value, ast.Constant) or is_silent_call(statement.value) or checks
    if isinstance(statement, ast.AnnAssign) and not inside:
        return True  # a field of a class: a parameter with its bounds, or what stands there unless something is given
    if isinstance(statement, ast.Assign):
        names = ast.unparse(statement.targets[0])
        return names in _NAMES or names in ("(_M0, _M1)", "(_W0, _W1)") or is_silent_call(statement.value)
    return isinstance(statement, ast.Raise | ast.Assert | ast.Import | ast.ImportFrom | ast.Global | ast.Nonlocal)


def spares_work(statement: ast.stmt, known: frozenset[str]) -> bool:
    """Whether it hands back what came in where one of several reasons says that nothing is to be done: with all of
    them asked for, more work comes to the same."""
    if not (isinstance(statement, ast.If) and isinstance(statement.test, ast.BoolOp)):
        return False
    [first, *more] = statement.body
    back = isinstance(first, ast.Return) and isinstance(first.value, ast.Name) and first.value.id in known
    return back and not more and isinstance(statement.test.op, ast.Or)


def is_silent_call(node: ast.AST) -> bool:
    """Whether it declares, logs or tells progress."""
    return isinstance(node, ast.Call) and called(node.func) in _SILENT_CALLS


def called(function: ast.expr) -> str:
    """The last word of what is called."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def stands_in(node: ast.AST) -> bool:
    """Whether it is what the largest of nothing is taken to be, or whether lengths are checked."""
    return isinstance(node, ast.keyword) and node.arg in ("initial", "default", "strict")


def is_key_of_beams(node: ast.AST) -> TypeGuard[ast.BinOp]:
    """Whether it is a beam's number, by which tables are sorted: any shift beyond the points gives the same order."""
    return isinstance(node, ast.BinOp) and isinstance(node.op, ast.LShift) and ast.unparse(node.right) == "32"


def is_draw(node: ast.Call) -> bool:
    """Whether it keys or draws random numbers of beams: with layer and point exchanged they are others, as random."""
    return called(node.func) in ("uniforms", "beam_keys")


def is_tiny(value: float) -> bool:
    """Whether a constant only guards a division or a rounding: twice as much is as small."""
    return isinstance(value, float) and 0.0 < abs(value) <= _TINY


def are_reals(node: ast.Compare) -> bool:
    """Whether real numbers are compared, which are as good as never equal: `<` and `<=` are then the same.

    0 is something else: it says that there is nothing.
    """
    sides = (node.left, *node.comparators)
    if any(isinstance(side, ast.Constant) and not side.value for side in sides):
        return False
    parts = [part for side in sides for part in _counted_out(side)]
    words = [getattr(part, "id", getattr(part, "attr", "")) for part in parts]
    fractions = [isinstance(part, ast.Constant) and isinstance(part.value, float) and part.value for part in parts]
    return any(fractions) or any(_REAL.fullmatch(word) for word in words if word)


def _counted_out(node: ast.AST) -> Iterator[ast.AST]:
    """A node and all in it but what is only counted: `len(rates)` is a whole number."""
    yield node
    if not (isinstance(node, ast.Call) and called(node.func) == "len"):
        for child in ast.iter_child_nodes(node):
            yield from _counted_out(child)
