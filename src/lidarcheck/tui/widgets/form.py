"""A form: a row for each value that a command takes, and the command itself as the last, which starts it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from textual import events

from lidarcheck.tui.jobs.forms.form import CommandForm, Field
from lidarcheck.tui.widgets.choose import Choose
from lidarcheck.tui.widgets.dialogs import AskText
from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, cursor_after, folded, line
from lidarcheck.tui.widgets.overlay import Dialog
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["Form", "Pick"]

_LABEL = 16
_LETTERS = {"j": "down", "k": "up", "h": "left", "l": "right"}

AskOf = Callable[[Dialog[Any], Callable[[Any], object]], None]


class Form(Dialog[bool]):
    """Gives True when the command is to be started with the values that `form` then has.

    `directory`: where the results will lie; `ask`: how a dialog is shown over this one; `notes`: what else there is to
    say before it is started.
    """

    widest = 100
    keys = "Enter changes a value, and starts the command   Left Right next value   Esc or ^G back"

    def __init__(self, form: CommandForm, directory: str, ask: AskOf, notes: Sequence[str] = ()) -> None:
        super().__init__(form.title)
        self.form, self.directory, self.notes = form, directory, list(notes)
        self._ask = ask
        self.row = len(form.fields)
        self._lines_of: list[int] = []

    @property
    def field(self) -> Field | None:
        """The field under the cursor; None on the command."""
        return self.form.fields[self.row] if self.row < len(self.form.fields) else None

    def cursor(self) -> int | None:
        """The line of the row under the cursor."""
        return self._lines_of.index(self.row) if self.row in self._lines_of else None

    def body(self, width: int) -> list[Line]:
        """The fields, what the one under the cursor means, notes, and the command."""
        lines: list[Line] = []
        self._lines_of = []
        for number, field in enumerate(self.form.fields):
            mark, role = ("> ", "cursor") if number == self.row else ("  ", "text")
            value = self._shown(field, width - _LABEL - 4)
            lines.append(((f"{mark}{field.label:{_LABEL}} ", role), (value, role)))  # type: ignore[arg-type]
            self._lines_of.append(number)
        about = self.field.about if self.field is not None else ""
        lines.append(line(f"  {about}", "dim"))
        self._lines_of.append(-1)
        for note in self.notes:
            parts = folded(line(f"  {note}", "edited"), width)
            lines += parts
            self._lines_of += [-1] * len(parts)
        words, able = self.form.line(self.directory)
        here = self.row == len(self.form.fields)
        text = f"{'> ' if here else '  '}{'' if able else 'not yet: '}{words}"
        parts = folded(line(text, "cursor" if here and able else "title" if able else "bad"), width)
        lines += parts
        self._lines_of += [len(self.form.fields)] * len(parts)
        return lines

    def _shown(self, field: Field, width: int) -> str:
        values = [value for value in self.form.values.get(field.name, ()) if value]
        if not values:
            return "-"
        text, count = values[0], 1
        for value in values[1:]:
            more = f", {value}"
            if len(text) + len(more) > width - len(" and 99 more"):
                return f"{text} and {len(values) - count} more"
            text, count = text + more, count + 1
        return text

    def key(self, event: events.Key) -> None:
        """Move, change a value, start."""
        key = _LETTERS.get(event.key, event.key)
        if key in CURSOR_KEYS:
            self.row = cursor_after(key, self.row, len(self.form.fields) + 1, 5)
        elif key in ("left", "right"):
            self._next(1 if key == "right" else -1)
        elif key == "enter":
            self._enter()
        elif key == "q":
            self.dismiss(None)

    def clicked(self, number: int) -> None:
        """As Enter on that row; the first click goes there."""
        row = self._lines_of[number] if number < len(self._lines_of) else -1
        if row >= 0 and row == self.row:
            self._enter()
        elif row >= 0:
            self.row = row

    def _next(self, by: int) -> None:
        field = self.field
        if field is None or field.several or not field.options:
            return
        now = next(iter(self.form.values.get(field.name, ())), "")
        at = field.options.index(now) if now in field.options else -by
        self._take(field, (field.options[(at + by) % len(field.options)],))

    def _enter(self) -> None:
        field = self.field
        if field is None:
            if self.form.line(self.directory)[1]:
                self.dismiss(True)
        elif field.several:
            on = self.form.values.get(field.name, ())
            switches = [_Switch(name, name in on) for name in field.options]
            self._ask(Choose(f"{self.title}: {field.label}", switches), lambda names: self._several(field, names))
        elif field.options:
            self._ask(Pick(f"{self.title}: {field.label}", field.options), lambda name: self._one(field, name))
        else:
            now = next(iter(self.form.values.get(field.name, ())), "")
            ask = _AskValue(f"{self.title}: {field.label}", now, [line(field.about, "dim")] if field.about else [])
            self._ask(ask, lambda text: self._one(field, text))

    def _several(self, field: Field, names: frozenset[str] | None) -> None:
        if names is not None:
            self._take(field, tuple(name for name in field.options if name in names))

    def _one(self, field: Field, text: str | None) -> None:
        if text is not None:
            self._take(field, (text,))

    def _take(self, field: Field, values: tuple[str, ...]) -> None:
        self.form.values[field.name] = values
        self.redraw()


class Pick(Dialog[str]):
    """One of many, found by letters of it."""

    steady = True
    keys = "Type a part of it   Enter takes it   Esc or ^G back"

    def __init__(self, title: str, options: Sequence[str]) -> None:
        super().__init__(title)
        self.typed: Typed = Typed()
        self._options = self._found = list(options)
        self._row = 0

    def changed(self) -> None:
        """Narrow it down."""
        words = self.typed.text.lower().split()
        self._found = [one for one in self._options if all(word in one.lower() for word in words)]
        self._row = 0

    def key(self, event: events.Key) -> None:
        """Take the one under the cursor, or move it."""
        if event.key == "enter":
            self.dismiss(self._found[self._row] if self._found else None)
        elif event.key in CURSOR_KEYS:
            self._row = cursor_after(event.key, self._row, len(self._found), max(self.rows, 1))

    def clicked(self, number: int) -> None:
        """Take it."""
        if number < len(self._found):
            self.dismiss(self._found[number])

    def cursor(self) -> int | None:
        """The one that Enter takes."""
        return self._row

    def body(self, width: int) -> list[Line]:
        """One a line."""
        rows = enumerate(self._found)
        lines = [
            line(f"{'>' if n == self._row else ' '} {one or '-'}", "cursor" if n == self._row else "text")
            for n, one in rows
        ]
        return lines or [line("nothing is called so", "dim")]


class _AskValue(AskText):
    """A text, which may be empty; None where it was left."""

    def key(self, event: events.Key) -> None:
        """Enter takes it also where it is empty."""
        if event.key == "enter" and self.typed is not None:
            self.dismiss(self.typed.text.strip())
        else:
            super().key(event)


@dataclass(frozen=True)
class _Switch:
    name: str
    on: bool
    words: str = ""
    able: bool = True
