"""The actions that are the same on every screen: help, palette, going about, log, theme, a pane's text."""

from __future__ import annotations

import inspect
import os
from abc import abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from textual import events

from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.session.choice import Choice
from lidarcheck.session.project import Project
from lidarcheck.session.session import Session
from lidarcheck.session.state import State
from lidarcheck.tui.actions import SCREENS, Action, actions_of
from lidarcheck.tui.bars import Bars
from lidarcheck.tui.chooser import Chooser, Opening
from lidarcheck.tui.edits import Edits
from lidarcheck.tui.help import help_lines
from lidarcheck.tui.mouse import Mouse
from lidarcheck.tui.numbers import Numbers
from lidarcheck.tui.openings import openings
from lidarcheck.tui.palette import Jump, Menu, Palette
from lidarcheck.tui.plots.marks import MARKS, Level, level_of
from lidarcheck.tui.plots.pane import PlotPane
from lidarcheck.tui.runs.starting import Commands
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import Line, Lines, line
from lidarcheck.tui.widgets.overlay import Dialog, Overlay
from lidarcheck.tui.widgets.themes import THEMES

__all__ = ["Everywhere"]

T = TypeVar("T")
_RECENT, _MOST_RECENT = "opened", 20
"""What was opened last, in the state."""


class Everywhere(Mouse):
    """An app with screens of panes, bars and a log."""

    project: Project
    session: Session
    state: State
    choice: Choice
    bars: Bars
    marks: Level
    overlay: Overlay
    numbers: Numbers
    commands: Commands
    edits: Edits

    @abstractmethod
    def views(self) -> Sequence[View]:
        """All screens."""

    @property
    @abstractmethod
    def view(self) -> View:
        """The screen that is seen."""

    @abstractmethod
    def show_screen(self, name: str) -> None:
        """Go to a screen, as soon as it is there."""

    @abstractmethod
    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """One line for the user, which the log keeps."""

    # Dialogs

    @property
    def asking(self) -> Dialog[Any] | None:
        """The dialog that is seen; None for none."""
        return self.overlay.dialog

    def ask(self, dialog: Dialog[T], then: Callable[[T | None], object] | None = None) -> None:
        """Show a dialog over the screen; `then` gets its answer, None where it was left."""

        def answered(value: T | None) -> None:
            done = None if then is None else then(value)
            if inspect.isawaitable(done):
                self.call_next(lambda: done)

        self.overlay.ask(dialog, answered)

    def on_key(self, event: events.Key) -> None:
        """A dialog takes every key. No other widget does: what is typed ahead arrives here in its order."""
        if self.overlay.take(event):
            event.stop()
            event.prevent_default()

    def on_paste(self, event: events.Paste) -> None:
        """Into the line to type in; nowhere else."""
        if self.overlay.paste(event.text):
            event.stop()

    def _anchor(self) -> int | None:
        """The row of the screen that a dialog does not hide: that of the cursor."""
        pane = self.focused
        return pane.cursor_y if isinstance(pane, Lines) else None

    def files_changed(self) -> None:
        """Have every screen look at the project again."""
        for view in self.views():
            view.project_changed()

    def action_show(self, name: str) -> None:
        """A screen."""
        self.show_screen(name)

    def action_help(self) -> None:
        """Help for what has the focus, and every key."""
        pane = self.focused.id if self.focused else ""
        words = self.view.WORDS.get(pane or "", "") or next(iter(self.view.WORDS.values()), "")
        kind = self.focused.KIND if isinstance(self.focused, Lines) else ""
        lines = help_lines(words, self.view.NAME, min(self.size.width, Ask.widest) - 8, kind)
        self.ask(Ask(f"Help: {SCREENS[self.view.NAME].title}, {pane}", lines, {}))

    def able(self) -> list[Action]:
        """What can be done here: with the pane that has the focus, on the screen, everywhere."""
        return actions_of(self.view.NAME, pane=self.focused.KIND if isinstance(self.focused, Lines) else "")

    def action_palette(self) -> None:
        """Any action by its name."""
        self.ask(Palette(self.able()), self.do)

    def action_open(self) -> None:
        """Anything that can be opened; first of the kind that the focused pane shows."""
        pane = self.focused.id if self.focused else None
        self.open_with(self.view.OPENS.get(pane or "", ""))

    def open_with(self, typed: str) -> None:
        """The chooser, with what is typed in it."""
        recent = self.state.selected.get(_RECENT, "").split("\n")
        self.ask(Chooser(openings(self), recent, typed), self._opened)

    def _opened(self, one: Opening | None) -> object:
        if one is None:
            return None
        kept = [key for key in self.state.selected.get(_RECENT, "").split("\n") if key and key != one.key]
        self.state.selected[_RECENT] = "\n".join([one.key, *kept][:_MOST_RECENT])
        return one.do()

    def action_menu(self) -> None:
        """What can be done here, with its keys."""
        self.show_menu(Menu(f"Menu: {SCREENS[self.view.NAME].title}", self.able()))

    def show_menu(self, menu: Menu) -> None:
        """What can be done here."""
        self.ask(menu, self.do)

    async def do(self, action: Action | None) -> None:
        """An action, as its key would do it."""
        if action is not None:
            own = self.focused if action.pane else self.view if action.screen else self
            await self.run_action(action.method, own)

    def action_form(self, name: str) -> None:
        """The form of a command."""
        self.commands.open(name, self.view.NAME)

    def action_runs(self) -> None:
        """The commands that were started."""
        self.commands.list()

    def action_stop_command(self) -> None:
        """Stop the one that runs."""
        self.commands.runs.stop()

    def action_jump(self) -> None:
        """By label: screens in capitals, panes in small letters."""
        self._show_labels(True)
        self.ask(Jump(), self._jumped)

    def _show_labels(self, are_shown: bool) -> None:
        self.bars.show_labels(are_shown)
        for pane in [*self.view.panes(), self.bars.log]:
            pane.show_label(are_shown)

    def _jumped(self, key: str | None) -> None:
        self._show_labels(False)
        screen = next((name for name, place in SCREENS.items() if key == place.label), "")
        if screen:
            self.show_screen(screen)
            return
        if key == "l" and not self.bars.log.has_class("shown"):
            self.action_log()
        for pane in [*self.view.panes(), self.bars.log]:
            if key == pane.label:
                self.view.reveal(pane)
                self.call_after_refresh(pane.focus)

    def action_undo(self) -> None:
        """Take the last edit back, whichever file it was of."""
        self.edits.undo()

    def action_redo(self) -> None:
        """Make it again."""
        self.edits.redo()

    def action_save(self) -> None:
        """Show what changes, then save."""
        self.edits.save()

    def action_difference(self) -> None:
        """What saving would change."""
        self.edits.difference()

    def action_baseline(self) -> None:
        """Numbers are compared with what is set now."""
        on = self.numbers.engine.set_baseline()
        self.say("baseline: numbers are compared with what is set now" if on else "no baseline: with the last step")

    def action_show_baseline(self) -> None:
        """The baseline in the place of what is set now, everywhere; or what is set now again."""
        session = self.session
        if session.baseline() is None:
            self.say("there is no baseline: B makes one of what is set now")
            return
        session.show_baseline(not session.shows_baseline)
        self.say(
            "the baseline is shown; ' or an edit goes back" if session.shows_baseline else "what is set now is shown"
        )
        self.view.edited()

    def action_inputs(self) -> None:
        """What the pane, and the number in the second line, are computed from."""
        pane = self.focused.id if self.focused else ""
        lines: list[Line] = []
        for title, node in (
            (f"{SCREENS[self.view.NAME].title}, {pane}", self.view.node()),
            ("number", self.numbers.node()),
        ):
            if node is not None:
                words = self.session.describe(node)
                words += [] if node.command else [f"command  lidarcheck {SCREENS[self.view.NAME].twin}: F1 says how"]
                lines += [line(title, "title"), *(line(f" {self.project.inside(word)}") for word in words)]
        if lines:
            self.ask(Ask("Inputs", lines, {}))
        else:
            self.say("nothing here is computed")

    def action_next_pane(self, by: int) -> None:
        """The focus goes round."""
        log = self.bars.log
        panes = [pane for pane in [*self.view.panes(), log] if pane.display]  # sizes come a moment after a screen
        if panes:
            at = panes.index(self.focused) if self.focused in panes else -by
            # At once, as with a screen: keys that came in one go with this one are for the new pane.
            self.screen.set_focus(panes[(at + by) % len(panes)])

    def action_zoom_pane(self) -> None:
        """The focused pane on the whole screen, or all panes again."""
        view, pane = self.view, self.focused
        if view.zoomed is not None:
            view.zoom(None)
        elif isinstance(pane, Lines) and pane in view.panes():
            view.zoom(pane)

    def action_log(self) -> None:
        """Show or hide the log."""
        pane = self.bars.log
        self.state.log = not self.state.log
        pane.set_class(self.state.log, "shown")
        self.bars.show_log()
        if not self.state.log and self.focused is pane:
            self.view.panes()[0].focus()

    def action_theme(self) -> None:
        """The next theme."""
        self.theme = THEMES[(THEMES.index(self.theme) + 1) % len(THEMES)]
        self.state.theme = self.theme
        self.say(f"theme: {self.theme}")
        self.files_changed()

    def action_marks(self) -> None:
        """The next marks of plots, as far as the terminal shows them."""
        now = self.state.marks if self.state.marks in MARKS else MARKS[0]
        self.state.marks = wanted = MARKS[(MARKS.index(now) + 1) % len(MARKS)]
        self.marks = level_of(wanted, os.environ)
        for plot in self.query(PlotPane):
            plot.draw_now()
        self.say(f"marks: {wanted}" if self.marks == wanted else f"marks: {wanted}; this terminal shows {self.marks}")

    def _pane(self) -> Lines:
        return self.focused if isinstance(self.focused, Lines) else self.view.panes()[0]

    def action_copy(self) -> None:
        """To the clipboard of the terminal, which may be far away."""
        text = self._pane().text
        self.copy_to_clipboard(text)
        self.say(f"{len(text.splitlines())} lines sent to the terminal's clipboard (OSC 52)")

    def action_write(self) -> None:
        """To a file, whose name is asked for."""
        if self.view.write_own():
            return
        pane = self._pane()
        ask = AskText("Write this pane to which new file?", f"{pane.id}.txt")
        self.ask(ask, lambda name: self._write(pane, name))

    def _write(self, pane: Lines, name: str | None) -> None:
        if not name:
            return
        try:
            _write_new(self.project.root / name, name, pane.text)
        except LidarcheckError as error:
            self.say(error)
            return
        self.say(f"{name}: written")


def _write_new(path: Path, name: str, text: str) -> None:
    """Write a file that is not there yet; `name`: as it was given."""
    from lidarcheck.formats.atomic import write_text

    if path.exists():
        raise UsageError(f"{name} is there already", fix="give another name")
    if not path.parent.is_dir():
        raise InputError("its directory does not exist", file=path, fix="make it first")
    write_text(path, text)
