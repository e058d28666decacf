"""A workflow's figure as a file, PNG or SVG, or as SVG for a page."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from lidarcheck.errors import UsageError
from lidarcheck.figures.data import Figure
from lidarcheck.figures.drawing.figure_png import write_png
from lidarcheck.figures.drawing.figure_svg import panel_svg, stacked
from lidarcheck.figures.drawing.panels import KINDS, VIEWS, panels_of
from lidarcheck.formats.atomic import atomic_path, write_text

__all__ = ["KINDS", "VIEWS", "figure_svg", "save_figure", "save_sheet"]


def save_figure(figure: Figure, path: Path | str, *, kind: str = "histogram") -> None:
    """Write the figure to a file, whole or not at all: PNG or SVG, by the suffix.

    `kind`: of a distribution one of KINDS, of a cloud one of VIEWS (else all views, below each other). The same figure
    gives the same bytes. `UsageError`: another suffix; `InputError`: it cannot be written.
    """
    path = Path(path)
    panels = panels_of(figure, kind)
    if path.suffix.lower() == ".svg":
        write_text(path, stacked(panels, figure.title, _style()))
    elif path.suffix.lower() == ".png":
        with atomic_path(path) as temporary:
            write_png(panels, temporary)
    else:
        raise UsageError(f"{path} is no name of a picture", fix="end it with .png or .svg")


def save_sheet(figures: Sequence[Figure], path: Path | str, *, columns: int, kind: str = "histogram") -> None:
    """Write many figures to one PNG, in rows of so many columns, whole or not at all; each must be one panel.

    `UsageError`: another suffix; `InputError`: it cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise UsageError(f"{path} is no name of a PNG picture", fix="end it with .png")
    with atomic_path(path) as temporary:
        write_png([panels_of(figure, kind)[0] for figure in figures], temporary, columns)


def figure_svg(figure: Figure, *, kind: str = "histogram") -> str:
    """The figure as SVG elements, one a view, for a page that has the project's colours.css and chart.css."""
    return "\n".join(panel_svg(panel) for panel in panels_of(figure, kind))


@cache
def _style() -> str:
    """The pages' CSS, of which a picture on its own needs the colours and the plot's rules."""
    templates = resources.files("lidarcheck.figures") / "templates"
    return "\n".join((templates / name).read_text(encoding="utf-8") for name in ("colours.css", "chart.css"))
