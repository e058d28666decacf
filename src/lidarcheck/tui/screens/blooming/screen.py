"""Blooming: the table of a LUT or the settings of distances, edited by keys, beside curve and profiles."""

from __future__ import annotations

import time
from typing import Any, ClassVar

from textual import events
from textual.binding import Binding

from lidarcheck.formats.lut import Axis
from lidarcheck.session.lut_session import LutSession
from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.screens.blooming.panes import TILES, BloomingPanes
from lidarcheck.tui.screens.blooming.plots import DEBOUNCE_S, BloomingPlots
from lidarcheck.tui.screens.blooming.settings import SettingsEditor
from lidarcheck.tui.screens.blooming.table import TableEditor
from lidarcheck.tui.screens.shared.view import bindings
from lidarcheck.tui.widgets.dialogs import AskText
from lidarcheck.tui.widgets.lines import Lines

__all__ = ["Blooming"]

_TYPED = {**{digit: digit for digit in "0123456789e"}, "full_stop": "."}


class Blooming(BloomingPanes):
    """Two editors that share the left side, and the plots."""

    NAME = "blooming"
    WORDS: ClassVar[dict[str, str]] = {
        "table": "The table: X, Y as a whole number from 1 to 1000 on the log scale (0.007 decades a step; 0 is no "
        "light), and the true Y. '*' marks rows that edits are for; without any it is the row under the cursor. '~' "
        "stands behind what is edited and not saved. Type digits to set a scaled value, with a point (0.0125) a true "
        "Y; Enter sets it. Every edit is on the disk before you see it: after a lost connection the next start offers "
        "it again. E changes to the settings of each distance for this model's variant and this table's direction, "
        "and back; they are edited by the same keys, and have their own undo and save. '<- here' stands at those that "
        "say where the target of the distance shown is.",
        "curve": "The curve of the table on a log scale: the table as it is edited, as the disk has it, and the "
        "cursor.",
        "profile": "What was measured over the offset from the target, and what is expected, without noise, "
        "with the table as it is edited. It follows an edit by itself. n and p go to the next and previous distance, "
        "v to the next feature. From 150 columns on up to three distances stand side by side, and < > is about the "
        "one that n and p go on from. V shows all four features of one distance, and goes back.",
    }
    WORDS |= dict.fromkeys(TILES, WORDS["profile"])
    BINDINGS: ClassVar[list[Any]] = [
        *bindings("blooming"),
        *(Binding(key, f"move('{key}')", show=False) for key in ("up", "down", "pageup", "pagedown", "home", "end")),
        *(Binding(key, f"type('{character}')", show=False) for key, character in _TYPED.items()),
        Binding("backspace", "rub_out", show=False),
        Binding("escape", "drop", show=False),
    ]

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.axis: Axis = "vertical"
        self.table, self.settings = TableEditor(self), SettingsEditor(self)
        self.editor: Editor[Any] = self.table
        self.plots = BloomingPlots(self)
        self._drawn_at = 0.0
        self._looked_back = False

    def on_mount(self) -> None:
        """One clock, which sends nothing while nothing changes: a look at the files."""
        self.set_interval(2.0, self._look_at_disk)
        for pane in (self.query_one("#curve", Lines), *self.all_tiles()):
            pane.when_resized = self.plots.later
        self.give_room()

    def on_resize(self, _event: events.Resize) -> None:
        """What there is room for."""
        self.give_room()

    # What is shown

    @property
    def session(self) -> LutSession | None:
        """The LUT file that is open."""
        return self.table.session

    @property
    def at(self) -> int:
        """The row under the cursor."""
        return self.editor.at

    @property
    def marked(self) -> set[int]:
        """The rows that are marked."""
        return self.editor.marked

    def project_changed(self) -> None:
        """Open what was open, or what an ended session left."""
        self.table.find()
        if not self._looked_back:
            self._looked_back = True
            self.settings.look_back()
            if self.settings.session is not None and self.settings.session.found:
                self.editor = self.settings
        self.plots.find()
        self.give_room()
        self.draw()

    def opened(self) -> None:
        """The screen is seen: profiles are read now and not before."""
        self.plots.opened()
        self.give_room()
        self.draw()

    def unsaved(self) -> int:
        """Rows and values that are edited and not saved."""
        return self.table.unsaved() + self.settings.all_unsaved()

    def draw(self) -> None:
        """The left side; the plots follow when the hand rests."""
        self._draw_left()
        self.plots.later()

    def _draw_left(self) -> None:
        title, lines, has_cursor = self.editor.lines()
        self.query_one("#table", Lines).show(lines, title=title, cursor=self.editor.at if has_cursor else None)

    def settings_shown(self) -> None:
        """Something that the settings say of the dataset shown may be another."""
        if self.editor is self.settings:
            self._draw_left()

    def edited(self) -> None:
        """An edit: the curve follows at once, unless keys come faster than it can be sent."""
        self.draw()
        now = time.monotonic()
        if now - self._drawn_at > DEBOUNCE_S:
            self.plots.redraw_curve()
        self._drawn_at = now
        if not self.query_one("#left").display and self.editor is self.table and self.session is not None:
            self.say(self.table.under_cursor())

    # Edits

    def action_type(self, character: str) -> None:
        """Digits type a value. They are bound as all keys are: fast typing must not overtake Enter."""
        editor = self.editor
        if self.query_one("#table", Lines).has_focus and len(editor.typed) < 12 and (character != "e" or editor.typed):
            editor.typed += character
            self._draw_left()

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
        self._draw_left()

    def action_drop(self) -> None:
        """What was typed, or the marks."""
        if self.editor.typed:
            self.editor.typed = ""
        else:
            self.editor.marked.clear()
        self.draw()

    def action_nudge(self, steps: int) -> None:
        """Up or down; within a typed number a minus belongs to it."""
        if self.editor.typed.endswith("e") and steps == -1:
            self.editor.typed += "-"
            self._draw_left()
            return
        self.editor.nudge(steps)

    def action_smooth(self) -> None:
        """Smooth the rows."""
        self.editor.smooth()

    def action_undo(self) -> None:
        """Take back."""
        self.editor.undo()

    def action_redo(self) -> None:
        """Make again."""
        self.editor.redo()

    def action_diff(self) -> None:
        """What saving would change."""
        self.editor.diff()

    def action_save(self) -> None:
        """Show what changes, then save."""
        self.editor.save()

    def action_reload(self) -> None:
        """Read it again; edits are asked about."""
        self.editor.reload()

    def _look_at_disk(self) -> None:
        if self.is_on_screen and not (self.table.asking or self.settings.asking):
            self.table.look_at_disk()
            if not self.table.asking:
                self.settings.look_at_disk()

    def action_settings(self) -> None:
        """The other editor."""
        if self.editor is self.settings and self.query_one("#left").display:
            self.editor = self.table
        else:
            self.editor = self.settings
        words = self.editor.session.read_only if self.editor.session is not None else ""
        if words:
            self.say(words, bad=True)
        elif self.editor.session is not None:
            self.say(self.host.inside(str(self.editor.session.path)))
        if not self.query_one("#left").display:
            self.action_arrange()
        self.query_one("#table", Lines).focus()
        self.draw()

    def action_add_distance(self) -> None:
        """Settings of one more distance."""
        if self._is_on_settings():
            guess = self.plots.distance_in_words()
            self.app.push_screen(AskText("Settings for which distance [m]?", guess), self.settings.add)

    def action_remove_distance(self) -> None:
        """No settings for the distance under the cursor."""
        if self._is_on_settings():
            self.settings.remove()

    def _is_on_settings(self) -> bool:
        if self.editor is not self.settings:
            self.say("that is for the settings of distances: E shows them")
        return self.editor is self.settings

    # The cursor and the marks

    def action_move(self, key: str) -> None:
        """The cursor, or the plot's pane has nothing to move."""
        rows, last = max(self.query_one("#table", Lines).rows, 1), 10**6
        steps = {"up": -1, "down": 1, "pageup": -rows, "pagedown": rows, "home": -last, "end": last}
        self.editor.typed = ""
        self._move(steps[key])

    def _move(self, by: int) -> None:
        self.editor.at += by
        self.editor.within()
        self.draw()

    def action_mark(self) -> None:
        """Mark the row, or not."""
        self.editor.marked ^= {self.editor.at}
        self.draw()

    def action_mark_and_move(self, by: int) -> None:
        """Mark while moving."""
        self.editor.marked |= {self.editor.at}
        self._move(by)
        self.editor.marked |= {self.editor.at}
        self.draw()

    def action_mark_all(self) -> None:
        """All, or none."""
        self.editor.marked = set() if self.editor.marked else set(range(self.editor.count()))
        self.draw()

    # Other tables, files and datasets

    def action_next_table(self) -> None:
        """The other table of the file."""
        if self.session is None or len(self.session.current.tables) < 2:
            self.say("the file has one table")
            return
        self.axis = "horizontal" if self.axis == "vertical" else "vertical"
        self.table.at, self.table.marked, self.table.typed = 0, set(), ""
        self._looked_for()

    def action_next_file(self) -> None:
        """The next LUT file; edits of this one stay in its journal until they are saved."""
        if self.table.next_file():
            self._looked_for()

    def _looked_for(self) -> None:
        self.plots.find()
        self.give_room()
        self.draw()

    def action_next_dataset(self, by: int) -> None:
        """The next distance."""
        self.plots.next_dataset(by)

    def action_next_model(self) -> None:
        """The next model."""
        self.plots.next_model()

    def action_next_target(self) -> None:
        """The next retro-reflector."""
        self.plots.next_target()

    def action_feature(self) -> None:
        """The next feature."""
        self.plots.next_feature()

    def action_arrange(self) -> None:
        """All features of one distance, or one feature of several distances."""
        self.plots.four = not self.plots.four
        was_seen = self.query_one("#left").display
        self.give_room()
        if not was_seen and self.query_one("#left").display:
            self.query_one("#table", Lines).focus()

    def closing(self) -> None:
        """Keep where the cursor was; journals stay where there are edits."""
        self.host.state.selected |= {"axis": self.axis, "row": str(self.table.at)}
        for session in (self.table.session, *self.settings.sessions.values()):
            if session is not None:
                session.close()
