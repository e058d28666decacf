"""What a screen may ask of the app that it stands in, and no more."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.choice import Choice
from lidarcheck.session.project import Project
from lidarcheck.session.session import Session
from lidarcheck.session.state import State
from lidarcheck.tui.numbers import Numbers
from lidarcheck.tui.widgets.overlay import Dialog

if TYPE_CHECKING:
    from lidarcheck.tui.edits import Edits
    from lidarcheck.tui.runs.starting import Commands

__all__ = ["STOPS", "Host"]

STOPS = "   x stops it"
"""At the end of the line that tells how far a run is."""

T = TypeVar("T")


class Host(Protocol):
    """The app, as screens know it. `project`: as it was read last; `state`: what is kept for the next start;
    `session`: what belongs to what; `choice`: what all screens look at; `numbers`: how far measurements and models are
    apart; `commands`: those that are started here; `edits`: undo, redo and save, of all files.
    """

    project: Project
    state: State
    session: Session
    choice: Choice
    numbers: Numbers
    commands: Commands
    edits: Edits

    def ask(self, dialog: Dialog[T], then: Callable[[T | None], object] | None = None) -> None:
        """Show a dialog over the screen; `then` gets its answer, None where it was left."""

    def inside(self, text: str) -> str:
        """A text without the project's own path in front of its files."""

    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """One line for the user, which the log keeps."""

    def note(self, text: str, bad: bool) -> None:
        """A line for the log alone."""

    def progress(self, text: str, screen: str) -> None:
        """What a run of a screen says while it runs; empty when it has ended."""

    def soon(self, do: Callable[..., Any], *arguments: Any) -> None:
        """Do something in the interface's own thread; from any thread, also when the interface has ended."""

    def show_screen(self, name: str) -> None:
        """Go to a screen, as soon as it is there."""

    def show_context(self) -> None:
        """Draw the second line anew: what a screen says there is another."""

    def read_project(self) -> None:
        """Look at the project's files again, beside the interface."""

    def files_changed(self) -> None:
        """Have every screen look at the project again: one of them has written files."""
