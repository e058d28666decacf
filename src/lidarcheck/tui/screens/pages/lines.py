"""Words, tables and figures of a page as lines of a pane."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lidarcheck.session.session import CURRENT
from lidarcheck.tui.jobs.job import Job
from lidarcheck.tui.widgets.lines import Line, line, printable, wrapped
from lidarcheck.tui.widgets.themes import Role

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page, Table

__all__ = [
    "job_line",
    "name_room",
    "no_page_lines",
    "note_lines",
    "together",
    "word_lines",
]

_NAME = (20, 34)


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


def together(figures: Sequence[Figure], most: int) -> list[tuple[Figure, ...]]:
    """Figures in groups of at most so many."""
    return [tuple(figures[i : i + most]) for i in range(0, len(figures), most)]
