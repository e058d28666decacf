"""A pane of lines, of which only those that changed are sent to the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from itertools import accumulate, groupby
from typing import ClassVar

from rich.cells import cell_len
from rich.segment import Segment
from textual import events
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from lidarcheck.printable import printable
from lidarcheck.tui.plots.colours import depth_of
from lidarcheck.tui.widgets.themes import Role, style

__all__ = [
    "CURSOR_KEYS",
    "Line",
    "Lines",
    "changed_spans",
    "cursor_after",
    "diff_lines",
    "hanging",
    "is_old",
    "line",
    "printable",
    "wrapped",
]

Line = tuple[tuple[str, Role], ...]
_INDENT_FROM = 20
_JUMP = 8
"""Columns that are cheaper to send again than to jump over."""
CURSOR_KEYS = ("up", "down", "pageup", "pagedown", "home", "end")
"""The keys that move a cursor, or scroll."""


def is_old(state: str) -> bool:
    """Whether what is shown in such a state is of other inputs than those that are set."""
    return state not in ("", "current", "expected")


def line(text: str, role: Role = "text") -> Line:
    """A line of one look."""
    return ((text, role),)


def cursor_after(key: str, at: int, count: int, page: int) -> int:
    """Where one of `CURSOR_KEYS` moves a cursor at `at` in a list of `count`; Page Up and Down move by `page`."""
    steps = {"up": -1, "down": 1, "pageup": -page, "pagedown": page, "home": -count, "end": count}
    return max(min(at + steps[key], count - 1), 0)


def wrapped(text: str, width: int, role: Role = "text") -> list[Line]:
    """A text in as many lines of one look as it needs."""
    return [line(part, role) for part in textwrap.wrap(text, max(width, 20))]


def hanging(text: str, width: int, role: Role = "text") -> list[Line]:
    """A text as lines of one look that fit the width, each behind a blank, the later ones further in."""
    fits = textwrap.wrap(text, max(width - 1, 20), initial_indent=" ", subsequent_indent="   ")
    return [line(part, role) for part in fits]


def diff_lines(lines: Sequence[str]) -> list[Line]:
    """The lines of a unified diff, each in the role of its first letter."""
    roles: dict[str, Role] = {"+": "good", "-": "bad", "@": "title"}
    return [line(text, roles.get(text[:1], "text")) for text in lines]


def folded(parts: Line, width: int) -> list[Line]:
    """A line in as many as fit the width, broken at blanks where there are some, the later ones further in."""
    if sum(cell_len(printable(text)) for text, _ in parts) <= width:
        return [parts]
    letters = [(letter, role) for text, role in parts for letter in printable(text)]
    found: list[Line] = []
    while letters:
        indent = "  " if found and width > _INDENT_FROM else ""
        room, fits = width - len(indent), 0
        for letter, _ in letters:
            room -= cell_len(letter)
            if room < 0:
                break
            fits += 1
        if fits < len(letters):
            blank = next((at for at in range(fits, fits // 2, -1) if letters[at][0] == " "), None)
            fits = blank + 1 if blank is not None else max(fits, 1)
        now, letters = letters[:fits], letters[fits:]
        runs = [("".join(letter for letter, _ in run), role) for role, run in groupby(now, lambda one: one[1])]
        found.append((*line(indent), *runs) if indent else tuple(runs))
    return found


def changed_spans(old: Line, new: Line) -> list[tuple[int, int]]:
    """(first column, columns) of what differs between two lines; near ones together, since a jump is not free either.

    A line with letters that are two columns wide differs as a whole.
    """
    before, after = ([(letter, role) for text, role in parts for letter in printable(text)] for parts in (old, new))
    if before == after:
        return []
    if any(not letter.isascii() and cell_len(letter) != 1 for letter, _ in (*before, *after)):
        return [(0, max(sum(cell_len(letter) for letter, _ in cells) for cells in (before, after)))]
    long = max(len(before), len(after))
    blank: tuple[str, Role] = (" ", "text")
    before, after = ([*cells, *[blank] * (long - len(cells))] for cells in (before, after))
    spans: list[tuple[int, int]] = []
    for x, (one, other) in enumerate(zip(before, after, strict=True)):
        if one == other:
            continue
        if spans and x - sum(spans[-1]) < _JUMP:
            spans[-1] = (spans[-1][0], x + 1 - spans[-1][0])
        else:
            spans.append((x, 1))
    return spans


class Lines(Widget, can_focus=True):
    """Lines under a title, scrolled so that the cursor's line is seen. Without a title it is a bar, not a pane.

    `folds`: a line that is wider than the pane goes on in the next, so that all of it can be read.
    """

    KIND: ClassVar[str] = ""
    """The kind of pane, as of an `Action`."""
    DEFAULT_CSS = "Lines { height: 1fr; width: 1fr; } Lines.bar { height: 1; }"

    def __init__(
        self, title: str = "", *, label: str = "", id: str | None = None, bar: bool = False, folds: bool = False
    ) -> None:
        super().__init__(id=id, classes="bar" if bar else None)
        self.bar, self.folds = bar, folds
        self.label = label
        self._labelled = False
        self.can_focus = not bar
        self.lines: list[Line] = []
        self.cursor: int | None = None
        self._rows: list[Line] = []
        self._row: int | None = None
        self.state = ""
        self._title = title
        self._top = 0
        self._drawn: list[Line] = []
        self.when_resized: Callable[[], object] = lambda: None

    def show(
        self, lines: Sequence[Line], *, title: str | None = None, cursor: int | None = None, state: str = ""
    ) -> None:
        """Show these lines; only what differs is drawn anew. `state`: whether they belong to what is set, in words that
        stand at the right end of the title.
        """
        self.lines = list(lines)
        self.state = state
        self.cursor = cursor
        self._title = self._title if title is None else title
        self._fold()
        self._redraw()

    def _fold(self) -> None:
        """The rows that the lines take; the cursor's is the last of its line."""
        self._rows, self._row = self.lines, self.cursor
        if self.folds and self.size.width > 0:
            rows = [folded(parts, self.size.width) for parts in self.lines]
            self._rows = [part for one in rows for part in one]
            self._row = None if self.cursor is None else sum(map(len, rows[: self.cursor + 1])) - 1

    @property
    def rows(self) -> int:
        """How many lines are seen at once."""
        return max(self.size.height - (0 if self.bar else 1), 0)

    @property
    def cursor_y(self) -> int | None:
        """The row of the screen on which the cursor is; None where there is none, or it is not seen."""
        if self._row is None or not self._top <= self._row < self._top + self.rows:
            return None
        return self.region.y + self._row - self._top + (0 if self.bar else 1)

    @property
    def text(self) -> str:
        """All lines as text, for the clipboard or a file."""
        return "".join(f"{''.join(text for text, _ in parts).rstrip()}\n" for parts in self.lines)

    def page(self, pages: int) -> None:
        """Scroll by pages, where there is no cursor."""
        self._top = max(min(self._top + pages * max(self.rows, 1), len(self._rows) - self.rows), 0)
        self._redraw()

    def scroll_lines(self, by: int) -> None:
        """Scroll by lines, where there is no cursor."""
        self._top = max(min(self._top + by, len(self._rows) - self.rows), 0)
        self._redraw()

    def line_at(self, y: int) -> int | None:
        """The number of the line on a row of the screen; None for the title and below the last."""
        row = self._top + y - self.region.y - (0 if self.bar else 1)
        if not self._top <= row < len(self._rows):
            return None
        if not self.folds or self.size.width <= 0:
            return row
        ends = accumulate(len(folded(parts, self.size.width)) for parts in self.lines)
        return next((number for number, end in enumerate(ends) if row < end), None)

    def scroll_by_key(self, key: str) -> None:
        """Scroll a page up or down, by one of `CURSOR_KEYS`."""
        self.page(-1 if key in ("up", "pageup", "home") else 1)

    def show_label(self, is_shown: bool) -> None:
        """Have the letter to jump here stand out."""
        self._labelled = is_shown
        self._redraw()

    def _redraw(self) -> None:
        rows = self.rows
        if self._row is not None and rows:
            self._top = min(max(self._top, self._row - rows + 1), self._row)
        self._top = max(min(self._top, len(self._rows) - rows), 0)
        wanted = [self._line(y) for y in range(self.size.height)]
        if len(wanted) != len(self._drawn):
            self.refresh()
        else:
            changed = [
                Region(x, y, columns, 1)
                for y, new in enumerate(wanted)
                if new != self._drawn[y]
                for x, columns in changed_spans(self._drawn[y], new)
            ]
            if changed:
                self.refresh(*changed)
        self._drawn = wanted

    def _line(self, y: int) -> Line:
        if not self.bar:
            if y == 0:
                heading = self._over_label(self._heading()) if self._labelled else self._heading()
                return (*heading, *line(self._short_state, "dim" if self.state == "current" else "edited"))
            y -= 1
        at = self._top + y
        if at >= len(self._rows):
            return ()
        parts = self._rows[at]
        if is_old(self.state):
            parts = tuple((text, "dim") for text, _ in parts)
        return tuple((text, "cursor") for text, _ in parts) if at == self._row and self.has_focus else parts

    def _over_label(self, heading: Line) -> Line:
        """The title with its letter standing out."""
        (words, look), *others = heading
        before, label, after = words.partition(f"[{self.label}]")
        return ((before, look), (label, "cursor"), (after, look), *others)

    def _heading(self) -> Line:
        """The title, up to where the state begins."""
        label = f"[{self.label}] " if self.label else ""
        words = self._beside_state(f"{'>' if self.has_focus else ' '}{label}{self._title}")
        return line(words, "focus" if self.has_focus else "title")

    @property
    def _short_state(self) -> str:
        """The state in two thirds of the title at most: why something failed stands elsewhere in full."""
        most = max(2 * self.size.width // 3, 1)
        return self.state if len(self.state) <= most else f"{self.state[: most - 2]}.."

    def _beside_state(self, words: str) -> str:
        """The title as long as the state leaves room, which stands at the right end."""
        if not self.state:
            return words
        room = max(self.size.width - cell_len(printable(self._short_state)) - 1, 0)
        words = printable(words)
        if cell_len(words) > room:
            while words and cell_len(words) > max(room - 2, 0):
                words = words[:-1]
            words += ".."[: max(room, 0)]
        return f"{words}{' ' * (room - cell_len(words))} "

    def render_line(self, y: int) -> Strip:
        """One line as textual wants it."""
        theme, depth = self.app.theme, depth_of(self.app)
        segments = [Segment(printable(text), style(theme, role, depth)) for text, role in self._line(y)]
        # One run of a look is sent once, not a piece at a time.
        return Strip(segments).adjust_cell_length(self.size.width, style(theme, "text")).simplify()

    def on_resize(self, _event: events.Resize) -> None:
        """Keep the cursor in sight."""
        self._drawn = []
        self._fold()
        self._redraw()
        self.when_resized()

    def on_focus(self) -> None:
        """The title says where the focus is."""
        self._redraw()

    def on_blur(self) -> None:
        """It is elsewhere."""
        self._redraw()
