"""Whole numbers of 64 bits in compiled code: their products in 128 bits, and how many leading bits are 0.

Imported by need alone, since compilers take a while to load.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

__all__ = ["wide_product", "zeros_before"]


def _product(typing_context: Any, one: Any, other: Any) -> Any:
    """The upper and the lower 64 bits of a product of two numbers of 64 bits."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        wide = ir.IntType(128)
        product = builder.mul(*(builder.zext(arg, wide) for arg in args))
        high = builder.trunc(builder.lshr(product, ir.Constant(wide, 64)), ir.IntType(64))
        return context.make_tuple(builder, signature.return_type, [high, builder.trunc(product, ir.IntType(64))])

    pair: Any = types.UniTuple
    return pair(types.uint64, 2)(types.uint64, types.uint64), codegen


def _leading_zeros(typing_context: Any, number: Any) -> Any:
    """How many bits stand before the first that is set."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ctlz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), codegen


wide_product: Any = intrinsic(_product)
zeros_before: Any = intrinsic(_leading_zeros)
