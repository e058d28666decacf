"""Words, tables and figures of a page as lines of a pane."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lidarcheck.session.session import CURRENT
from lidarcheck.tui.jobs.job import Job
from lidarcheck.tui.widgets.lines import Line, line, printable, wrapped
from lidarcheck.tui.widgets.themes import Role

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page, Table

__all__ = [
    "LEAST_HEIGHT",
    "LEAST_WIDTH",
    "figure_lines",
    "job_line",
    "name_room",
    "no_page_lines",
    "note_lines",
    "room_for",
    "together",
    "word_lines",
]

_NAME = (20, 34)
LEAST_WIDTH, LEAST_HEIGHT = 40, 10
"""What a figure needs to be read."""


def name_room(jobs: Sequence[Job]) -> int:
    """How many letters the list has for names."""
    return min(max([_NAME[0], *(len(printable(job.name)) for job in jobs)]), _NAME[1])


def job_line(job: Job, state: str, fault: str, here: bool, room: int) -> Line:
    """A job in the list: its name, in `room` letters, where it stands, and what is to be said of it."""
    from lidarcheck.figures.words import squeezed

    name = f"{'>' if here else ' '}{squeezed(printable(job.name), room, '..'):{room}} "
    if fault:
        return ((name, "text"), ("cannot    ", "bad"), (fault, "dim"))
    role: Role = "good" if state == CURRENT else "edited" if state else "dim"
    return ((name, "text"), (f"{state.partition(',')[0] or '-':10} ", role), (job.words, "dim"))


def note_lines(job: Job, width: int) -> list[Line]:
    """What is left out of a job."""
    return [part for note in job.notes for part in wrapped(note, width, "bad")]


def no_page_lines(job: Job, running: bool, fault: str, width: int) -> list[Line]:
    """What stands in the place of a page that is not there."""
    if running:
        return [line("computing ..."), *note_lines(job, width)]
    if fault:
        return [*wrapped(f"{job.name} cannot be computed: {fault}", width, "bad"), *note_lines(job, width)]
    words = "not computed yet: r computes it"
    return [*wrapped(job.words, width), *wrapped(words, width, "dim"), *note_lines(job, width)]


def word_lines(page: Page, width: int, inside: Callable[[str], str] = str) -> list[Line]:
    """The summary, then each section's words and tables, then where it came from.

    `inside`: shortens the paths of files in the words.
    """
    lines = wrapped(inside(page.summary), width)
    for section in page.sections:
        if section.words or section.tables:
            lines += [line(""), line(section.title, "title")]
        for words in section.words:
            lines += wrapped(inside(words), width)
        for table in section.tables:
            lines += _table_lines(table, width)
    provenance = [inside(f"{name}: {text}") for name, text in page.provenance.items()]
    return [*lines, line(""), *(part for text in provenance for part in wrapped(text, width, "dim"))]


def _table_lines(table: Table, width: int) -> list[Line]:
    """A table that is wider than there is room for goes on below, each part with the first column again."""
    columns = range(len(table.header))
    widths = [max(len(row[i]) for row in (table.header, *table.rows)) for i in columns]
    parts: list[list[int]] = []
    for i in columns[1:]:
        if not parts or sum(widths[j] + 2 for j in [*parts[-1], i]) - 2 > width:
            parts.append([0])
        parts[-1].append(i)
    lines = [line(table.title, "title")] if table.title else []
    for number, part in enumerate(parts or [list(columns)]):
        lines += [line("")] if number else []
        lines.append(line(_row(table, table.header, part, widths), "title"))
        lines += [line(_row(table, cells, part, widths)) for cells in table.rows]
    return lines


def _row(table: Table, cells: Sequence[str], part: Sequence[int], widths: Sequence[int]) -> str:
    right = [table.header[i] in table.right for i in part]
    texts = (cells[i].rjust(widths[i]) if r else cells[i].ljust(widths[i]) for i, r in zip(part, right, strict=True))
    return "  ".join(texts).rstrip()


def room_for(room: tuple[int, int], most: int) -> int:
    """How many figures, up to so many, can be seen at once in `room` (columns, rows)."""
    return max(min(room[0] // LEAST_WIDTH * max(room[1] // LEAST_HEIGHT, 1), most), 1)


def together(figures: Sequence[Figure], most: int) -> list[tuple[Figure, ...]]:
    """Figures in groups of at most so many."""
    return [tuple(figures[i : i + most]) for i in range(0, len(figures), most)]


def figure_lines(figures: Sequence[tuple[Figure, str]], room: tuple[int, int]) -> list[Line]:
    """Figures, each with the kind it is drawn as, beside and below each other in `room` (columns, rows).

    None is smaller than can be read: what has no room is below, to be scrolled to.
    """
    from lidarcheck.figures.terminal import figure_text

    if not figures or room[0] <= 0 or room[1] <= 0:
        return []
    beside = max(min(len(figures), room[0] // LEAST_WIDTH), 1)
    width = max(room[0] // beside - 1, LEAST_WIDTH)
    height = max(room[1] // math.ceil(len(figures) / beside), LEAST_HEIGHT)
    lines: list[Line] = []
    for start in range(0, len(figures), beside):
        drawn = [
            figure_text(figure, kind=kind, width=width, height=height).splitlines()
            for figure, kind in figures[start : start + beside]
        ]
        column = room[0] // beside if beside > 1 else width
        for y in range(height):
            texts = [_fitted(text[y] if y < len(text) else "", column) for text in drawn]
            lines.append(line("".join(texts).rstrip()))
    return lines


def _fitted(text: str, column: int) -> str:
    """A line of a figure in its column: a head that fills it gives up a blank, not to touch the next one."""
    if len(text) >= column and text[-1:] not in "│┐┘":
        text = text.replace("  ", " ", 1)
    return text.ljust(column)
