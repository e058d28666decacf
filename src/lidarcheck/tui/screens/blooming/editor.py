"""What the left side of Blooming does with a file: edits, differences, saving, changes on the disk, earlier edits."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.file_session import ChangedOnDisk, FileSession
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.tui.screens.blooming.screen import Blooming

__all__ = ["Editor"]

S = TypeVar("S", bound=FileSession[Any])


class Editor(Generic[S]):
    """Rows of one open file, a cursor, marks and what is being typed. `TYPED`: what to type, for who did not."""

    TYPED = ""

    def __init__(self, view: Blooming) -> None:
        self.view = view
        self.session: S | None = None
        self.at = 0
        self.marked: set[int] = set()
        self.typed = ""
        self.asking = False

    # What a kind of file says of itself

    def lines(self) -> tuple[str, list[Line], bool]:
        """Title, lines, and whether the cursor is in them; the first lines are the rows."""
        raise NotImplementedError

    def count(self) -> int:
        """How many rows there are."""
        raise NotImplementedError

    def diff_lines(self) -> list[Line]:
        """What saving would change, a line each, under a head."""
        raise NotImplementedError

    def enter(self, typed: str) -> None:
        """Set the rows."""
        raise NotImplementedError

    def nudge(self, steps: int) -> None:
        """Move the rows."""
        raise NotImplementedError

    def smooth(self) -> None:
        """Smooth the rows."""
        raise NotImplementedError

    def read_again(self) -> None:
        """The file was read anew."""

    # Rows

    def rows(self) -> list[int]:
        """The rows that an edit is for."""
        return sorted(self.marked) or [self.at]

    def within(self) -> None:
        """Keep cursor and marks in what is there."""
        self.at = max(min(self.at, self.count() - 1), 0)
        self.marked &= set(range(self.count()))

    def unsaved(self) -> int:
        """Rows that are edited and not saved."""
        return len(self.session.diff()) if self.session and self.session.dirty else 0

    # Edits

    def edit(self, make: Callable[[S], bool | str]) -> None:
        """Do an edit; whatever speaks against it is one line."""
        if self.session is None:
            self.view.say("there is no file to edit here")
            return
        if self.session.found:
            self.ask_back()
            return
        try:
            what = make(self.session)
        except LidarcheckError as error:
            self.view.say(error)
            return
        if what is False or what == "":
            self.view.say("nothing to take back" if what == "" else "no row changes")
        elif isinstance(what, str):
            self.view.say(what)
        self.view.edited()

    def undo(self) -> None:
        """Take back."""
        self.edit(lambda session: f"taken back: {what}" if (what := session.undo()) else "")

    def redo(self) -> None:
        """Make again."""
        self.edit(lambda session: f"made again: {what}" if (what := session.redo()) else "")

    # The file

    def diff(self) -> None:
        """What saving would change."""
        if self.session is not None and self.session.dirty:
            title = f"Not saved: {counted(self.unsaved(), self.session.NOUN)}"
            self.view.app.push_screen(Ask(title, self.diff_lines(), {}))
        else:
            self.view.say("nothing is edited")

    def save(self) -> None:
        """Show what changes, then save."""
        if self.session is None or not self.session.dirty:
            self.view.say("nothing is edited")
            return
        if self.session.changed_on_disk():
            self._ask_disk(self.session)
            return
        title = f"Save {counted(self.unsaved(), self.session.NOUN)} to {self.session.path.name}?"
        ask = Ask(title, self.diff_lines(), {"Enter": "save"})
        self.view.app.push_screen(ask, lambda key: self._save(key == "Enter"))

    def _save(self, agreed: bool, *, overwrite: bool = False) -> None:
        if not agreed or self.session is None:
            return
        try:
            number = self.session.save(overwrite=overwrite)
        except ChangedOnDisk:
            self._ask_disk(self.session)
            return
        except LidarcheckError as error:
            self.view.say(error)
            return
        self.view.say(f"{self.session.path.name}: saved, {counted(number, self.session.NOUN)}")
        self.view.edited()

    def look_at_disk(self) -> None:
        """Ask, if somebody else has changed the file."""
        if self.session is not None and not self.asking and self.session.changed_on_disk():
            self._ask_disk(self.session)

    def _ask_disk(self, session: S) -> None:
        """The file is not what it was."""
        if not session.dirty and session.path.exists():
            answers = {"r": "read it again", "k": "keep what is shown"}
        else:
            answers = {"r": "read it again, edits are lost", "o": "overwrite it", "k": "keep editing"}
        there = session.path.exists()
        words = line("Somebody else has changed it since it was read here." if there else "It is gone.")
        self.asking = True
        ask = Ask(f"{session.path.name} has changed on the disk", [words, *self.diff_lines()], answers, unasked=True)
        self.view.app.push_screen(ask, lambda key: self._answer_disk(session, key))

    def _answer_disk(self, session: S, key: str | None) -> None:
        self.asking = False
        if session is not self.session:
            return
        if key == "r":
            self._reload()
        elif key == "o":
            self._save(True, overwrite=True)
        else:
            session.accept_disk()
            self.view.say(f"{session.path.name}: kept as it is shown; saving overwrites what is on the disk")

    def _reload(self) -> None:
        assert self.session is not None
        try:
            self.session.claim_again() if self.session.read_only else self.session.reload()
        except LidarcheckError as error:
            self.session.accept_disk()
            self.view.say(error)
            return
        words = self.session.read_only
        self.view.say(words or f"{self.session.path.name}: read again", bad=bool(words))
        self.read_again()
        self.view.edited()

    def reload(self) -> None:
        """Read it again; edits are asked about."""
        if self.session is None:
            return
        if not self.session.dirty:
            self._reload()
            return
        title = f"{counted(self.unsaved(), self.session.NOUN)} not saved"
        ask = Ask(title, self.diff_lines(), {"r": "read again, they are lost"})
        self.view.app.push_screen(ask, lambda key: self._reload() if key == "r" else None)

    # Edits of a session that was not ended

    def ask_back(self) -> None:
        """Whether to bring them back."""
        assert self.session is not None
        session = self.session
        answers = {"b": "bring them back", "l": "leave them"}
        ask = Ask(session.found_in_words(), [], answers)
        self.view.app.push_screen(ask, lambda key: self._answer_back(session, key))

    def _answer_back(self, session: S, key: str | None) -> None:
        try:
            if key == "b":
                session.bring_back()
                self.view.say(f"{counted(len(session.diff()), session.NOUN)} brought back, not saved yet")
            elif key == "l":
                session.forget()
                self.view.say("the edits are left; their journal is kept in .lidarcheck/tui")
        except LidarcheckError as error:
            self.view.say(error)
        self.view.edited()
