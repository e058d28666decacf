"""A workflow's figure as PNG, by matplotlib, on white: for a talk, a message or a ticket.

Series have the colours that the page has in its light mode, and differ by dashes and shapes besides. The same figure
gives the same bytes with the same matplotlib.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.axes.elements import Subplot, depth
from lidarcheck.figures.axes.map_cells import cell_edges, reach_of
from lidarcheck.figures.axes.scales import equal_spans, limits, one_a_cell, round_ticks
from lidarcheck.figures.data import Grid
from lidarcheck.figures.words import squeezed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as SheetFigure

__all__ = ["COLOURS", "load", "write_png"]

Span = tuple[float, float]

COLOURS = ("#b4540a", "#0b62c4", "#1a7f4b", "#8a3fa0", "#7a6a00", "#c2185b", "#4b5563", "#00777f")
_DASHES: tuple[Any, ...] = (
    "-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)),
    (0, (9, 3)), (0, (3, 1)), (0, (9, 2, 1.5, 2, 1.5, 2)), (0, (1, 3)),
)  # fmt: skip
_SHAPES = ("o", "x", "s", "+", "^", "D", "_", "|")
_LEGEND_LETTERS = 84
_CELLS = (400, 200)
"""Dots that would fall into one cell of such a grid are drawn once."""
_FEW = 40
_WIDTH_IN, _HEIGHT_IN, _DPI = 7.0, 4.2, 130
_LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN = 0.48, 0.2, 0.36, 0.5
"""Room around the axes for labels and title, besides the ticks' words and the legend's rows. It is reckoned, not
measured by matplotlib, which draws a picture twice for that."""
_LETTER_IN, _LEGEND_ROW_PT = 0.078, 14.0
_TICK_PT, _WORDS_PT = 3.5, 6.0
"""A tick's length, and how far its words stand from the axes."""
_STYLE: Any = {
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.edgecolor": "#68707a",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.parse_math": False,
    "grid.color": "#d5d9de",
    "grid.linewidth": 0.5,
    "path.simplify": True,
}


def load() -> None:
    """Load matplotlib ahead of the first picture, which takes longer than to draw one."""
    import matplotlib.figure  # noqa: F401


def write_png(subplots: Sequence[Subplot], path: Path, columns: int = 1) -> None:
    """Write the subplots to a file, one below the other, or in rows of so many columns."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        current: dict[Any, Any] = matplotlib.rcParams
        dict.update(current, _settings())  # not their own update, which checks each again
        rows = -(-len(subplots) // columns)
        # Many subplots on one sheet are each a little smaller.
        size = 1.0 if columns == 1 else 0.75
        wide, high = size * _WIDTH_IN, size * _HEIGHT_IN
        figure = Figure(figsize=(wide * columns, high * rows), dpi=_DPI)
        for place, subplot in enumerate(subplots):
            row, column = divmod(place, columns)
            _draw(figure.add_axes(_room((column * wide, (rows - 1 - row) * high, wide, high), figure)), subplot)
        # The strongest compression takes a fifth of the time, for files a fifth smaller.
        figure.savefig(path, format="png", metadata={"Software": None}, pil_kwargs={"compress_level": 2})


@cache
def _settings() -> dict[str, Any]:
    """matplotlib's own settings with the project's style, whatever the user's are; checked once for all pictures."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        return {key: value for key, value in dict.items(matplotlib.rcParams) if not key.startswith("backend")}


def _room(cell: tuple[float, float, float, float], figure: SheetFigure) -> tuple[float, float, float, float]:
    """The axes' place in the figure (left, bottom, width, height), as parts of it; `cell`: the same with what is
    around the axes [in]."""
    left, bottom, wide, high = cell
    all_wide, all_high = figure.get_size_inches()
    wide, high = wide - _LEFT_IN - _RIGHT_IN, high - _TOP_IN - _BOTTOM_IN
    return (left + _LEFT_IN) / all_wide, (bottom + _BOTTOM_IN) / all_high, wide / all_wide, high / all_high


def _make_room(axes: Axes, *, rows: int = 0, letters: int = 0) -> None:
    """Move the axes' borders inward for the words of the vertical ticks, of so many letters, and rows of a legend."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    wide, high = figure.get_size_inches()
    left = _LETTER_IN * letters / wide
    top = _LEGEND_ROW_PT / 72.0 * rows / high
    place = axes.get_position()
    axes.set_position((place.x0 + left, place.y0, place.width - left, place.height - top))


def _draw(axes: Axes, subplot: Subplot) -> None:
    _title(axes, subplot, rows=0)
    axes.set_xlabel(subplot.x_label)
    axes.set_ylabel(subplot.y_label)
    points = subplot.points()
    if subplot.grid is not None and np.isfinite(subplot.grid.values).any():
        _draw_map(axes, subplot.grid)
    elif not len(points):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(0.5, 0.5, "nothing to draw", ha="center", va="center", transform=axes.transAxes)
    else:
        spans = _span(axes, subplot, points)
        letters = _draw_ticks(axes, subplot, spans)
        _make_room(axes, rows=_draw_series(axes, subplot, spans), letters=letters)


def _title(axes: Axes, subplot: Subplot, rows: int) -> None:
    """Above the axes and so many rows of a legend. Its height is given: matplotlib would measure all ticks for it."""
    axes.set_title(squeezed(subplot.title, 90), loc="left", y=1.0, pad=(8.0 if rows else 6.0) + _LEGEND_ROW_PT * rows)


def _span(axes: Axes, subplot: Subplot, points: Any) -> tuple[Span, Span]:
    """What the axes span, after setting their limits, the same as in text and SVG."""
    x, y = limits(points[:, 0], 0.02), limits(points[:, 1], 0.04)
    if subplot.equal:
        x, y, equal = equal_spans(x, y, 0.86 * _WIDTH_IN, 0.76 * _HEIGHT_IN)
        if not equal:
            axes.set_xlabel(f"{subplot.x_label} (not to one scale)")
    axes.set_xlim(*x)
    axes.set_ylim(*y)
    return x, y


def _draw_ticks(axes: Axes, subplot: Subplot, spans: tuple[Span, Span]) -> int:
    """Ticks, their words and a grid, the same as in text and SVG; how many letters the longest word at the left has.

    All ticks of an axis are one object: as matplotlib's own, five objects a tick, they take a third of a picture's
    time.
    """
    x, y = spans
    across, words_across = round_ticks(*x, 9, subplot.log_x)
    if subplot.y_names:
        up, words_up = [float(i) for i in range(len(subplot.y_names))], [squeezed(name, 24) for name in subplot.y_names]
    else:
        up, words_up = round_ticks(*y, 7, subplot.log_y)
    axes.set_xticks([])
    axes.set_yticks([])
    mark: dict[str, Any] = {"ls": "", "color": _STYLE["axes.edgecolor"], "ms": _TICK_PT, "mew": 0.7, "clip_on": False}
    axes.plot(across, np.zeros(len(across)), marker=3, transform=axes.get_xaxis_transform(), **mark)
    axes.plot(np.zeros(len(up)), up, marker=0, transform=axes.get_yaxis_transform(), **mark)
    grid: dict[str, Any] = {"color": _STYLE["grid.color"], "lw": _STYLE["grid.linewidth"], "zorder": 0.5}
    axes.hlines(up, 0.0, 1.0, transform=axes.get_yaxis_transform(), **grid)
    below, _, _ = axes.get_xaxis_text1_transform(_WORDS_PT)
    beside, _, _ = axes.get_yaxis_text1_transform(_WORDS_PT)
    for at, words in zip(across, words_across, strict=True):
        axes.text(at, 0.0, _true_minus(words), transform=below, ha="center", va="top")
    for at, words in zip(up, words_up, strict=True):
        axes.text(0.0, at, _true_minus(words), transform=beside, ha="right", va="center_baseline")
    letters = max(map(len, words_up), default=0)
    axes.xaxis.labelpad = _WORDS_PT + 12.0
    axes.yaxis.labelpad = _WORDS_PT + 72.0 * _LETTER_IN * letters
    return letters


def _true_minus(words: str) -> str:
    return words.replace("-", "−")


def _draw_series(axes: Axes, subplot: Subplot, spans: tuple[Span, Span]) -> int:
    """Draw them; the rows of the legend."""
    for band in subplot.bands:
        good = np.isfinite(band.low) & np.isfinite(band.high)
        alpha = 0.3 if band.solid else 0.18
        shade: dict[str, Any] = {"color": COLOURS[band.series], "alpha": alpha}
        axes.fill_between(band.x, band.low, band.high, where=good.tolist(), lw=0, **shade)
        if not band.solid and len(band.x) <= _FEW:  # a point between gaps has an interval too
            axes.vlines(band.x[good], band.low[good], band.high[good], lw=1.5, **shade)
    for line in subplot.lines:
        if line.series is None:
            heavy: dict[str, Any] = {"color": "#1a1d21", "lw": 3.0, "solid_capstyle": "butt"}
            axes.plot(line.x, line.y, **(heavy if line.heavy else {"color": "#68707a", "lw": 1.0, "ls": (0, (3, 2))}))
        else:
            number = line.series
            axes.plot(line.x, line.y, color=COLOURS[number], lw=1.3, ls=_DASHES[number], label=subplot.names[number])
            if line.filled:
                good = np.isfinite(line.y)
                bottom = float(np.min(line.y[good], initial=0.0))
                axes.fill_between(line.x[good], line.y[good], bottom, color=COLOURS[number], alpha=0.18, lw=0)
    for dots in sorted(subplot.dots, key=depth):
        if dots.series is None:
            axes.plot(dots.x, dots.y, "o", mfc="white", mec="#1a1d21", ms=5.0, mew=1.2, zorder=3.0)
        else:
            number = dots.series
            few = len(dots.x) <= 300
            seen = one_a_cell(dots.x, dots.y, spans, _CELLS)
            axes.plot(
                *seen.T, _SHAPES[number], color=COLOURS[number], ms=3.5 if few else 2.0, mew=0.7, ls="",
                label=subplot.names[number],
            )  # fmt: skip
    if not subplot.y_names and axes.get_legend_handles_labels()[0]:
        return _legend(axes, subplot)
    return 0


def _legend(axes: Axes, subplot: Subplot) -> int:
    """Above the axes; a curve and its dots are one entry. How many rows it has."""
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    names = [name for name in subplot.names if name in handles]
    words = [squeezed(name, 40) for name in names]
    columns = min(max(_LEGEND_LETTERS // (max(map(len, words)) + 6), 1), len(words))
    words[-1] += "".join(f" ({squeezed(name, 40)}: nothing)" for name in subplot.absent)
    words[-1] += f" (and {subplot.more} more, not drawn)" if subplot.more else ""
    axes.legend(
        [handles[name] for name in names],
        words,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        borderaxespad=0.1,
        columnspacing=1.2,
    )
    rows = -(-len(names) // columns)
    _title(axes, subplot, rows)
    return rows


def _draw_map(axes: Axes, grid: Grid) -> None:
    low, high = reach_of(grid)
    values = np.asarray(grid.values, dtype=np.float64)
    values = values[np.argsort(grid.y)][:, np.argsort(grid.x)]
    colours = "PuOr_r" if grid.diverging else "cividis"
    shown = axes.pcolormesh(_borders(grid.x), _borders(grid.y), values, vmin=low, vmax=high, cmap=colours)
    _make_room(axes, letters=6)  # matplotlib chooses the ticks, when it draws
    assert axes.figure is not None
    axes.figure.colorbar(shown, ax=axes, label=grid.value_label)


def _borders(middles: npt.ArrayLike) -> FloatArray:
    """The borders of cells around these middles, in ascending order."""
    at = np.sort(np.asarray(middles, dtype=np.float64))
    low, high = cell_edges(at)
    return np.concatenate([[low], 0.5 * (at[1:] + at[:-1]), [high]])
