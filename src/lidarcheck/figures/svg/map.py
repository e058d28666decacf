"""A map of values as SVG text: shades of the page's CSS, and signs where the values diverge from zero."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, IndexArray
from lidarcheck.figures.axes.elements import Subplot
from lidarcheck.figures.axes.map_cells import cell_edges, reach_of, resampled
from lidarcheck.figures.data import Grid
from lidarcheck.figures.svg.shades import LEVELS, box, levels_of, shade, shaded
from lidarcheck.figures.svg.shapes import LETTER, PlotArea, svg, text
from lidarcheck.figures.words import amount

__all__ = ["map_svg"]

_MAP_ROWS, _MAP_COLUMNS = 64, 120


def map_svg(subplot: Subplot, grid: Grid, width: float, height: float) -> str:
    """The map in five or eleven shades, with the scale above it; says so where there is nothing to draw."""
    values = np.asarray(grid.values, dtype=np.float64)
    words = f"{subplot.title}: {grid.value_label or 'value'} over {subplot.x_label} and {subplot.y_label}"
    if not np.isfinite(values).any():
        nothing = text(width / 2.0, height / 2.0, "nothing to draw", "middle", "label")
        return svg(f"{words}: nothing to draw", nothing, name="chart", width=width, height=height)
    frame = PlotArea(cell_edges(grid.x), cell_edges(grid.y), width=width, height=height, left=44.0, top=24.0)
    low, high = reach_of(grid)
    cells = resampled(grid, _number(grid.y, _MAP_ROWS), _number(grid.x, _MAP_COLUMNS))
    seen = np.isfinite(cells)
    level = levels_of(cells / high if grid.diverging else (cells - low) / (high - low))
    parts = shaded(level, seen, lambda chosen: _boxes(chosen, frame))
    if grid.diverging:
        parts.append(_signs(level, frame))
    parts += [frame.axes(frame.x_ticks(), subplot.x_label), _scale(subplot, grid, low, high, width)]
    return svg(
        f"{words}, from {amount(low)} to {amount(high)}", "".join(parts), name="chart", width=width, height=height
    )


def _number(middles: npt.ArrayLike, most: int) -> int:
    """As many cells as there are values, where these are even and few enough; else as many as can be seen."""
    steps = np.abs(np.diff(np.sort(np.asarray(middles, dtype=np.float64))))
    even = not steps.size or float(np.ptp(steps)) <= 0.01 * float(steps.max())
    return min(len(steps) + 1, most) if even else most


def _boxes(chosen: BoolArray, frame: PlotArea) -> str:
    """Cells beside each other in a row are one box."""
    rows, columns = chosen.shape
    wide, high = (frame.right - frame.left) / columns, (frame.bottom - frame.top) / rows
    padded = np.pad(chosen.astype(np.int8), ((0, 0), (1, 1)))
    starts, ends = np.argwhere(np.diff(padded) == 1), np.argwhere(np.diff(padded) == -1)
    return "".join(
        box(frame.left + first * wide, frame.top + row * high, (last - first) * wide, high)
        for (row, first), (_, last) in zip(starts.tolist(), ends.tolist(), strict=True)
    )


def _signs(level: IndexArray, frame: PlotArea) -> str:
    """A minus or plus on shades from the second on, every so many cells, for those who do not see the colours."""
    rows, columns = level.shape
    wide, high = (frame.right - frame.left) / columns, (frame.bottom - frame.top) / rows
    step_x, step_y = max(1, round(12.0 / wide)), max(1, round(12.0 / high))
    path = []
    for row in range(step_y // 2, rows, step_y):
        for column in range(step_x // 2, columns, step_x):
            if abs(int(level[row, column])) < 2:
                continue
            x, y = frame.left + (column + 0.5) * wide, frame.top + (row + 0.5) * high
            path.append(f"M{x - 2.0:.1f} {y:.1f}h4{'m-2-2v4' if level[row, column] > 0 else ''}")
    return f'<path class="sign" d="{"".join(path)}"/>' if path else ""


def _scale(subplot: Subplot, grid: Grid, low: float, high: float, width: float) -> str:
    """The y label, and the shades with the numbers at their ends."""
    levels = range(-LEVELS if grid.diverging else 0, LEVELS + 1)
    last = f"{amount(high)} {grid.value_label}".strip()
    x = width - 6.0 - LETTER * len(last)
    parts = [text(4.0, 13.0, subplot.y_label, "start", "label"), text(x, 13.0, last)]
    x -= 4.0 + 9.0 * len(levels)
    parts += [f'<path class="{shade(level)}" d="M{x + 9.0 * i:.1f} 5h9v10h-9z"/>' for i, level in enumerate(levels)]
    parts.append(text(x - 4.0, 13.0, amount(low), "end"))
    return "".join(parts)
