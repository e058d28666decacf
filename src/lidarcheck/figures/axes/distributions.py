"""The axes of a distribution: histogram, Q-Q, density, CDF or violin."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.elements import Band, Dots, Line, Subplot
from lidarcheck.figures.axes.scales import log10
from lidarcheck.figures.data import Distribution
from lidarcheck.kpi import shapes

__all__ = ["DISTRIBUTIONS", "values_of"]


_BINS = 60
_BODY = 256


def _label(words: str, unit: str) -> str:
    return f"{words} [{unit}]" if unit and unit != "1" else words


def values_of(figure: Distribution) -> list[FloatArray]:
    """The samples as they are drawn."""
    return [
        shapes.finite(log10(sample) if figure.log_x else np.asarray(sample, dtype=np.float64))
        for sample in figure.samples.values()
    ]


def _smooth(figure: Distribution) -> list[FloatArray]:
    """The samples as their density is drawn: on a logarithmic axis without the steps of whole numbers."""
    if not figure.log_x:
        return values_of(figure)
    return [shapes.finite(log10(shapes.spread_out(sample))) for sample in figure.samples.values()]


def _over_values(figure: Distribution, y_label: str) -> Subplot:
    """Axes on which nothing is drawn yet, with the quantity across."""
    label = _label(figure.quantity, figure.unit)
    return Subplot(figure.title, label, y_label, tuple(figure.samples), log_x=figure.log_x)


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
    return dataclasses.replace(_over_values(figure, "count"), lines=tuple(lines), log_y=figure.log_count)


def _qq(figure: Distribution) -> Subplot:
    samples, names = values_of(figure), tuple(figure.samples)
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
    return dataclasses.replace(_over_values(figure, f"density [{unit}]"), lines=tuple(lines))


def _cdf(figure: Distribution) -> Subplot:
    samples = values_of(figure)
    everything = np.concatenate([*samples, np.empty(0)])
    lines = []
    for number, sample in enumerate(samples):
        x, share = shapes.distribution_steps(sample)
        if x.size:
            # From 0 at the least of all values to 100 % at the greatest.
            across = np.concatenate([[everything.min()], np.repeat(x, 2), [everything.max()]])
            lines.append(Line(number, across, 100.0 * np.concatenate([[0.0, 0.0], np.repeat(share, 2)])))
    return dataclasses.replace(_over_values(figure, "share below [%]"), lines=tuple(lines))


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
    axes = dataclasses.replace(_over_values(figure, ""), y_names=names[::-1])
    return dataclasses.replace(axes, bands=tuple(bands), lines=tuple(lines), dots=tuple(dots))


DISTRIBUTIONS: Mapping[str, Callable[[Distribution], Subplot]] = {
    "histogram": _histogram,
    "qq": _qq,
    "kde": _kde,
    "cdf": _cdf,
    "violin": _violin,
}
"""How the axes are made, by the kind of picture."""
