"""Which panes Blooming has, and how much room each gets."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Grid, Horizontal, Vertical

from lidarcheck.tui.plots.plot import Plot
from lidarcheck.tui.screens.blooming.draw import LEAST
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.lines import Lines

__all__ = ["TILES", "BloomingPanes"]

TILES = ("profile", "profile2", "profile3", "profile4")
_LEFT, _WIDE, _NARROW = 34, 150, 74
"""Columns of the editor; from which on distances stand side by side; below which there is no room for a plot."""
_GAP = 2


class BloomingPanes(View):
    """An editor on the left; a curve, and one to four profiles, on the right."""

    DEFAULT_CSS = f"""
    BloomingPanes #left {{ width: {_LEFT}; }}
    BloomingPanes.alone #left {{ width: 1fr; }}
    BloomingPanes #curve {{ height: 3fr; }}
    BloomingPanes #profiles {{ height: 4fr; }}
    """

    def compose(self) -> ComposeResult:
        """The editor on the left; curve and profiles on the right."""
        with Horizontal():
            with Vertical(id="left"):
                yield Lines("Table", label="t", id="table")
            with Vertical(id="right"):
                yield Plot("Curve", label="u", id="curve")
                with Grid(id="profiles"):
                    for number, name in enumerate(TILES, start=1):
                        yield Plot("Profile", label="p" if number == 1 else str(number), id=name)

    def curve_pane(self) -> Plot:
        """The pane of the curve."""
        return self.query_one("#curve", Plot)

    def all_tiles(self) -> list[Plot]:
        """The panes of profiles, seen or not."""
        return [self.query_one(f"#{name}", Plot) for name in TILES]

    def tile_panes(self) -> list[Plot]:
        """The panes of profiles that are seen."""
        return [pane for pane in self.all_tiles() if pane.display]

    def panes(self) -> list[Lines]:
        """Those that are seen."""
        return [pane for pane in super().panes() if self._is_seen(pane)]

    def _is_seen(self, pane: Lines) -> bool:
        around = [widget for widget in pane.ancestors_with_self if widget is not self and self in widget.ancestors]
        return all(getattr(widget, "display", True) for widget in around)

    def room_across(self) -> int:
        """How many distances there is room for side by side."""
        width = self.size.width
        return min(len(TILES) - 1, (width - _LEFT + _GAP) // (LEAST[0] + _GAP)) if width >= _WIDE else 1

    def give_room(self, tiles: int, *, four: bool) -> None:
        """Give each pane its room: all that there is to the tiles for the features where it is little."""
        width, height = self.size
        wide = width >= _WIDE
        self.query_one("#left").display = wide or not four
        self.query_one("#right").display = four or width >= _NARROW
        self.set_class(width < _NARROW and not four, "alone")
        # A curve, and two plots below each other with their titles.
        self.curve_pane().display = not four or (wide and height >= 4 * (LEAST[1] + 1))
        columns = tiles if not four else 2 if width >= 2 * LEAST[0] else 1
        grid = self.query_one("#profiles", Grid)
        grid.styles.grid_gutter_vertical = _GAP if width >= 2 * LEAST[0] + _GAP else 0
        grid.styles.grid_size_columns, grid.styles.grid_size_rows = columns, -(-tiles // columns)
        for at, pane in enumerate(self.all_tiles()):
            pane.display = at < tiles
        focused = self.app.focused
        if isinstance(focused, Lines) and focused in super().panes() and not self._is_seen(focused):
            self.panes()[0].focus()
