"""What is seen of a view and where its cursor is: kept for each measurement and view."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from lidarcheck.tui.screens.cloud.density import SIDES, Window, fitted
from lidarcheck.tui.screens.cloud.panes import Points, Seen, View

__all__ = ["Lens"]

_FRAME_OUTER = 1.0
"""Percent of a frame's echoes at either end that the first view of it leaves out: single ones are far off."""
_KEPT = 4


class Lens:
    """Windows by measurement and view; cursors [m] by measurement and side, so that both sides share them."""

    def __init__(self) -> None:
        self._windows: dict[Hashable, Window] = {}
        self._cursors: dict[Hashable, tuple[float, float]] = {}
        self._seen: dict[Hashable, Seen] = {}

    def seen(self, name: str, view: View, points: Points, size: tuple[int, int]) -> Seen:
        """The points of a view in its window, counted; kept, since most of it is soon drawn again."""
        side = SIDES[view.side]
        window = self._windows.get((name, view))
        if window is None:
            outer = _FRAME_OUTER if view.frame else 0.0
            window = fitted(np.concatenate([side.places(one) for one in points.sides]), size, outer)
        key = (id(points), view, window, size)  # `found` holds the points, so that no others have their id
        found = self._seen.pop(key, None) or Seen(points, side, window, size)
        self._seen[key] = found
        while len(self._seen) > _KEPT:
            del self._seen[next(iter(self._seen))]
        return found

    def cursor_m(self, name: str, view: View) -> tuple[float, float] | None:
        """Where the cursor is, as the view has it; None where there is none."""
        return self._cursors.get((name, view.side))

    def cursor(self, name: str, view: View, seen: Seen) -> tuple[int, int] | None:
        """The cell of the cursor."""
        at = self.cursor_m(name, view)
        return None if at is None else seen.window.cell(at, seen.size)

    def move(self, name: str, view: View, seen: Seen, columns: int, rows: int) -> None:
        """Move the cursor by cells; the first time it stands in the middle. Beyond an edge the window goes with it."""
        window, at = seen.window, self.cursor_m(name, view)
        if at is None:
            at = window.middle_m
        else:
            at = at[0] + columns * window.column_m, at[1] + 2.0 * rows * window.column_m
        self._cursors[name, view.side] = at
        column, row = window.cell(at, seen.size)
        right, down = (min(i, 0) + max(i - n + 1, 0) for i, n in zip((column, row), seen.size, strict=True))
        if right or down:
            self._windows[name, view] = window.moved(right * window.column_m, -2.0 * down * window.column_m)

    def zoom(self, name: str, view: View, seen: Seen, by: float) -> None:
        """Nearer or farther, about the cursor, or the middle where there is none."""
        about = self.cursor_m(name, view) or seen.window.middle_m
        self._windows[name, view] = seen.window.zoomed(about, by)

    def fit(self, name: str, view: View) -> None:
        """All again."""
        self._windows.pop((name, view), None)
