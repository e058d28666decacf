"""What Blooming does with its file: differences, saving, changes on the disk, edits of an earlier session."""

from __future__ import annotations

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.table import counted
from lidarcheck.tui.core.lut_session import ChangedOnDisk, LutSession
from lidarcheck.tui.screens.base import View
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

__all__ = ["LutFileView"]


class LutFileView(View):
    """A screen with one LUT file open; `draw` shows it."""

    session: LutSession | None = None
    axis: Axis = "vertical"
    _asking = False

    def draw(self) -> None:
        """Show the file as it is now."""
        raise NotImplementedError

    def _diff_lines(self) -> list[Line]:
        assert self.session is not None
        head = f"{'table':11}{'row':>4}{'X':>9}{'scaled':>8}{'new':>6}{'Y':>13}{'new':>13}"
        lines = [line(head, "title")]
        for c in self.session.diff():
            old, new = c.scaled
            lines.append(line(f"{c.table:11}{c.row:>4}{c.x:>9g}{old:>8}{new:>6}{c.before:>13.7g}{c.after:>13.7g}"))
        return lines

    def action_diff(self) -> None:
        """What saving would change."""
        if self.session is not None and self.session.dirty:
            self.app.push_screen(Ask(f"Not saved: {counted(self.unsaved(), 'row')}", self._diff_lines(), {}))
        else:
            self.say("nothing is edited")

    def action_save(self) -> None:
        """Show what changes, then save."""
        if self.session is None or not self.session.dirty:
            self.say("nothing is edited")
            return
        if self.session.changed_on_disk():
            self._ask_disk()
            return
        title = f"Save {counted(self.unsaved(), 'row')} to {self.session.path.name}?"
        self.app.push_screen(Ask(title, self._diff_lines(), {"Enter": "save"}), lambda key: self._save(key == "Enter"))

    def _save(self, agreed: bool, *, overwrite: bool = False) -> None:
        if not agreed or self.session is None:
            return
        try:
            number = self.session.save(overwrite=overwrite)
        except ChangedOnDisk:
            self._ask_disk()
            return
        except LidarcheckError as error:
            self.say(error)
            return
        self.say(f"{self.session.path.name}: saved, {counted(number, 'row')}")
        self.draw()

    def _look_at_disk(self) -> None:
        if self.session is not None and not self._asking and self.is_on_screen and self.session.changed_on_disk():
            self._ask_disk()

    def _ask_disk(self) -> None:
        """The file is not what it was."""
        assert self.session is not None
        name, dirty = self.session.path.name, self.session.dirty
        if not dirty and self.session.path.exists():
            answers = {"r": "read it again", "k": "keep what is shown"}
        else:
            answers = {"r": "read it again, edits are lost", "o": "overwrite it", "k": "keep editing"}
        words = [
            line(
                "Somebody else has changed it since it was read here." if self.session.path.exists() else "It is gone."
            )
        ]
        self._asking = True
        self.app.push_screen(
            Ask(f"{name} has changed on the disk", [*words, *self._diff_lines()], answers), self._answer_disk
        )

    def _answer_disk(self, key: str | None) -> None:
        self._asking = False
        assert self.session is not None
        if key == "r":
            self._reload()
        elif key == "o":
            self._save(True, overwrite=True)
        else:
            self.session.accept_disk()
            self.say(f"{self.session.path.name}: kept as it is shown; saving overwrites what is on the disk")

    def _reload(self) -> None:
        assert self.session is not None
        try:
            self.session.claim_again() if self.session.read_only else self.session.reload()
        except LidarcheckError as error:
            self.session.accept_disk()
            self.say(error)
            return
        self.say(self.session.read_only or f"{self.session.path.name}: read again", bad=bool(self.session.read_only))
        if self.axis not in self.session.current.tables:
            self.axis = next(iter(self.session.current.tables))
        self.draw()

    def action_reload(self) -> None:
        """Read it again; edits are asked about."""
        if self.session is None:
            return
        if not self.session.dirty:
            self._reload()
            return
        ask = Ask(f"{counted(self.unsaved(), 'row')} not saved", self._diff_lines(), {"r": "read again, they are lost"})
        self.app.push_screen(ask, lambda key: self._reload() if key == "r" else None)

    def _ask_back(self) -> None:
        """Edits of a session that was not ended."""
        assert self.session is not None
        answers = {"b": "bring them back", "l": "leave them"}
        self.app.push_screen(Ask(self.session.found_in_words(), [], answers), self._answer_back)

    def _answer_back(self, key: str | None) -> None:
        assert self.session is not None
        try:
            if key == "b":
                self.session.bring_back()
                self.say(f"{counted(self.unsaved(), 'row')} brought back, not saved yet")
            elif key == "l":
                self.session.forget()
                self.say("the edits are left; their journal is kept in .lidarcheck/tui")
        except LidarcheckError as error:
            self.say(error)
        self.draw()
