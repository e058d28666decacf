"""What the keys of the left side of Blooming do: typing, edits, the cursor and the marks of the editor that is seen."""

from __future__ import annotations

from typing import Any

from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.screens.blooming.panes import BloomingPanes
from lidarcheck.tui.widgets.lines import Lines, cursor_after

__all__ = ["EditActions"]

_LONGEST = 12
"""Letters of a number that is typed."""


class EditActions(BloomingPanes):
    """`editor`: the one that is seen."""

    editor: Editor[Any]

    def draw(self) -> None:
        """Show everything."""
        raise NotImplementedError

    def draw_left(self) -> None:
        """The editor that is seen."""
        title, lines, has_cursor = self.editor.lines()
        self.query_one("#table", Lines).show(lines, title=title, cursor=self.editor.at if has_cursor else None)

    @property
    def at(self) -> int:
        """The row under the cursor."""
        return self.editor.at

    @property
    def marked(self) -> set[int]:
        """The rows that are marked."""
        return self.editor.marked

    # Edits

    def action_type(self, character: str) -> None:
        """Digits type a value. They are bound as all keys are: fast typing must not overtake Enter."""
        editor = self.editor
        if (
            self.query_one("#table", Lines).has_focus
            and len(editor.typed) < _LONGEST
            and (character != "e" or editor.typed)
        ):
            editor.typed += character
            self.draw_left()

    def action_enter(self) -> None:
        """Set the typed value."""
        typed, self.editor.typed = self.editor.typed, ""
        if not typed:
            self.say(self.editor.TYPED)
            return
        self.editor.enter(typed)
        self.draw()

    def action_rub_out(self) -> None:
        """The last digit."""
        self.editor.typed = self.editor.typed[:-1]
        self.draw_left()

    def action_drop(self) -> None:
        """What was typed, or the marks."""
        if self.editor.typed:
            self.editor.typed = ""
        else:
            self.editor.marked.clear()
        self.draw()

    def action_nudge(self, steps: int) -> None:
        """Up or down; within a typed number a minus belongs to it."""
        if steps == -1 and (self.editor.typed.endswith("e") or (self.editor.on_x and not self.editor.typed)):
            self.editor.typed += "-"
            self.draw_left()
            return
        self.editor.nudge(steps)

    def action_cell(self, name: str) -> None:
        """X or Y is typed next."""
        self.editor.choose_cell(name == "x")
        self.draw_left()

    def action_add_row(self) -> None:
        """A row after this one."""
        self.editor.add_row()
        self.draw()

    def action_remove_rows(self) -> None:
        """Without the marked rows."""
        self.editor.remove_rows()
        self.draw()

    def action_smooth(self) -> None:
        """Smooth the rows."""
        self.editor.smooth()

    def action_reload(self) -> None:
        """Read it again; edits are asked about."""
        self.editor.reload()

    # The cursor and the marks

    def action_move(self, key: str) -> None:
        """The cursor, or the plot's pane has nothing to move."""
        editor, rows = self.editor, max(self.query_one("#table", Lines).rows, 1)
        editor.typed = ""
        self._go_to(cursor_after(key, editor.at, editor.count(), rows))

    def _go_to(self, row: int) -> None:
        self.editor.at = row
        self.editor.within()
        self.draw()

    def action_mark(self) -> None:
        """Mark the row, or not."""
        self.editor.marked ^= {self.editor.at}
        self.draw()

    def action_mark_and_move(self, by: int) -> None:
        """Mark while moving."""
        self.editor.marked |= {self.editor.at}
        self._go_to(self.editor.at + by)
        self.editor.marked |= {self.editor.at}
        self.draw()

    def action_mark_all(self) -> None:
        """All, or none."""
        self.editor.marked = set() if self.editor.marked else set(range(self.editor.count()))
        self.draw()
