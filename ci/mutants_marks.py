"""Which lines of compiled kernels run: marks put into them before they are compiled, where nothing else can look.

`put(package)` before anything of the package is imported: from then on each kernel of the model and the effects sets a
byte where it enters a block, and behind a statement that it may have left from. The numbers that kernels work out stay
the same. The bytes lie at one address in every process, so that compiled kernels can be kept.
"""

from __future__ import annotations

import ast
import ctypes
import importlib.machinery
import mmap
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

NAME = "_mark_"
_ADDRESS, _BYTES = 0x2000_0000_0000, 1 << 20
_MAP_FIXED_NOREPLACE = 0x100000
_KERNELS = {"kernel", "inlined"}
_first: dict[str, int] = {}
"""Of each file, the number of its line 0: of a line, that and its own."""
_lines: dict[str, dict[int, set[int]]] = {}
"""Of each file, the numbers of its marks, and the lines that run with them."""


def put(package: Path) -> None:
    """Mark the kernels of all files that are imported from here on; kept bytecode of them is neither read nor made."""
    files, number = sorted(path for part in ("model", "effects") for path in (package / part).rglob("*.py")), 0
    for path in files:
        _first[str(path)], _lines[str(path)] = number, {}
        number += len(path.read_bytes().splitlines()) + 1
    room = ctypes.CDLL(None).mmap
    room.restype = ctypes.c_void_p
    room.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
    how = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_FIXED_NOREPLACE
    if number > _BYTES or room(_ADDRESS, _BYTES, mmap.PROT_READ | mmap.PROT_WRITE, how, -1, 0) != _ADDRESS:
        raise MemoryError("no room for the marks of kernels")
    sys.dont_write_bytecode, sys.pycache_prefix = True, str(package / "no bytecode")
    importlib.machinery.SourceFileLoader.source_to_code = _compiled  # type: ignore[method-assign]


def clear() -> None:
    """Nothing has run."""
    if _first:
        ctypes.memset(_ADDRESS, 0, _BYTES)


def found() -> dict[str, set[int]]:
    """The lines of kernels that have run since, by file."""
    ran = ctypes.string_at(_ADDRESS, _BYTES) if _first else b""
    return {path: {n for number, some in marks.items() if ran[number] for n in some} for path, marks in _lines.items()}


@intrinsic
def mark(context: Any, number: Any) -> Any:
    """Set that byte, from within a kernel."""

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        word = ir.IntType(64)
        address = builder.add(given[0], ir.Constant(word, _ADDRESS))
        builder.store(ir.Constant(ir.IntType(8), 1), builder.inttoptr(address, ir.IntType(8).as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64), code


def _compiled(self: Any, data: Any, path: Any, *, _optimize: int = -1) -> Any:
    if str(path) not in _first:
        return compile(data, path, "exec", dont_inherit=True, optimize=_optimize)
    return compile(marked(data, str(path)), path, "exec", dont_inherit=True, optimize=_optimize)


def marked(source: bytes, path: str) -> ast.Module:
    """A module whose kernels have marks in them; every line keeps its number."""
    tree = ast.parse(source)
    kernels = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and _is_kernel(node)]
    for function in kernels:
        function.body = list(_with_marks(function.body, path))
    if kernels:
        behind = max(k for k, node in enumerate(tree.body) if isinstance(node, ast.ImportFrom)) + 1
        given = ast.ImportFrom(__name__, [ast.alias("mark", NAME)], 0)
        tree.body.insert(behind, ast.copy_location(given, tree.body[behind - 1]))
    return ast.fix_missing_locations(tree)


def _is_kernel(node: ast.FunctionDef) -> bool:
    return any(isinstance(one, ast.Name) and one.id in _KERNELS for one in node.decorator_list)


def _with_marks(body: list[ast.stmt], path: str) -> Iterator[ast.stmt]:
    """The statements of a block, with a mark before each that may not run though the one before has run."""
    fresh, number = True, 0
    for statement in body:
        if fresh:
            number = _first[path] + statement.lineno
            _lines[path][number] = set()
            call = ast.Call(ast.Name(NAME, ast.Load()), [ast.Constant(number)], [])
            yield ast.copy_location(ast.Expr(call), statement)
        inner: list[ast.stmt] = getattr(statement, "body", [])
        last = inner[0].lineno - 1 if inner else statement.end_lineno or 0
        _lines[path][number].update(range(statement.lineno, max(last, statement.lineno) + 1))
        for name in ("body", "orelse"):
            if getattr(statement, name, []):
                setattr(statement, name, list(_with_marks(getattr(statement, name), path)))
        fresh = bool(inner)
        yield statement
