"""Which of a beam's echoes survive where there are more than the sensor returns."""

from __future__ import annotations

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel

__all__ = ["KEEP_CODES", "pick"]

_STRONGEST, _FIRST, _LAST, _STRONGEST_LAST, _FIRST_LAST, _FIRST_STRONGEST, _STRONGEST_SECOND = range(7)
KEEP_CODES = {
    "strongest": _STRONGEST,
    "first": _FIRST,
    "last": _LAST,
    "strongest_last": _STRONGEST_LAST,
    "first_last": _FIRST_LAST,
    "first_strongest": _FIRST_STRONGEST,
    "strongest_second": _STRONGEST_SECOND,
}
"""The values of `keep`, as kernels know them."""


@kernel
def _strongest_but(strength: FloatArray, n: int, order: IndexArray, taken: int) -> int:
    """The strongest of `n` echoes that are not among the first `taken` of `order`; of equal ones the nearer."""
    best = -1
    for i in range(n):
        free = True
        for j in range(taken):
            if order[j] == i:
                free = False
        if free and (best < 0 or strength[i] > strength[best]):
            best = i
    return best


@kernel
def pick(keep: int, most: int, n: int, strength: FloatArray, order: IndexArray) -> int:
    """Write which of `n` echoes, nearest first, are kept to `order`, in the order that `keep` names; how many.

    Pairs give two at most; where both name one echo the second is the strongest of the others.
    """
    kept = min(most, n)
    if keep in (_FIRST, _LAST):
        for j in range(kept):
            order[j] = j if keep == _FIRST else n - 1 - j
        return kept
    if keep != _STRONGEST:
        kept = min(kept, 2)
    for j in range(kept):
        order[j] = _strongest_but(strength, n, order, j)
    if keep in (_FIRST_LAST, _FIRST_STRONGEST):
        strongest = order[0]
        order[0] = 0
        if kept > 1:
            second = n - 1 if keep == _FIRST_LAST else strongest
            order[1] = second if second != 0 else _strongest_but(strength, n, order, 1)
    elif keep == _STRONGEST_LAST and kept > 1 and order[0] != n - 1:
        order[1] = n - 1
    return kept
