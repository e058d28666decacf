"""Figures of pages as charts: histograms as shares, filled against an outline, all else as reports have it."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes import subplots_of
from lidarcheck.figures.axes.elements import Subplot
from lidarcheck.figures.data import Distribution, Figure, Grid
from lidarcheck.kpi import shapes
from lidarcheck.tui.plots.chart import MOST_TRACES, Chart, Form, Strip, Trace
from lidarcheck.tui.plots.colours import PlotRole

__all__ = ["chart_of"]

_ROLES: tuple[PlotRole, ...] = ("real", "now", "saved", "wanted")
_FORMS: tuple[Form, ...] = ("solid", "open", "dots", "dashes")
_LETTERS = ("", "o", "+", "x", "*", "%", "=", "~")
"""Of points, by series; the first is made of dots."""
_BINS = (12, 40)
"""Bins of a histogram at least and at most; between these each has two columns."""
_SHORT = {"simulated": "sim"}
_FAR_SD = 2.0
_RATIO = 2.0


def chart_of(figure: Figure, kind: str, columns: int) -> Chart | None:
    """The chart of a figure that is drawn as `kind`, for a pane of so many columns; None for a map."""
    if isinstance(figure, Grid):
        return None
    if isinstance(figure, Distribution) and kind == "histogram":
        return _histogram(figure, columns)
    subplot = subplots_of(figure, kind)[0]
    traces = tuple(_traces(subplot))[:MOST_TRACES]
    title = re.sub(r"^.* at (?=[\d.]+ m, )", "", subplot.title)
    return Chart(
        (figure.title, kind), title, subplot.x_label, subplot.y_label, traces,
        "log" if subplot.log_x else "lin", "log" if subplot.log_y else "lin",
        equal=subplot.equal, y_names=subplot.y_names, compared="difference" if len(traces) == 2 else "",
    )  # fmt: skip


def _look(number: int, name: str) -> tuple[PlotRole, Form]:
    """What a series looks like: by its name where that says what it is, else by its number."""
    number = {"real": 0, "simulated": 1}.get(name, number)
    return _ROLES[min(number, len(_ROLES) - 1)], _FORMS[min(number, len(_FORMS) - 1)]


def _traces(subplot: Subplot) -> Iterable[Trace]:
    """The traces of a subplot, whose numbers on a logarithmic axis are logarithms."""

    def across(x: FloatArray) -> FloatArray:
        return np.asarray(10.0**x if subplot.log_x else x)

    def up(y: FloatArray) -> FloatArray:
        return np.asarray(10.0**y if subplot.log_y else y)

    def name_of(series: int) -> str:
        return _SHORT.get(subplot.names[series], subplot.names[series])

    intervals = {band.series: band for band in subplot.bands if not band.solid}
    with_line = {line.series for line in subplot.lines}
    for line in subplot.lines:
        if line.series is None:
            yield Trace("quartiles" if line.heavy else "same", across(line.x), up(line.y), "saved",
                        "solid" if line.heavy else "dots")  # fmt: skip
            continue
        role, form = _look(line.series, subplot.names[line.series])
        band = intervals.get(line.series)
        low, high = (None, None) if band is None else (up(band.low), up(band.high))
        yield Trace(name_of(line.series), across(line.x), up(line.y), role, form, low, high)
    for band in subplot.bands:
        if band.solid:
            role, form = _look(band.series, subplot.names[band.series])
            outline = np.concatenate([band.high, band.low[::-1]])
            yield Trace(name_of(band.series), across(np.concatenate([band.x, band.x[::-1]])), up(outline), role, form)
    for dots in subplot.dots:
        if dots.series is None:
            yield Trace("median", across(dots.x), up(dots.y), "both", "points", letter="O")
        elif dots.series not in with_line:
            role, _ = _look(dots.series, subplot.names[dots.series])
            number = {"real": 0, "simulated": 1}.get(subplot.names[dots.series], dots.series)
            yield Trace(name_of(dots.series), across(dots.x), up(dots.y), role, "points",
                        letter=_LETTERS[min(number, len(_LETTERS) - 1)])  # fmt: skip


# Histograms


def _histogram(figure: Distribution, columns: int) -> Chart:
    """Shares in bins that all samples have in common; of two, below them, their ratio."""
    samples = {name: shapes.finite(sample) for name, sample in figure.samples.items()}
    bins = int(np.clip(columns // 2, *_BINS))
    edges = (shapes.log_edges if figure.log_x else shapes.bin_edges)(list(samples.values()), bins)
    traces = [
        _bars(number, name, edges, shapes.counts(sample, edges))
        for number, (name, sample) in enumerate(list(samples.items())[:MOST_TRACES])
        if sample.size
    ]
    names = [name for name, sample in samples.items() if sample.size]
    label = f"{figure.quantity} [{figure.unit}]" if figure.unit not in ("", "1") else figure.quantity
    title = re.sub(r"^.* at (?=[\d.]+ m, )", "", figure.title)
    return Chart(
        (figure.title, "histogram"), title, label, "share", tuple(traces),
        "log" if figure.log_x else "lin", "log" if figure.log_count else "lin",
        compared="ratio", strip=_ratio(traces) if list(samples) == ["real", "simulated"] == names else None,
    )  # fmt: skip


def _bars(number: int, name: str, edges: FloatArray, counts: FloatArray) -> Trace:
    share = counts / counts.sum()
    role, form = _look(number, name)
    if number < 2:
        kind: Form = "filled" if form == "solid" else "outline"
        return Trace(_SHORT.get(name, name), edges, share, role, kind, counts=counts)
    # More than two bodies cannot be told apart: the others are lines.
    return Trace(name, np.repeat(edges, 2)[1:-1], np.repeat(np.where(share > 0.0, share, np.nan), 2), role, form)


def _ratio(traces: list[Trace]) -> Strip | None:
    """The second over the first, and where that is beyond what counting allows."""
    first, second = traces
    if first.counts is None or second.counts is None:
        return None
    both = (first.counts > 0.0) & (second.counts > 0.0)
    ratio = np.divide(second.y, first.y, out=np.full(len(first.y), np.nan), where=both)
    chance = _FAR_SD * np.sqrt(1.0 / np.maximum(first.counts, 1.0) + 1.0 / np.maximum(second.counts, 1.0))
    far = both & (np.abs(np.log(np.where(both, ratio, 1.0))) > chance)
    # Where one side has none, the strip ends; that is no chance where more than a few were to be expected.
    alone = (first.counts > 0.0) ^ (second.counts > 0.0)
    ratio[alone] = np.where(first.counts > 0.0, 1.0 / _RATIO, _RATIO)[alone]
    expected = np.maximum(first.y * second.counts.sum(), second.y * first.counts.sum())
    far |= alone & (expected > _FAR_SD**2)
    name = f"{second.name}/{first.name}"
    return Strip(f"{name}, o: by chance", first.places, ratio, far, "log", _RATIO, "x")
