"""What a workflow has to show, as plain data: pictures, tables and words, for a terminal, an image or a page to draw.

Nothing here draws. A workflow gives its result as a `Page`; `axes` lays a figure out, `terminal`, `svg` and `png` draw
it, and `html` draws a page. "Real" is what was measured and "simulated" what the model gave, everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lidarcheck.arrays import FloatArray

__all__ = ["Cloud", "Course", "Curve", "Distribution", "Figure", "Grid", "Page", "Section", "Table"]


@dataclass(frozen=True)
class Distribution:
    """Values of one quantity, real against simulated, to be seen as histogram, Q-Q, KDE, CDF or violin.

    `samples`: name (as "real", "simulated") to values, any shape (n,), NaN ignored. `unit` is empty for counts.
    """

    title: str
    quantity: str
    unit: str
    samples: Mapping[str, FloatArray]
    log_x: bool = False
    log_count: bool = True


@dataclass(frozen=True)
class Curve:
    """`y` over `x`, shapes (n,), NaN for a gap; `low` and `high`, where given, are an interval around `y`.

    `dots`: the points alone, which no line joins.
    """

    name: str
    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None
    dots: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Course:
    """Curves over one axis, as a KPI over range or a profile over the offset from a sign."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Cloud:
    """Points seen from top, side and front; `groups`: name to positions in the sensor frame [m], shape (n, 3)."""

    title: str
    groups: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Grid:
    """A map of values: `values[i, j]` at `y[i]`, `x[j]`, shape (rows, columns); NaN where nothing is known."""

    title: str
    x_label: str
    y_label: str
    x: FloatArray
    y: FloatArray
    values: FloatArray
    value_label: str = ""
    diverging: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of text under a header; `right` names the columns that hold numbers."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: tuple[str, ...] = ()


Figure = Distribution | Course | Cloud | Grid


@dataclass(frozen=True)
class Section:
    """A part of a page: some words, then tables, then figures."""

    title: str
    words: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True)
class Page:
    """The result of a workflow as people read it.

    `summary`: the verdict in one sentence; `provenance`: what it was made from (files, hashes, seeds, command), text to
    text, shown last.
    """

    title: str
    summary: str
    sections: tuple[Section, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)

    def figures(self) -> tuple[Figure, ...]:
        """All figures of the page, in order."""
        return tuple(figure for section in self.sections for figure in section.figures)

    def tables(self) -> tuple[Table, ...]:
        """All tables of the page, in order."""
        return tuple(table for section in self.sections for table in section.tables)
