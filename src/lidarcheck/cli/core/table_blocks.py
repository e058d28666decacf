"""How the columns of a table are laid out on a narrow terminal: no number is ever broken over two lines."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["Column", "blocks", "columns", "number_text"]

_GAP = 2
_KEYS_AMONG = 3
_SHORT = 16
"""Text of up to so many characters stays on one line."""
Block = list[tuple[int, int]]


class Column(str):
    """A table column's heading; `right` for numbers."""

    right: bool

    def __new__(cls, heading: str, right: bool = False) -> Column:
        """A heading, aligned left unless `right`."""
        column = super().__new__(cls, heading)
        column.right = right
        return column


def columns(*headings: str, right: Sequence[str] = ()) -> tuple[Column, ...]:
    """The columns of a table; those in `right` hold numbers."""
    return tuple(Column(heading, right=heading in right) for heading in headings)


def number_text(value: float, sign: str = "") -> str:
    """A number to four digits, `sign` as in a format; `-` where there is none."""
    return "-" if math.isnan(value) else f"{value:{sign}.4g}"


def blocks(columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int) -> list[Block]:
    """Blocks of (column's number, its width) that each fit; the columns that name a row stand in every block.

    Headings are broken between words first, then text; where that does not do, the columns go on in a block below.
    """
    most = [max(len(row[i]) for row in [columns, *rows]) for i in range(len(columns))]
    least = [_least(column, [row[i] for row in rows]) for i, column in enumerate(columns)]
    keys = _keys(columns, least, width)
    found: list[list[int]] = [list(keys)]
    for i in range(len(keys), len(columns)):
        if len(found[-1]) > len(keys) and _total([least[k] for k in (*found[-1], i)]) > width:
            found.append(list(keys))
        found[-1].append(i)
    return [_widened(block, least, most, width) for block in found]


def _least(column: Column, cells: Sequence[str]) -> int:
    """The width below which a number, or a word, would be broken."""
    whole = [cell for cell in cells if column.right or len(cell) <= _SHORT]
    words = [word for text in (column, *cells) if text not in whole for word in text.split()]
    return max([len(text) for text in (*words, *whole)], default=1) or 1


def _keys(columns: Sequence[Column], least: Sequence[int], width: int) -> range:
    """The first columns up to the last text among the first three, which say what a row is of; at least the first."""
    text = [i for i, column in enumerate(columns[:_KEYS_AMONG]) if not column.right]
    count = text[-1] + 1 if text else 1
    while count > 1 and _total(least[:count]) > width // 2:
        count -= 1
    return range(min(count, len(columns)))


def _widened(block: Sequence[int], least: Sequence[int], most: Sequence[int], width: int) -> Block:
    """The room that is left goes to the columns that need little more, so that few headings are broken."""
    widths = {i: least[i] for i in block}
    # A word that is longer than the line has to be broken.
    excess = _total(list(widths.values())) - width
    if excess > 0:
        longest = max(block, key=lambda i: widths[i])
        widths[longest] = max(widths[longest] - excess, 1)
    room = width - _total(list(widths.values()))
    for i in sorted(block, key=lambda i: most[i] - widths[i]):
        more = max(min(most[i] - widths[i], room), 0)
        widths[i] += more
        room -= more
    return [(i, widths[i]) for i in block]


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + _GAP * (len(widths) - 1)
