"""A map of values as text: a character a cell, the darker the larger; signs where the values diverge from zero."""

from __future__ import annotations

import numpy as np

from lidarcheck.figures.axes.map_cells import cell_edges, reach_of, resampled
from lidarcheck.figures.axes.scales import round_ticks
from lidarcheck.figures.data import Grid
from lidarcheck.figures.terminal.canvas import fit, head_lines

__all__ = ["map_lines"]

_RAMP = ".:-=+*#%@"
_DIVERGING = "=~-.+x#"
"""Far below zero to near, about zero, near to far above."""
_MARGIN = 8


def map_lines(grid: Grid, width: int, height: int) -> list[str]:
    """`height` lines of the map: label and scale, rows from the highest y down, x ticks, x label."""
    label = fit(grid.x_label, width).center(width).rstrip()
    if not np.isfinite(grid.values).any():
        return ["", "(nothing to draw)".center(width).rstrip(), *[""] * (height - 3), label]
    ramp, (low, high) = _DIVERGING if grid.diverging else _RAMP, reach_of(grid)
    head = head_lines(grid.y_label, [f"{grid.value_label} {low:.3g} {ramp} {high:.3g}".strip(), "blank: none"], width)
    rows, columns = height - len(head) - 4, width - _MARGIN - 2
    cells = resampled(grid, rows, columns)
    level = np.clip(np.nan_to_num((cells - low) / (high - low) * len(ramp)), 0, len(ramp) - 1).astype(np.int64)
    text = np.where(np.isfinite(cells), np.array(list(ramp))[level], " ")
    y_words = _y_words(grid, rows)
    body = [
        f"{y_words.get(i, ''):>{_MARGIN}}{'┤' if i in y_words else '│'}{''.join(row)}│" for i, row in enumerate(text)
    ]
    border, x_words = _x_axis(grid, columns)
    top = f"{'':{_MARGIN}}┌{'─' * columns}┐"
    return [*head, top, *body, f"{'':{_MARGIN}}└{border}┘", x_words, label]


def _y_words(grid: Grid, rows: int) -> dict[int, str]:
    """The ticks' texts by row."""
    bottom, top = cell_edges(grid.y)
    places, words = round_ticks(bottom, top, max(rows // 3, 2), False)
    row = [min(int((top - place) / (top - bottom) * rows), rows - 1) for place in places]
    return {i: fit(word, _MARGIN) for i, word in zip(row, words, strict=True)}


def _x_axis(grid: Grid, columns: int) -> tuple[str, str]:
    """The lower border with its ticks, and the line of their texts; a text without room is left out."""
    left, right = cell_edges(grid.x)
    border, line = ["─"] * columns, [" "] * (_MARGIN + columns + 2)
    for place, word in zip(*round_ticks(left, right, max(columns // 10, 4), False), strict=True):
        at = min(int((place - left) / (right - left) * columns), columns - 1)
        border[at] = "┬"
        start = min(_MARGIN + 1 + at - len(word) // 2, len(line) - len(word))
        if not "".join(line[max(start - 1, 0) : start + len(word)]).strip():
            line[start : start + len(word)] = word
    return "".join(border), "".join(line).rstrip()
