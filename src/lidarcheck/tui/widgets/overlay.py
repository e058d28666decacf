"""The box over a screen: always laid out and made visible, so that nothing around it is sent again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, Self, TypeVar

from rich.cells import cell_len, set_cell_size
from textual import events
from textual.geometry import Region

from lidarcheck.tui.widgets.lines import Line, Lines, folded, line, printable
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["LEAVES", "Dialog", "Overlay"]

LEAVES = ("escape", "ctrl+g", "ctrl+c")
"""The keys that leave any dialog. Escape is never the only one: a terminal may wait for what comes after it."""
_FRAME, _ROOM_FROM = 4, (40, 12)
"""Columns of the frame; columns and rows from which on a box leaves bars and edges free."""
_MARGIN, _LEAST, _LEAST_ROWS = 8, 60, 10
"""Columns beside a list; columns and rows that it has at least."""

T = TypeVar("T")


class Dialog(Generic[T]):
    """What stands in the box until it is dismissed with an answer, or with None.

    `title`, `keys`: what its first and last line say. `typed`: the line to type in; None for none. `widest`, `most`:
    the columns and lines that it takes at most. `steady`: a smaller box for a list, which stays as it is while its
    lines change. `top`: the first line of its body that is seen; `rows`: how many are, as they were drawn last. `at`:
    the column and row where it belongs; None where it does not hide what it is about.
    """

    typed: Typed | None = None
    widest = 100
    most = 1000
    steady = False
    boxed = True
    keys = "Esc or ^G back"

    def __init__(self, title: str) -> None:
        self.title = title
        self.top = 0
        self.rows = 1
        self.at: tuple[int, int] | None = None
        self.redraw: Callable[[], object] = lambda: None
        self._dismiss: Callable[[Dialog[T], T | None], object] = lambda _self, _value: None

    def body(self, width: int) -> Sequence[Line]:
        """The lines between title and keys, for so many columns."""
        raise NotImplementedError

    def last(self, _width: int) -> Sequence[Line]:
        """Lines between the body and the keys that always stay."""
        return ()

    def cursor(self) -> int | None:
        """The line of the body that has to be seen."""
        return None

    def opened(self) -> None:
        """It is seen now."""

    def listens(self) -> bool:
        """Whether it takes keys already."""
        return True

    def key(self, event: events.Key) -> None:
        """A key that is neither typed nor leaves."""

    def changed(self) -> None:
        """What is typed has changed."""

    def clicked(self, number: int) -> None:
        """A line of the body was clicked."""

    def wheel(self, by: int) -> None:
        """The wheel was turned."""
        self.top += by

    def page(self, pages: int) -> None:
        """Scroll."""
        self.top += pages * max(self.rows, 1)

    def dismiss(self, value: T | None) -> None:
        """Leave with an answer; the dialog below, or the screen, is there again."""
        self._dismiss(self, value)


class Overlay(Lines):
    """Shows one dialog at a time; of those asked meanwhile the last one first. It is given keys, and has no focus."""

    DEFAULT_CSS = "Overlay { layer: over; visibility: hidden; width: 1; height: 1; }"

    def __init__(self, anchor: Callable[[], int | None]) -> None:
        super().__init__(id="overlay", bar=True)
        self._open: list[tuple[Dialog[Any], Callable[[Any], object]]] = []
        self._anchor = anchor
        self._first_body = 0
        self._is_laid_out = True

    @property
    def dialog(self) -> Dialog[Any] | None:
        """The dialog that takes the keys."""
        return self._open[-1][0] if self._open else None

    def ask(self, dialog: Dialog[T], then: Callable[[T | None], object]) -> None:
        """Show a dialog; `then` gets its answer."""
        dialog._dismiss = self._dismissed
        dialog.redraw = self.draw
        self._open.append((dialog, then))
        dialog.opened()
        self.draw()

    def _dismissed(self, dialog: Dialog[Any], value: Any) -> None:
        then = next((then for one, then in self._open if one is dialog), None)
        if then is not None:
            self._open = [pair for pair in self._open if pair[0] is not dialog]
            self.draw()
            then(value)

    def take(self, event: events.Key) -> bool:
        """Hand a key to the dialog; whether there is one."""
        dialog = self.dialog
        if dialog is None:
            return False
        if not dialog.listens():
            return True
        if event.key in LEAVES:
            dialog.dismiss(None)
        elif dialog.typed is not None and dialog.typed.key(event.key, event.character):
            dialog.changed()
        else:
            dialog.key(event)
        self.draw()
        return True

    def paste(self, text: str) -> bool:
        """Put what was pasted into the line to type in; whether there is a dialog."""
        dialog = self.dialog
        if dialog is not None and dialog.typed is not None:
            dialog.typed.insert(text)
            dialog.changed()
            self.draw()
        return dialog is not None

    def draw(self) -> None:
        """The dialog in its place, or nothing."""
        dialog = self.dialog
        if dialog is None or not dialog.boxed:
            self.visible = False
            return
        columns, rows = self.app.size
        roomy = columns >= _ROOM_FROM[0] and rows >= _ROOM_FROM[1]
        width, most = (columns - 4, 3 * rows // 5) if roomy else (columns, rows)
        if dialog.steady and roomy:
            width, most = min(width, max(columns - 2 * _MARGIN, _LEAST)), max(rows // 2, _LEAST_ROWS)
        width = max(min(width, dialog.widest), 1)
        lines = self._framed(dialog, width, max(min(most, dialog.most), 1))
        self._is_laid_out = (width, len(lines)) == self.size
        self.styles.width, self.styles.height = width, len(lines)
        self.styles.offset = self._place(dialog, width, len(lines), roomy)
        self.visible = True
        self.show(lines)

    def refresh(self, *regions: Region, repaint: bool = True, layout: bool = False, recompose: bool = False) -> Self:
        """While another size is laid out, which draws all of it, nothing is drawn besides."""
        repaint = repaint and (bool(regions) or self._is_laid_out)
        if not repaint:  # textual keeps what it drew of a widget until its width is another one
            self._styles_cache.clear()
        return super().refresh(*regions, repaint=repaint, layout=layout, recompose=recompose)

    def _framed(self, dialog: Dialog[Any], width: int, most: int) -> list[Line]:
        """All lines of the box: frame, what is typed, the part of the body that is seen, keys."""
        inner = max(width - _FRAME, 1)
        heading = cell_len(printable(dialog.title)) <= inner - 2
        above = [] if heading else list(folded(line(dialog.title, "title"), inner))
        if dialog.typed is not None:
            above.append((("> ", "title"), *dialog.typed.line(inner - 2)))
        below = [*dialog.last(inner), *folded(line(dialog.keys, "title"), inner)]
        body = list(dialog.body(inner))
        room = max(most - 2 - len(above) - len(below), 1)
        dialog.rows = room if dialog.steady else min(len(body), room)
        at = dialog.cursor()
        if at is not None:
            dialog.top = min(max(dialog.top, at - dialog.rows + 1), at)
        dialog.top = max(min(dialog.top, len(body) - dialog.rows), 0)
        seen = body[dialog.top : dialog.top + dialog.rows]
        seen += [()] * (dialog.rows - len(seen))
        self._first_body = 1 + len(above)
        left = len(body) - dialog.top - dialog.rows
        words = f" {printable(dialog.title)} " if heading else ""
        more = f" {left} more " if left > 0 else ""
        dashes = max(width - 3 - cell_len(words), 0)
        top = line(f"+-{words}{'-' * dashes}+", "title")
        end = line(f"+{'-' * max(width - 3 - len(more), 0)}{more}-+", "title")
        return [top, *(_between(parts, inner) for parts in [*above, *seen, *below]), end][: max(most, 1)]

    def _place(self, dialog: Dialog[Any], width: int, height: int, roomy: bool) -> tuple[int, int]:
        """Where the box lies: beside the row that it is about, on none of the bars where there is room."""
        columns, rows = self.app.size
        first, last = (2, rows - 2) if roomy else (0, rows)
        if dialog.at is not None:
            x, y = dialog.at
            return max(min(x, columns - width), 0), max(min(y, last - height), 0)
        anchor = self._anchor()
        y = first + (last - first - height) // 2
        if anchor is not None and y <= anchor < y + height:
            y = last - height if last - height > anchor else first
        return max((columns - width) // 2, 0), max(y, 0)

    def on_resize(self, event: events.Resize) -> None:
        """What was laid out was drawn with it, and is not sent once more."""
        event.prevent_default()
        self._drawn = [self._line(y) for y in range(self.size.height)]
        self.call_later(self._laid_out)

    def _laid_out(self) -> None:
        self._is_laid_out = True

    def on_click(self, event: events.Click) -> None:
        """A line of the body."""
        event.stop()
        dialog, number = self.dialog, event.y - self._first_body
        if dialog is not None and dialog.listens() and 0 <= number < dialog.rows:
            dialog.clicked(dialog.top + number)
            self.draw()

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Go on in the body."""
        self._wheel(event, 1)

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Go back in it."""
        self._wheel(event, -1)

    def _wheel(self, event: events.MouseEvent, by: int) -> None:
        event.stop()
        if self.dialog is not None:
            self.dialog.wheel(by)
            self.draw()


def _between(parts: Line, inner: int) -> Line:
    """A line between the sides of the frame, cut or filled to its width."""
    found: list[Any] = [("| ", "text")]
    room = inner
    for text, role in parts:
        fits = printable(text)
        if cell_len(fits) > room:
            fits = set_cell_size(fits, room)
        if fits:
            found.append((fits, role))
        room -= cell_len(fits)
    if room:
        found.append((" " * room, "text"))
    return (*found, (" |", "text"))
