"""A figure as SVG: elements for a page, or a file of its own."""

from __future__ import annotations

from functools import cache
from importlib import resources

from lidarcheck.figures.axes.build import subplots_of
from lidarcheck.figures.data import Figure
from lidarcheck.figures.svg.shapes import svg, text
from lidarcheck.figures.svg.subplot import HEIGHT, WIDTH, subplot_svg
from lidarcheck.figures.words import short

__all__ = ["figure_svg", "style", "svg_file"]

_TITLE = 16.0
"""Height of a file's title."""


def figure_svg(figure: Figure, *, kind: str = "histogram") -> str:
    """The figure as SVG elements, one a view, for a page that has the project's colours.css and chart.css."""
    return "\n".join(subplot_svg(subplot) for subplot in subplots_of(figure, kind))


def svg_file(figure: Figure, *, kind: str = "histogram") -> str:
    """An SVG file of its own: the title, the views below each other, and the CSS that a page would have."""
    subplots = subplots_of(figure, kind)
    height = _TITLE + HEIGHT * len(subplots)
    parts = [f'<rect class="paper" width="{WIDTH:g}" height="{height:g}"/>']
    parts.append(text(4.0, 13.0, short(figure.title, 80)))
    for i, subplot in enumerate(subplots):
        place = f'<svg y="{_TITLE + HEIGHT * i:g}" width="{WIDTH:g}" height="{HEIGHT:g}" '
        parts.append(subplot_svg(subplot).replace("<svg ", place, 1))
    whole = svg(figure.title, "".join(parts), name="chart", width=WIDTH, height=height)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{2 * WIDTH:g}" '
    opening, _, body = whole.replace("<svg ", head, 1).partition(">")
    return f"{opening}><style>{style()}.paper {{ fill: var(--paper); }}</style>{body}\n"


@cache
def style() -> str:
    """The pages' CSS, of which a picture on its own needs the colours and the plot's rules."""
    templates = resources.files("lidarcheck.figures") / "templates"
    return "\n".join((templates / name).read_text(encoding="utf-8") for name in ("colours.css", "chart.css"))
