"""Kernels that other kernels call, as parts of those: optimised and made into machine code once, not at each level.

numba makes every function a library of its own, which it optimises and makes into machine code, then links it into each
of its callers, where all of that happens again, at every level. Here a called kernel is lowered to LLVM's language and
left at that; numba links it into the kernel that Python calls, where all is optimised at once.

This leans on numba's insides, so only versions that it was tested with take part. Others compile in numba's own way, to
the same results.
"""

from __future__ import annotations

from typing import Any

import numba
from numba.core import compiler, typing

__all__ = ["are_possible", "as_part"]

_TESTED = {"0.68.1"}
_compiler: Any = compiler
_typing: Any = typing


def are_possible() -> bool:
    """Whether this version of numba is known to take them."""
    return numba.__version__ in _TESTED


def as_part(dispatcher: Any) -> None:
    """Have other kernels take this one as a part; what Python calls, and keeps on disk, stays numba's own."""
    part = _Part(dispatcher)
    dispatcher.get_call_template, dispatcher.get_overload = part.get_call_template, part.get_overload


class _Part:
    """What numba asks a kernel for when it compiles a call of it from another one."""

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._lowered: dict[tuple[Any, ...], Any] = {}

    def get_call_template(self, args: Any, keywords: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        """The signature for arguments of these types."""
        signature, kinds = self._dispatcher.fold_argument_types(args, keywords)
        name, found = self._dispatcher.__name__, self._result(kinds)
        template = _typing.make_concrete_template(name, key=name, signatures=[found.signature])
        return template, signature, kinds, {}

    def get_overload(self, kinds: Any) -> Any:
        """By what numba finds the code to call: the library stands for it, since there is no function in Python."""
        return self._result(kinds).library

    def _result(self, kinds: Any) -> Any:
        kinds = tuple(kinds)
        if kinds not in self._lowered:
            self._lowered[kinds] = _lower(self._dispatcher, kinds)
        return self._lowered[kinds]


def _lower(dispatcher: Any, kinds: tuple[Any, ...]) -> Any:
    """Compile a kernel as far as LLVM's language; whoever calls it links all that it needs with it."""
    target, flags = dispatcher.targetdescr, _compiler.Flags()
    target.options.parse_as_flags(flags, dispatcher.targetoptions)
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    context = target.target_context
    library = context.codegen().create_library(dispatcher.__qualname__)
    found = _compiler.compile_extra(
        target.typing_context, context, dispatcher.py_func, kinds, None, flags, {}, library=library
    )
    library._finalized = True  # as it is: neither optimised nor linked
    needed = dict.fromkeys([library, *library._linking_libraries])
    context.insert_user_function(library, found.fndesc, list(needed))
    return found
