"""What a figure of a workflow shows, as panels to draw: decided here, once, for text and images alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lidarcheck.figures.data import Cloud, Course, Distribution, Figure, Grid
from lidarcheck.figures.drawing.panel import Band, Dots, Line, Subplot
from lidarcheck.figures.drawing.scales import log10
from lidarcheck.kpi import shapes

__all__ = ["KINDS", "MOST_SERIES", "VIEWS", "kinds_of", "panels_of"]

KINDS: Mapping[str, str] = {"histogram": "Histogram", "qq": "Q-Q", "kde": "Density", "cdf": "CDF", "violin": "Violin"}
"""How a `Distribution` can be seen, and the name of it."""
VIEWS: Mapping[str, str] = {"top": "from above", "side": "from the side", "front": "as the sensor sees it"}
"""How a `Cloud` can be seen, and the name of it."""

FloatArray = npt.NDArray[np.float64]

MOST_SERIES = 8
_BINS = 60
_BODY = 256
_FEW = 40
"""The points of a curve are marked where they are no more than this: single ones between gaps would not be seen."""


def kinds_of(figure: Figure) -> tuple[str, ...]:
    """The ways in which the figure can be seen; empty where there is but one."""
    if isinstance(figure, Distribution):
        return tuple(KINDS)
    return tuple(VIEWS) if isinstance(figure, Cloud) else ()


def panels_of(figure: Figure, kind: str) -> tuple[Subplot, ...]:
    """The axes of a figure, most often one; `kind`: one of KINDS or VIEWS.

    A kind that is none of the figure's own shows a distribution's histogram and all views of a cloud. `ValueError`: a
    kind that there is not.
    """
    if kind not in (*KINDS, *VIEWS):
        raise ValueError(f"no picture of kind {kind}; there are {', '.join((*KINDS, *VIEWS))}")
    few, more = _first(figure)
    panels: tuple[Subplot, ...]
    if isinstance(few, Distribution):
        panels = (_DISTRIBUTIONS.get(kind, _histogram)(few),)
    elif isinstance(few, Cloud):
        panels = tuple(_view(few, view) for view in ((kind,) if kind in VIEWS else VIEWS))
    else:
        panels = (_course(few) if isinstance(few, Course) else _map(few),)
    return tuple(_printable(dataclasses.replace(panel, more=more, absent=_absent(few))) for panel in panels)


def _absent(figure: Figure) -> tuple[str, ...]:
    """The names of the series of which there is nothing to draw."""
    if isinstance(figure, Distribution):
        return tuple(name for name, one in zip(figure.samples, _drawn(figure), strict=True) if not one.size)
    if isinstance(figure, Cloud):
        return tuple(name for name, one in figure.groups.items() if not np.isfinite(one).all(axis=-1).any())
    if isinstance(figure, Course):
        return tuple(one.name for one in figure.curves if not np.isfinite(one.y).any())
    return ()


def _printable(panel: Subplot) -> Subplot:
    """The panel with words that can drive no terminal: names may come from files."""

    def clean(words: str) -> str:
        return "".join(c if c.isprintable() else "?" for c in words)

    return dataclasses.replace(
        panel,
        title=clean(panel.title),
        x_label=clean(panel.x_label),
        y_label=clean(panel.y_label),
        names=tuple(map(clean, panel.names)),
        y_names=tuple(map(clean, panel.y_names)),
        absent=tuple(map(clean, panel.absent)),
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


def _label(words: str, unit: str) -> str:
    return f"{words} [{unit}]" if unit and unit != "1" else words


def _drawn(figure: Distribution) -> list[FloatArray]:
    """The samples as they are drawn."""
    return [
        shapes.finite(log10(sample) if figure.log_x else np.asarray(sample, dtype=np.float64))
        for sample in figure.samples.values()
    ]


def _smooth(figure: Distribution) -> list[FloatArray]:
    """The samples as their density is drawn: on a logarithmic axis without the steps of whole numbers."""
    if not figure.log_x:
        return _drawn(figure)
    return [shapes.finite(log10(shapes.spread_out(sample))) for sample in figure.samples.values()]


def _histogram(figure: Distribution) -> Subplot:
    samples = [shapes.finite(sample) for sample in figure.samples.values()]
    edges = (shapes.log_edges if figure.log_x else shapes.bin_edges)(samples, _BINS)
    lines = []
    for number, sample in enumerate(samples):
        counted = shapes.counts(sample, edges)
        heights = log10(counted) if figure.log_count else counted
        # Down to half a value: a bin of one must be seen, an empty one must not.
        floor = -0.3 if figure.log_count else 0.0
        heights = np.where(counted > 0.0, heights, floor)
        x = np.repeat(log10(edges) if figure.log_x else edges, 2)
        y = np.concatenate([[floor], np.repeat(heights, 2), [floor]])
        lines += [Line(number, x, y, filled=number == 0)] if counted.any() else []
    return Subplot(
        figure.title,
        _label(figure.quantity, figure.unit),
        "count",
        tuple(figure.samples),
        lines=tuple(lines),
        log_x=figure.log_x,
        log_y=figure.log_count,
    )


def _qq(figure: Distribution) -> Subplot:
    samples, names = _drawn(figure), tuple(figure.samples)
    words = _label(figure.quantity, figure.unit)
    first = names[0] if names else ""
    dots = []
    for number, sample in enumerate(samples[1:], 1):
        _, x, y = shapes.quantile_pairs(samples[0], sample)
        dots += [Dots(number, x, y)] if x.size else []
    ends = np.concatenate([np.empty(0), *(values for one in dots for values in (one.x, one.y))])
    same = np.array([ends.min(), ends.max()]) if ends.size else np.empty(0)
    return Subplot(
        figure.title,
        f"quantiles of {first or 'nothing'}: {words}",
        f"quantiles of {names[1] if len(names) == 2 else 'the others'}",
        names,
        lines=(Line(None, same, same),) if same.size else (),
        dots=tuple(dots),
        log_x=figure.log_x,
        log_y=figure.log_x,
    )


def _kde(figure: Distribution) -> Subplot:
    found = shapes.densities(_smooth(figure))
    unit = f"per decade of {figure.quantity}" if figure.log_x else f"per {figure.unit or 'unit'}"
    lines = [Line(n, one.x, one.density, filled=n == 0) for n, one in enumerate(found) if one.x.size]
    return Subplot(
        figure.title,
        _label(figure.quantity, figure.unit),
        f"density [{unit}]",
        tuple(figure.samples),
        lines=tuple(lines),
        log_x=figure.log_x,
    )


def _cdf(figure: Distribution) -> Subplot:
    samples = _drawn(figure)
    everything = np.concatenate([*samples, np.empty(0)])
    lines = []
    for number, sample in enumerate(samples):
        x, share = shapes.distribution_steps(sample)
        if x.size:
            # From 0 at the least of all values to 100 % at the greatest.
            across = np.concatenate([[everything.min()], np.repeat(x, 2), [everything.max()]])
            lines.append(Line(number, across, 100.0 * np.concatenate([[0.0, 0.0], np.repeat(share, 2)])))
    return Subplot(
        figure.title,
        _label(figure.quantity, figure.unit),
        "share below [%]",
        tuple(figure.samples),
        lines=tuple(lines),
        log_x=figure.log_x,
    )


def _violin(figure: Distribution) -> Subplot:
    """Bodies beside each other over one axis of the quantity, all of one width; a bar from quartile to quartile."""
    samples, names = _smooth(figure), tuple(figure.samples)
    bands, lines, dots = [], [], []
    for number, (sample, one) in enumerate(zip(samples, shapes.densities(samples, _BODY), strict=True)):
        if not sample.size:
            continue
        at = float(len(samples) - 1 - number)
        inside = (one.x >= sample.min()) & (one.x <= sample.max()) | (one.density > 0.02 * one.density.max())
        half = np.where(inside, 0.4 * one.density / one.density.max(), np.nan)
        bands.append(Band(number, one.x, at - half, at + half, solid=True))
        low, middle, high = shapes.quartiles(sample)
        lines.append(Line(None, np.array([low, high]), np.array([at, at]), heavy=True))
        dots.append(Dots(None, np.array([middle]), np.array([at])))
    return Subplot(
        figure.title,
        _label(figure.quantity, figure.unit),
        "",
        names,
        bands=tuple(bands),
        lines=tuple(lines),
        dots=tuple(dots),
        log_x=figure.log_x,
        y_names=names[::-1],
    )


_DISTRIBUTIONS = {"histogram": _histogram, "qq": _qq, "kde": _kde, "cdf": _cdf, "violin": _violin}


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
        lines.append(Line(number, x, up(curve.y)))
        dots += [Dots(number, x, up(curve.y))] if len(x) <= _FEW else []
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
