"""What a figure of a workflow shows, as subplots to draw: decided here, once, for text and images alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.distributions import DISTRIBUTIONS, values_of
from lidarcheck.figures.axes.elements import Band, Dots, Line, Subplot
from lidarcheck.figures.axes.scales import log10
from lidarcheck.figures.data import Cloud, Course, Distribution, Figure, Grid
from lidarcheck.printable import printable

__all__ = ["KINDS", "MOST_SERIES", "VIEWS", "kinds_of", "subplots_of"]

KINDS: Mapping[str, str] = {"histogram": "Histogram", "qq": "Q-Q", "kde": "Density", "cdf": "CDF", "violin": "Violin"}
"""How a `Distribution` can be seen, and the name of it."""
VIEWS: Mapping[str, str] = {"top": "from above", "side": "from the side", "front": "as the sensor sees it"}
"""How a `Cloud` can be seen, and the name of it."""


MOST_SERIES = 8
_FEW = 40
"""The points of a curve are marked where they are no more than this: single ones between gaps would not be seen."""


def kinds_of(figure: Figure) -> tuple[str, ...]:
    """The ways in which the figure can be seen; empty where there is but one."""
    if isinstance(figure, Distribution):
        return tuple(KINDS)
    return tuple(VIEWS) if isinstance(figure, Cloud) else ()


def subplots_of(figure: Figure, kind: str) -> tuple[Subplot, ...]:
    """The axes of a figure, most often one; `kind`: one of KINDS or VIEWS.

    A kind that is none of the figure's own shows a distribution's histogram and all views of a cloud. `ValueError`: a
    kind that there is not.
    """
    if kind not in (*KINDS, *VIEWS):
        raise ValueError(f"no picture of kind {kind}; there are {', '.join((*KINDS, *VIEWS))}")
    few, more = _first(figure)
    subplots: tuple[Subplot, ...]
    if isinstance(few, Distribution):
        subplots = (DISTRIBUTIONS.get(kind, DISTRIBUTIONS["histogram"])(few),)
    elif isinstance(few, Cloud):
        subplots = tuple(_view(few, view) for view in ((kind,) if kind in VIEWS else VIEWS))
    else:
        subplots = (_course(few) if isinstance(few, Course) else _map(few),)
    return tuple(_printable(dataclasses.replace(subplot, more=more, absent=_absent(few))) for subplot in subplots)


def _absent(figure: Figure) -> tuple[str, ...]:
    """The names of the series of which there is nothing to draw."""
    if isinstance(figure, Distribution):
        return tuple(name for name, one in zip(figure.samples, values_of(figure), strict=True) if not one.size)
    if isinstance(figure, Cloud):
        return tuple(name for name, one in figure.groups.items() if not np.isfinite(one).all(axis=-1).any())
    if isinstance(figure, Course):
        return tuple(one.name for one in figure.curves if not np.isfinite(one.y).any())
    return ()


def _printable(subplot: Subplot) -> Subplot:
    """The subplot with words that can drive no terminal: names may come from files."""
    return dataclasses.replace(
        subplot,
        title=printable(subplot.title),
        x_label=printable(subplot.x_label),
        y_label=printable(subplot.y_label),
        names=tuple(map(printable, subplot.names)),
        y_names=tuple(map(printable, subplot.y_names)),
        absent=tuple(map(printable, subplot.absent)),
    )


def _first(figure: Figure) -> tuple[Figure, int]:
    """The figure with as many series as there are marks, and how many more it has."""
    if isinstance(figure, Grid):
        return figure, 0
    if isinstance(figure, Course):
        return dataclasses.replace(figure, curves=figure.curves[:MOST_SERIES]), max(len(figure.curves) - MOST_SERIES, 0)
    series = figure.samples if isinstance(figure, Distribution) else figure.groups
    few = dict(list(series.items())[:MOST_SERIES])
    more = len(series) - len(few)
    if isinstance(figure, Distribution):
        return dataclasses.replace(figure, samples=few), more
    return dataclasses.replace(figure, groups=few), more


def _view(figure: Cloud, view: str) -> Subplot:
    """Forward is to the right from above and from the side; from the front left is left, as the sensor sees it."""
    across, up = {"top": ("x [m], forward", "y [m], left"), "side": ("x [m], forward", "z [m], up")}.get(
        view, ("−y [m], to the right", "z [m], up")
    )
    dots = []
    for number, positions in enumerate(figure.groups.values()):
        xyz = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        xyz = xyz[np.isfinite(xyz).all(axis=1)]
        x, y, z = xyz.T
        seen = {"top": (x, y), "side": (x, z)}.get(view, (-y, z))
        dots += [Dots(number, *seen)] if len(xyz) else []
    title = f"{figure.title}: {VIEWS[view]}"
    return Subplot(title, across, up, tuple(figure.groups), dots=tuple(dots), equal=True)


def _course(figure: Course) -> Subplot:
    bands, lines, dots = [], [], []

    def across(values: npt.ArrayLike) -> FloatArray:
        return log10(values) if figure.log_x else np.asarray(values, dtype=np.float64).ravel()

    def up(values: npt.ArrayLike) -> FloatArray:
        return log10(values) if figure.log_y else np.asarray(values, dtype=np.float64).ravel()

    for number, curve in enumerate(figure.curves):
        x = across(curve.x)
        lines += [] if curve.dots else [Line(number, x, up(curve.y))]
        dots += [Dots(number, x, up(curve.y))] if curve.dots or len(x) <= _FEW else []
        if curve.low is not None and curve.high is not None:
            bands.append(Band(number, x, up(curve.low), up(curve.high)))
    return Subplot(
        figure.title,
        figure.x_label,
        figure.y_label,
        tuple(curve.name for curve in figure.curves),
        bands=tuple(bands),
        lines=tuple(lines),
        dots=tuple(dots),
        log_x=figure.log_x,
        log_y=figure.log_y,
    )


def _map(figure: Grid) -> Subplot:
    return Subplot(figure.title, figure.x_label, figure.y_label, grid=figure)
