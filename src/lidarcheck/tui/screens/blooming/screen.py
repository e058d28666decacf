"""Blooming: the table of a LUT or the settings of distances, edited by keys, beside curve and profiles."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

from textual import events
from textual.binding import Binding

from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.node import Node
from lidarcheck.session.runs import Run
from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.plots.plot import PLOT_WORDS
from lidarcheck.tui.screens.blooming.edit_actions import EditActions
from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.screens.blooming.fitting import Fitting
from lidarcheck.tui.screens.blooming.hand import connect
from lidarcheck.tui.screens.blooming.panes import TILES
from lidarcheck.tui.screens.blooming.plots import DEBOUNCE_S, BloomingPlots
from lidarcheck.tui.screens.blooming.selection import Selection
from lidarcheck.tui.screens.blooming.settings import SettingsEditor
from lidarcheck.tui.screens.blooming.table import X_COLUMNS, TableEditor
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import Lines

__all__ = ["Blooming"]

_TYPED = {**{digit: digit for digit in "0123456789e"}, "full_stop": "."}


class Blooming(EditActions):
    """Two editors that share the left side, and the plots."""

    NAME = "blooming"
    OPENS: ClassVar[dict[str, str]] = {"table": "%"} | dict.fromkeys(TILES, "@")
    WORDS: ClassVar[dict[str, str]] = {
        "table": "The table: X, Y as a whole number from 1 to 1000 on the log scale (0.007 decades a step; 0 is no "
        "light), and the true Y. '*' marks rows that edits are for; without any it is the row under the cursor. '~' "
        "stands behind what is edited and not saved. Type digits to set a scaled value, with a point (0.0125) a true "
        "Y; Enter sets it; Left goes to X, which is typed alike, and Right back. i adds a row, D takes rows out. Every "
        "edit is on the disk before you see it: after a lost connection the next start offers it again. E changes to "
        "the settings of each distance for this model's variant and this table's direction, and back; they are edited "
        "by the same keys, and have their own undo and save. '<- here' stands at those that say where the target of "
        "the distance shown is.",
        "curve": "The curve of the table over X, even in its symmetric logarithm, so that near rows stand apart as "
        "far ones do: the table as it is edited (now), as the disk has it (saved), what a fit proposes (wanted), and "
        "the row of the table's cursor in reverse. " + PLOT_WORDS + " Enter goes to the row under the readout; with "
        "the mouse a point is dragged up and down.",
        "profile": "What was measured over the offset from the target, and what is expected, without noise, "
        "with the table as it is edited. It follows an edit by itself. n and p go to the next and previous distance, "
        "f to the next feature. The strip below says how far real and now are apart. " + PLOT_WORDS + " Enter names "
        "the beams. From 150 columns on up to three distances stand side by side, and < > is about the "
        "one that n and p go on from. b shows all features of one distance, and goes back.",
    }
    WORDS |= dict.fromkeys(TILES, WORDS["profile"])
    BINDINGS: ClassVar[list[Any]] = [
        *bindings("blooming"),
        *MOVES,
        *(Binding(key, f"type('{character}')", show=False) for key, character in _TYPED.items()),
        Binding("backspace", "rub_out", show=False),
        Binding("escape", "drop", show=False),
    ]

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.table, self.settings = TableEditor(self), SettingsEditor(self)
        self.editor = self.table
        self.selection = Selection(self, self.table, self.settings)
        self.plots = BloomingPlots(self, self.selection, (self.table, self.settings), self._dataset_changed)
        self.fitting = Fitting(self, self.selection, self.table, self.settings, self.edited)
        self._drawn_at = 0.0
        self._looked_back = False

    def on_mount(self) -> None:
        """One clock, which sends nothing while nothing changes: a look at the files."""
        self.set_interval(2.0, self._look_at_disk)
        for pane in (self.curve_pane(), *self.all_tiles()):
            pane.when_resized = self.plots.later
        connect(self, self.plots, self.table, self.draw)
        self._lay_out()

    def on_resize(self, _event: events.Resize) -> None:
        """What there is room for."""
        self._lay_out()

    def _lay_out(self) -> None:
        self.selection.across = self.room_across()
        self.give_room(len(self.selection.tiles()), four=self.selection.four)
        self.plots.later()

    # What is shown

    @property
    def file(self) -> EditedLut | None:
        """The LUT file that is open."""
        return self.table.file

    @property
    def axis(self) -> Axis:
        """The direction of the table."""
        return self.table.axis

    def project_changed(self) -> None:
        """Open what was open, or what an ended session left."""
        self.table.find()
        if not self._looked_back:
            self._looked_back = True
            self.settings.look_back()
            if self.settings.file is not None and self.settings.file.found:
                self.editor = self.settings
        self._look_for_datasets()

    def opened(self) -> None:
        """The screen is seen: profiles are read now and not before."""
        self.selection.opened = True
        self._look_for_datasets()

    def _look_for_datasets(self) -> None:
        self.selection.find()
        self._lay_out()
        self.draw()

    def unsaved(self) -> int:
        """Rows and values that are edited and not saved."""
        return self.table.unsaved() + self.settings.all_unsaved()

    def editors(self) -> tuple[Editor[Any], ...]:
        """Of tables and of settings."""
        return self.table, self.settings

    def draw(self) -> None:
        """The left side; the plots follow when the hand rests."""
        self.draw_left()
        self.plots.later()

    def inputs_changed(self) -> None:
        """Measurements or models may be others."""
        if self.is_chosen:
            self.plots.later()

    def numbers_changed(self) -> None:
        """The strips below the profiles are made of them."""
        if self.is_chosen:
            self.plots.numbers_changed()

    def node(self) -> Node | None:
        """Of the plots what the profile is computed by; the table is not computed."""
        focused = self.app.focused
        return None if focused is None or focused.id == "table" else self.plots.node()

    def choice_changed(self) -> None:
        """Another screen has chosen."""
        if self.is_mounted and self.selection.follow() and self.is_chosen:
            self.plots.update()

    def _dataset_changed(self) -> None:
        """What the settings say of the dataset shown may be another."""
        if self.editor is self.settings:
            self.draw_left()

    def edited(self) -> None:
        """An edit: the curve follows at once, unless keys come faster than it can be sent."""
        self.draw()
        now = time.monotonic()
        if now - self._drawn_at > DEBOUNCE_S:
            self.plots.redraw_curve()
        self._drawn_at = now
        if not self.query_one("#left").display and self.editor is self.table and self.file is not None:
            self.say(self.table.under_cursor())

    # What the editors ask for

    def ask(self, question: Ask, then: Callable[[str | None], None] | None = None) -> None:
        """Ask the user."""
        self.host.ask(question, then)

    def setting(self) -> Setting | None:
        """The setting that says where the target of the dataset shown is."""
        return self.plots.setting()

    def setting_in_words(self) -> str:
        """What settings have to do with the dataset shown."""
        return self.plots.setting_in_words()

    # Files on the disk, and the other editor

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
        words = self.editor.file.read_only if self.editor.file is not None else ""
        if words:
            self.say(words, bad=True)
        elif self.editor.file is not None:
            self.say(self.host.inside(str(self.editor.file.path)))
        if not self.query_one("#left").display:
            self.action_arrange()
        self.query_one("#table", Lines).focus()
        self.draw()

    def action_add_row(self) -> None:
        """A row of the table, or settings of one more distance."""
        if self.editor is not self.settings:
            super().action_add_row()
        else:
            guess = self.plots.distance_in_words()
            self.host.ask(AskText("Settings for which distance [m]?", guess), self.settings.add)

    # The fit

    def action_fit(self) -> None:
        """The form of the fit."""
        self.fitting.form()

    def offer(self, run: Run, taken: Callable[[], object]) -> None:
        """A fit has ended: show what it wants."""
        self.fitting.offer(run, taken)

    def action_stop(self) -> None:
        """Stop the command that runs."""
        self.stop_command()

    # Other tables, files and datasets

    def clicked(self, pane: Lines, column: int) -> None:
        """X or Y of the row."""
        if pane.id == "table" and self.editor is self.table:
            self.action_cell("x" if column < X_COLUMNS else "y")

    def openings(self) -> list[Opening]:
        """LUT files, their settings, the tables of the one that is open, the model's retro-reflectors."""
        project = self.host.project
        found = [Opening("lut", one.name, "", partial(self._open, one.name)) for one in project.of("lut")]
        found += [Opening("settings", one.name, "", self._open_settings) for one in project.of("settings")]
        tables = () if self.file is None else self.file.current.tables
        found += [Opening("table", f"{axis} table", "", partial(self._show_axis, axis)) for axis in tables]
        for material in self.selection.retros():
            found.append(Opening("target", f"material {material}", "retro", partial(self.selection.aim, material)))
        return found

    def _open(self, name: str) -> None:
        self.host.show_screen(self.NAME)
        self.editor = self.table
        self.table.go_to(name)
        self._look_for_datasets()

    def _open_settings(self) -> None:
        self.host.show_screen(self.NAME)
        if self.editor is not self.settings:
            self.action_settings()

    def _show_axis(self, axis: Axis) -> None:
        self.host.show_screen(self.NAME)
        if self.axis != axis:
            self.action_next_table()

    def action_next_table(self) -> None:
        """The other table of the file."""
        if self.file is None or len(self.file.current.tables) < 2:
            self.say("the file has one table")
            return
        self.table.axis = "horizontal" if self.axis == "vertical" else "vertical"
        self.table.at, self.table.marked, self.table.typed = 0, set(), ""
        self.host.choice.choose("axis", self.axis)
        self._look_for_datasets()

    def action_next_file(self) -> None:
        """The next LUT file; edits of this one stay in its journal until they are saved."""
        if self.table.next_file():
            self._look_for_datasets()

    def action_next_dataset(self, by: int) -> None:
        """The next distance."""
        if self.selection.next_dataset(by):
            self.plots.update()

    def action_next_model(self) -> None:
        """The next model."""
        if self.selection.next_model():
            self.plots.update()

    def action_next_target(self) -> None:
        """The next retro-reflector."""
        if self.selection.next_target():
            self.plots.update()

    def action_feature(self) -> None:
        """The next feature."""
        if self.selection.next_feature():
            self.plots.redraw()

    def action_arrange(self) -> None:
        """All features of one distance, or one feature of several distances."""
        self.selection.four = not self.selection.four
        was_seen = self.query_one("#left").display
        self._lay_out()
        if not was_seen and self.query_one("#left").display:
            self.query_one("#table", Lines).focus()

    def closing(self) -> None:
        """Keep where the cursor was; journals stay where there are edits."""
        self.host.state.selected["row"] = str(self.table.at)
        for file in (self.table.file, *self.settings.files.values()):
            if file is not None:
                self.host.session.drop(file)
                file.close()
