"""What a cell looks like: braille, blocks, or one ASCII character, by what the terminal can show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, IndexArray
from lidarcheck.tui.plots.raster import ACROSS, DOWN
from lidarcheck.tui.widgets.seven_bit import is_seven_bit

__all__ = ["LETTERS", "LEVELS", "MARKS", "Level", "Marks", "glyphs", "level_of"]

Marks = Literal["braille", "blocks", "ascii", "char"]
MARKS: tuple[Marks, ...] = ("braille", "blocks", "ascii", "char")
"""What a user may ask for; `char`: plots of characters, as reports have them."""
Level = Literal["braille", "blocks", "half", "ascii", "char"]
LEVELS: tuple[Level, ...] = ("braille", "blocks", "half", "ascii", "char")
LETTERS: tuple[Level, ...] = ("ascii", "char")
"""Levels at which a cell is one letter, that of the trace that has it."""

_BRAILLE = 0x2800
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_QUADRANTS = np.array(list(" ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"))
"""By bits: upper left 1, upper right 2, lower left 4, lower right 8."""
_HALVES = np.array(list(" ▀▄█"))


def level_of(wanted: str, environ: Mapping[str, str]) -> Level:
    """The level of marks; `wanted`: one of `MARKS`, empty for what the terminal can show. A locale without UTF-8 has
    ASCII whatever is wanted, and the Linux console, whose fonts have no braille, half blocks.
    """
    if is_seven_bit(environ):
        return "ascii"
    if wanted in ("ascii", "char"):
        return "ascii" if wanted == "ascii" else "char"
    if environ.get("TERM", "").startswith("linux"):
        return "half"
    return "blocks" if wanted == "blocks" else "braille"


def glyphs(dots: BoolArray, level: Level) -> npt.NDArray[np.str_]:
    """Each cell's character, shape (rows, columns); a cell without a dot is a blank. ASCII is not made of dots: `#`."""
    rows, columns = dots.shape[0] // DOWN, dots.shape[1] // ACROSS
    cells = dots.reshape(rows, DOWN, columns, ACROSS)
    if level == "braille":
        codes = np.einsum("rdca,da->rc", cells.astype(np.int64), _BITS)
        # A blank is one byte, and U+2800 three.
        return _chosen(codes)
    if level == "blocks":
        quarters = cells.reshape(rows, 2, DOWN // 2, columns, ACROSS).any(axis=2).astype(np.int64)
        return np.asarray(_QUADRANTS[np.einsum("rhca,ha->rc", quarters, np.array([[1, 2], [4, 8]]))])
    if level == "half":
        return np.asarray(_HALVES[cells[:, :2].any(axis=(1, 3)) + 2 * cells[:, 2:].any(axis=(1, 3))])
    return np.where(cells.any(axis=(1, 3)), "#", " ")


def _chosen(codes: IndexArray) -> npt.NDArray[np.str_]:
    table = np.array([" ", *(chr(_BRAILLE + code) for code in range(1, 256))])
    return np.asarray(table[codes])
