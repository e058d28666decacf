"""What every screen is: panes of lines, keys from the table of actions, help for the pane that has the focus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, cast

from textual._arrange import arrange
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.geometry import Size
from textual.layout import DockArrangeResult

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.node import Node
from lidarcheck.tui.actions import ACTIONS
from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.host import Host
from lidarcheck.tui.widgets.lines import CURSOR_KEYS, Line, Lines

if TYPE_CHECKING:
    from lidarcheck.tui.screens.blooming.editor import Editor

__all__ = ["MOVES", "View", "bindings"]

_ALSO = {"up": "up,k", "down": "down,j"}
MOVES: list[BindingType] = [Binding(_ALSO.get(key, key), f"move('{key}')", show=False) for key in CURSOR_KEYS]
"""The keys of a screen with a cursor, whose `action_move` gets the key."""


def bindings(screen: str) -> list[BindingType]:
    """The keys of a screen's actions; of what is everywhere for an empty name."""
    return [
        Binding(key, action.method, action.short or action.name, show=False)
        for action in ACTIONS
        if action.screen == screen and action.method
        for key in action.keys
    ]


class View(Vertical):
    """A screen of the interface. `NAME`: as in `actions.SCREENS`; `WORDS`: a pane's id to what F1 says of it."""

    NAME = ""
    WORDS: ClassVar[dict[str, str]] = {}
    # Textual's screen would take Tab before the app gets it, and go by the order in which panes were made.
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "app.next_pane(1)", show=False),
        Binding("shift+tab", "app.next_pane(-1)", show=False),
    ]

    zoomed: Lines | None = None
    """The pane that has the whole screen; None where all have their room."""

    OPENS: ClassVar[dict[str, str]] = {}
    """A pane's id to the kind that the chooser begins with, as in `chooser.PREFIXES`."""

    @property
    def host(self) -> Host:
        """The app."""
        return cast("Host", self.app)

    @property
    def is_chosen(self) -> bool:
        """Whether this screen is the one that is seen, also before it is laid out and while a question is asked."""
        return bool(self.is_mounted and self.display)

    def zoom(self, pane: Lines | None) -> None:
        """Give one pane the whole screen, or all of them their room again."""
        if self.zoomed is not None:
            self.zoomed.remove_class("zoomed")
        self.zoomed = pane
        if pane is not None:
            pane.add_class("zoomed")
        self.refresh(layout=True)

    def arrange(self, size: Size, optimal: bool = False) -> DockArrangeResult:
        """The panes in their room; or one of them alone, whatever it is in."""
        if self.zoomed is None or not self.zoomed.display:
            return super().arrange(size, optimal)
        return arrange(self, [self.zoomed], size, self.screen.size, optimal)

    def panes(self) -> list[Lines]:
        """The panes that can have the focus, in order."""
        return [pane for pane in self.query(Lines) if pane.can_focus]

    def reveal(self, _pane: Lines) -> None:
        """A pane is gone to that may not be seen now."""

    def opened(self) -> None:
        """The screen is seen now."""

    def project_changed(self) -> None:
        """The project was read."""

    def choice_changed(self) -> None:
        """What is looked at was chosen, here or on another screen."""

    def inputs_changed(self) -> None:
        """A file was edited, saved or changed on the disk, or something was computed."""

    def numbers_changed(self) -> None:
        """A number of a measurement, or what is known of it, is another."""

    def context_line(self, _width: int) -> Line | None:
        """What the second line says on this screen; None for what it says of the measurement that is looked at."""
        return None

    def clicked(self, pane: Lines, column: int) -> None:
        """A pane was clicked in one of its columns; its row has the cursor already."""

    def openings(self) -> list[Opening]:
        """What the chooser offers of this screen, besides the project's files; also while another one is seen."""
        return []

    def closing(self) -> None:
        """The app ends."""

    def node(self) -> Node | None:
        """What the pane that has the focus is computed by; None where that is nothing of its own."""
        return None

    def write_own(self) -> bool:
        """Write what is seen in a form of its own; False where the text of its panes is all there is."""
        return False

    def unsaved(self) -> int:
        """How many rows are edited and not saved."""
        return 0

    def editors(self) -> Sequence[Editor[Any]]:
        """What has files of this screen open."""
        return ()

    def edited(self) -> None:
        """A file was edited or saved while this screen is seen: show it at once."""

    def waited_for(self) -> str:
        """What the end of the process waits for; empty for nothing."""
        return ""

    def cursor_again(self, names: Sequence[str], at: int) -> int:
        """Where the cursor is in a list that was made anew: on the name that was selected last, else about at `at`."""
        wanted = self.host.state.selected.get(self.NAME, "")
        return names.index(wanted) if wanted in names else min(at, max(len(names) - 1, 0))

    def action_distance(self, by: int) -> None:
        """The next distance of what is looked at."""
        self.host.numbers.go(by)

    def stop_command(self) -> None:
        """Stop the command that was started from the interface, where one runs."""
        runs = self.host.commands.runs
        if runs.running:
            runs.stop()
        else:
            self.say("nothing runs")

    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """Something for the status line and the log."""
        self.host.say(text, bad=bad)

    def progress(self, text: str) -> None:
        """What a run of this screen says while it runs; empty when it has ended."""
        self.host.progress(text, self.NAME)
