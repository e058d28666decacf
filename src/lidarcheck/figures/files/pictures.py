"""A figure as a file, PNG or SVG; many of them on one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lidarcheck.errors import UsageError
from lidarcheck.figures.axes import subplots_of
from lidarcheck.figures.data import Figure
from lidarcheck.figures.png import write_png
from lidarcheck.figures.svg import svg_file
from lidarcheck.formats.atomic import atomic_path, write_text

__all__ = ["save_figure", "save_sheet"]


def save_figure(figure: Figure, path: Path | str, *, kind: str = "histogram") -> None:
    """Write the figure to a file, whole or not at all: PNG or SVG, by the suffix.

    `kind`: of a distribution one of KINDS, of a cloud one of VIEWS (else all views, below each other). The same figure
    gives the same bytes. `UsageError`: another suffix; `InputError`: it cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".svg":
        write_text(path, svg_file(figure, kind=kind))
    elif path.suffix.lower() == ".png":
        subplots = subplots_of(figure, kind)
        with atomic_path(path) as temporary:
            write_png(subplots, temporary)
    else:
        raise UsageError(f"{path} is no name of a picture", fix="end it with .png or .svg")


def save_sheet(figures: Sequence[Figure], path: Path | str, *, columns: int, kind: str = "histogram") -> None:
    """Write many figures to one PNG, in rows of so many columns, whole or not at all; of each only the first view.

    `UsageError`: another suffix; `InputError`: it cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise UsageError(f"{path} is no name of a PNG picture", fix="end it with .png")
    with atomic_path(path) as temporary:
        write_png([subplots_of(figure, kind)[0] for figure in figures], temporary, columns)
