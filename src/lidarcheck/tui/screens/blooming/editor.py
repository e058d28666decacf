"""What the left side of Blooming does with a file: edits, changes on the disk, edits of an earlier session."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.edited_file import EditedFile
from lidarcheck.tui.host import Host
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.formats.settings import Setting

__all__ = ["Editing", "Editor", "saved_words"]

S = TypeVar("S", bound=EditedFile[Any])


class Editing(Protocol):
    """What an editor may ask of the screen that it stands on."""

    NAME: str

    @property
    def host(self) -> Host:
        """The app."""

    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """Something for the status line and the log."""

    def ask(self, question: Ask, then: Callable[[str | None], None] | None = None) -> None:
        """Ask the user; `then` gets the key of the answer, None without one."""

    def edited(self) -> None:
        """Something was edited, saved or read again: show it."""

    def setting(self) -> Setting | None:
        """The setting that says where the target of the dataset shown is; None where none does."""

    def setting_in_words(self) -> str:
        """What settings have to do with the dataset shown."""


class Editor(Generic[S]):
    """Rows of one open file, a cursor, marks and what is being typed. `TYPED`: what to type, for who did not. `on_x`:
    what is typed is the row's X.
    """

    TYPED = ""

    def __init__(self, view: Editing) -> None:
        self.view = view
        self.file: S | None = None
        self.at = 0
        self.marked: set[int] = set()
        self.typed = ""
        self.on_x = False
        self.asking = False

    # What a kind of file says of itself

    def lines(self) -> tuple[str, list[Line], bool]:
        """Title, lines, and whether the cursor is in them; the first lines are the rows."""
        raise NotImplementedError

    def count(self) -> int:
        """How many rows there are."""
        raise NotImplementedError

    def all_files(self) -> list[S]:
        """The files that it keeps open, also those that are not shown."""
        return [] if self.file is None else [self.file]

    def diff_lines(self, file: S) -> list[Line]:
        """What saving one of them would change, a line each, under a head."""
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

    def choose_cell(self, x: bool) -> None:
        """X or Y of the row; only a table has both."""

    def add_row(self) -> None:
        """A row more, where that needs no question."""

    def remove_rows(self) -> None:
        """Rows less."""

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
        return len(self.file.diff()) if self.file and self.file.dirty else 0

    # Edits

    def edit(self, make: Callable[[S], bool]) -> None:
        """Do an edit; whatever speaks against it is one line."""
        if self.file is None:
            self.view.say("there is no file to edit here")
            return
        if self.file.found:
            self.ask_back()
            return
        try:
            changed = make(self.file)
        except LidarcheckError as error:
            self.view.say(error)
            return
        if not changed:
            self.view.say("no row changes")
        self.view.edited()

    # The file

    def look_at_disk(self) -> None:
        """Ask, if somebody else has changed the file."""
        if self.file is not None and not self.asking and self.file.changed_on_disk():
            self.ask_disk(self.file)

    def ask_disk(self, file: S) -> None:
        """The file is not what it was: what is to become of it."""
        found = file.on_disk()
        if not file.dirty and found == "changed":
            answers = {"r": "read it again", "k": "keep what is shown"}
        else:
            answers = {"r": "read it again, edits are lost", "o": "overwrite it", "k": "keep editing"}
        words = line("Somebody else has changed it since it was read here." if found == "changed" else f"It {found}.")
        self.asking = True
        ask = Ask(f"{file.path.name} has changed on the disk", [words, *self.diff_lines(file)], answers, unasked=True)
        self.view.ask(ask, lambda key: self._answer_disk(file, key))

    def _answer_disk(self, file: S, key: str | None) -> None:
        self.asking = False
        if file not in self.all_files():
            return
        if key == "r":
            self._reload(file)
        elif key == "o":
            self._overwrite(file)
        else:
            self._keep_shown(file)

    def _overwrite(self, file: S) -> None:
        try:
            number = file.save(overwrite=True)
        except LidarcheckError as error:
            self.view.say(error)
            return
        self.view.say(saved_words(file, number))
        self.view.edited()

    def _keep_shown(self, file: S) -> None:
        try:
            file.accept_disk()
        except LidarcheckError as error:
            self.view.say(error)
            return
        words = "it is older than the disk's" if file.behind else "^S shows how the file differs, and saves it"
        self.view.say(f"{file.path.name}: kept as it is shown; {words}")
        self.view.edited()

    def _reload(self, file: S) -> None:
        try:
            file.claim_again() if file.read_only else file.reload()
        except LidarcheckError as error:
            self._keep_shown(file)
            self.view.say(error)
            return
        words = file.read_only
        self.view.say(words or f"{file.path.name}: read again", bad=bool(words))
        self.read_again()
        self.view.edited()

    def reload(self) -> None:
        """Read it again; edits are asked about."""
        if self.file is None:
            return
        file = self.file
        if not file.dirty:
            self._reload(file)
            return
        title = f"{counted(self.unsaved(), file.NOUN)} not saved"
        ask = Ask(title, self.diff_lines(file), {"r": "read again, they are lost"})
        self.view.ask(ask, lambda key: self._reload(file) if key == "r" else None)

    # Edits of a session that was not ended

    def ask_back(self) -> None:
        """Whether to bring them back."""
        assert self.file is not None
        file = self.file
        answers = {"b": "bring them back", "l": "leave them"}
        ask = Ask(file.found_in_words(), [], answers)
        self.view.ask(ask, lambda key: self._answer_back(file, key))

    def _answer_back(self, file: S, key: str | None) -> None:
        try:
            if key == "b":
                file.bring_back()
                self.view.say(f"{counted(len(file.diff()), file.NOUN)} brought back, not saved yet")
            elif key == "l":
                file.forget()
                self.view.say("the edits are left; their journal is kept in .lidarcheck/tui")
        except LidarcheckError as error:
            self.view.say(error)
        self.view.edited()


def saved_words(file: EditedFile[Any], number: int) -> str:
    """That a file was saved, and how much of it changed."""
    return f"{file.path.name}: saved, {counted(number, file.NOUN)}"
