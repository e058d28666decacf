"""Words, tables and figures of a page as lines of a pane."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.calibration.figures import Figure, Page, Table

__all__ = ["figure_lines", "word_lines"]

_LEAST_WIDTH, _LEAST_HEIGHT = 40, 10


def word_lines(page: Page, width: int) -> list[Line]:
    """The summary, then each section's words and tables, then where it came from."""
    lines = [line(text) for text in textwrap.wrap(page.summary, width)]
    for section in page.sections:
        if section.words or section.tables:
            lines += [line(""), line(section.title, "title")]
        for words in section.words:
            lines += [line(text) for text in textwrap.wrap(words, width)]
        for table in section.tables:
            lines += _table_lines(table)
    return lines + [line("")] + [line(f"{name}: {text}", "dim") for name, text in page.provenance.items()]


def _table_lines(table: Table) -> list[Line]:
    widths = [max(len(row[i]) for row in (table.header, *table.rows)) for i in range(len(table.header))]
    right = [name in table.right for name in table.header]

    def row(cells: Sequence[str]) -> str:
        parts = (c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True))
        return "  ".join(parts).rstrip()

    head = [line(table.title, "title")] if table.title else []
    return [*head, line(row(table.header), "title"), *(line(row(cells)) for cells in table.rows)]


def figure_lines(figures: Sequence[Figure], kinds: Mapping[str, str], room: tuple[int, int]) -> list[Line]:
    """Figures beside and below each other in `room` (columns, rows), each no smaller than can be read.

    `kinds`: by the first kind of a family the one to draw.
    """
    from lidarcheck.plots.figure_text import figure_text
    from lidarcheck.plots.panels import kinds_of

    if not figures or room[0] <= 0 or room[1] <= 0:
        return []
    beside = max(min(len(figures), room[0] // _LEAST_WIDTH), 1)
    width = max(room[0] // beside - 1, _LEAST_WIDTH)
    height = max(room[1] // math.ceil(len(figures) / beside), _LEAST_HEIGHT)
    lines: list[Line] = []
    for start in range(0, len(figures), beside):
        drawn = []
        for figure in figures[start : start + beside]:
            family = kinds_of(figure)
            kind = kinds.get(family[0], family[0]) if family else "histogram"
            drawn.append(figure_text(figure, kind=kind, width=width, height=height).splitlines())
        for y in range(height):
            texts = [(text[y] if y < len(text) else "").ljust(width + 1) for text in drawn]
            lines.append(line("".join(texts).rstrip()))
    return lines
