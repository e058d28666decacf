"""A pane of lines, of which only those that changed are sent to the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

from rich.segment import Segment
from textual import events
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from lidarcheck.tui.themes import Role, style

__all__ = ["Line", "Lines", "line", "printable", "wrapped"]

Line = tuple[tuple[str, Role], ...]


def line(text: str, role: Role = "text") -> Line:
    """A line of one look."""
    return ((text, role),)


def wrapped(text: str, width: int, role: Role = "text") -> list[Line]:
    """A text as lines of one look that fit the width, each behind a blank, the later ones further in."""
    fits = textwrap.wrap(text, max(width - 1, 20), initial_indent=" ", subsequent_indent="   ")
    return [line(part, role) for part in fits]


def printable(text: str) -> str:
    """A text that cannot drive the terminal, whatever a file has in it."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class Lines(Widget, can_focus=True):
    """Lines under a title, scrolled so that the cursor's line is seen. Without a title it is a bar, not a pane."""

    DEFAULT_CSS = "Lines { height: 1fr; width: 1fr; } Lines.bar { height: 1; }"

    def __init__(self, title: str = "", *, label: str = "", id: str | None = None, bar: bool = False) -> None:
        super().__init__(id=id, classes="bar" if bar else None)
        self.bar = bar
        self.label = label
        self.can_focus = not bar
        self.lines: list[Line] = []
        self.cursor: int | None = None
        self._title = title
        self._top = 0
        self._drawn: list[Line] = []
        self.when_resized: Callable[[], object] = lambda: None

    def show(self, lines: Sequence[Line], *, title: str | None = None, cursor: int | None = None) -> None:
        """Show these lines; only what differs is drawn anew."""
        self.lines = list(lines)
        self.cursor = cursor
        self._title = self._title if title is None else title
        self._redraw()

    @property
    def rows(self) -> int:
        """How many lines are seen at once."""
        return max(self.size.height - (0 if self.bar else 1), 0)

    @property
    def text(self) -> str:
        """All lines as text, for the clipboard or a file."""
        return "".join(f"{''.join(text for text, _ in parts).rstrip()}\n" for parts in self.lines)

    def page(self, pages: int) -> None:
        """Scroll by pages, where there is no cursor."""
        self._top = max(min(self._top + pages * max(self.rows, 1), len(self.lines) - self.rows), 0)
        self._redraw()

    def _redraw(self) -> None:
        rows = self.rows
        if self.cursor is not None and rows:
            self._top = min(max(self._top, self.cursor - rows + 1), self.cursor)
        self._top = max(min(self._top, len(self.lines) - rows), 0)
        wanted = [self._line(y) for y in range(self.size.height)]
        if len(wanted) != len(self._drawn):
            self.refresh()
        else:
            changed = [Region(0, y, self.size.width, 1) for y, new in enumerate(wanted) if new != self._drawn[y]]
            if changed:
                self.refresh(*changed)
        self._drawn = wanted

    def _line(self, y: int) -> Line:
        if not self.bar:
            if y == 0:
                focus = self.has_focus
                label = f"[{self.label}] " if self.label else ""
                return line(f"{'>' if focus else ' '}{label}{self._title}", "focus" if focus else "title")
            y -= 1
        at = self._top + y
        if at >= len(self.lines):
            return ()
        parts = self.lines[at]
        return tuple((text, "cursor") for text, _ in parts) if at == self.cursor and self.has_focus else parts

    def render_line(self, y: int) -> Strip:
        """One line as textual wants it."""
        theme = self.app.theme
        segments = [Segment(printable(text), style(theme, role)) for text, role in self._line(y)]
        return Strip(segments).adjust_cell_length(self.size.width, style(theme, "text"))

    def on_resize(self, _event: events.Resize) -> None:
        """Keep the cursor in sight."""
        self._drawn = []
        self._redraw()
        self.when_resized()

    def on_focus(self) -> None:
        """The title says where the focus is."""
        self._redraw()

    def on_blur(self) -> None:
        """It is elsewhere."""
        self._redraw()

    def on_click(self) -> None:
        """The mouse can choose a pane, and no more."""
        if self.can_focus:
            self.focus()
