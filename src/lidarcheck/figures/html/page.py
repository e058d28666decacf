"""The page of a workflow: one self-contained HTML file, without scripts: verdict, tables, figures, where it came from.

A distribution is seen as histogram, Q-Q, density, CDF or violin, a cloud from three sides, by a choice that is CSS.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from lidarcheck.figures.axes import KINDS, VIEWS, kinds_of
from lidarcheck.figures.data import Figure, Page, Section, Table
from lidarcheck.figures.html.environment import page_environment
from lidarcheck.figures.svg import figure_svg

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["main_of", "page_html", "right_of"]

_CHOICE = re.compile(r'\b(id|for|name)="(f\d+(?:-\d+)?)"')


@dataclass(frozen=True, slots=True)
class _View:
    """One way to see a figure: its name, empty where there is but one, and its SVG."""

    name: str
    svg: str


@dataclass(frozen=True, slots=True)
class _Drawn:
    """A figure on the page; `number`: unique, so that its choice is its own."""

    number: int
    title: str
    views: tuple[_View, ...]


@dataclass(frozen=True, slots=True)
class _Part:
    """A section with its figures drawn; `tables`: each with the columns that hold numbers marked."""

    section: Section
    tables: tuple[tuple[Table, tuple[bool, ...]], ...]
    figures: tuple[_Drawn, ...]


def page_html(page: Page) -> str:
    """The page as text; the same page gives the same bytes."""
    numbers = iter(range(1, len(page.figures()) + 1))
    parts = [
        _Part(
            section,
            tuple((table, right_of(table)) for table in section.tables),
            tuple(_drawn(figure, next(numbers)) for figure in section.figures),
        )
        for section in page.sections
    ]
    return _template().render(page=page, parts=parts)


def right_of(table: Table) -> tuple[bool, ...]:
    """For each column whether it holds numbers."""
    return tuple(name in table.right for name in table.header)


def main_of(html: str, prefix: str) -> str:
    """What is between a page's header and its end, for another page; `prefix` keeps its choices of views apart."""
    content = html.partition("<main>")[2].rpartition("</main>")[0]
    return _CHOICE.sub(rf'\1="{prefix}\2"', content)


def _drawn(figure: Figure, number: int) -> _Drawn:
    kinds = kinds_of(figure)
    names = {**KINDS, **{kind: words[0].upper() + words[1:] for kind, words in VIEWS.items()}}
    views = [_View(names[kind] if kinds else "", figure_svg(figure, kind=kind)) for kind in kinds or ("histogram",)]
    return _Drawn(number, figure.title, tuple(views))


@cache
def _template() -> Template:
    return page_environment().get_template("page.html.jinja")
