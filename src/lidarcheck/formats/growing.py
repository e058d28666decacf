"""A column that is read in pieces, in little more memory than it takes as a whole."""

from __future__ import annotations

import numpy as np

from lidarcheck.formats.table import Column

__all__ = ["EXACT_IN_FLOAT", "INEXACT", "GrowingColumn"]

EXACT_IN_FLOAT = 2**53
INEXACT = "of whole numbers beyond 2^53 and of others, which no 64-bit type holds together"
SPARE = 1.02
"""Rows that room is made for, by those that are expected: memory that is not written to costs nothing."""


class GrowingColumn:
    """Values that further ones are added to, in a type that holds them all exactly."""

    def __init__(self) -> None:
        self._array: Column = np.empty(0, dtype=np.float64)
        self._size = 0

    @property
    def values(self) -> Column:
        """The values so far, shape (n,)."""
        return self._array[: self._size]

    def add(self, piece: Column, left: float) -> bool:
        """Add a piece, `left` as much of the file being left; false where no type holds old and new values exactly."""
        end = self._size + len(piece)
        kind = piece.dtype if not self._size else _common(self.values, piece)
        if kind is None:
            return False
        if end > len(self._array) or kind != self._array.dtype:
            room = max(int((end + len(piece) * left) * SPARE) if left else end, end)
            array = np.empty(room, dtype=kind)
            array[: self._size] = self.values
            self._array = array
        self._array[self._size : end] = piece
        self._size = end
        return True


def _common(old: Column, new: Column) -> np.dtype[np.generic] | None:
    """The type that holds both exactly; None where there is none."""
    kinds = {old.dtype, new.dtype}
    if len(kinds) == 1 or not len(new):
        return old.dtype
    wholes = [column for column in (old, new) if column.dtype.kind != "f"]
    low, high = min(int(column.min()) for column in wholes), max(int(column.max()) for column in wholes)
    if len(wholes) == 2:
        return np.dtype(np.uint64) if low >= 0 else None
    return np.dtype(np.float64) if max(-low, high) <= EXACT_IN_FLOAT else None
