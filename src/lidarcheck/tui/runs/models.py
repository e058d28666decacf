"""The model files that are open: changed by what is taken over, saved and taken back as tables are."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.edited_file import journal_of
from lidarcheck.session.edited_model import EditedModel, LineChange
from lidarcheck.tui.host import Host
from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.formats.settings import Setting

__all__ = ["OpenModels", "change_lines"]


def change_lines(changes: list[LineChange] | tuple[LineChange, ...]) -> list[Line]:
    """Lines of a text that differ, as they were and as they are."""
    lines = []
    for change in changes:
        for mark, text, role in (("-", change.before, "bad"), ("+", change.after, "good")):
            if text is not None:
                number = f"{change.number:>4}" if mark == "+" or change.after is None else "    "
                lines.append(line(f"{number} {mark}{text}", role))  # type: ignore[arg-type]
    return lines


class _ModelEditor(Editor[EditedModel]):
    """One model's file; its rows are lines, which are not edited one by one."""

    def diff_lines(self, file: EditedModel) -> list[Line]:
        """The lines that differ from what was saved."""
        return change_lines(file.diff())


class OpenModels:
    """A file is opened when it is changed first; it stays open until the interface ends."""

    NAME = "explain"

    def __init__(self, host: Host) -> None:
        self.host = host
        self._editors: dict[str, _ModelEditor] = {}
        self.on_edit: Callable[[], object] = lambda: None

    def open(self, path: Path) -> EditedModel:
        """The file, opened now if it was not; `InputError` or `ConfigError` where it is no sound model."""
        return self._editor(path).file  # type: ignore[return-value]

    def _editor(self, path: Path) -> _ModelEditor:
        real = os.path.realpath(path)
        if real not in self._editors:
            editor = _ModelEditor(self)
            editor.file = EditedModel(path, self.host.project.root)
            self.host.session.hold(editor.file)
            self._editors[real] = editor
        return self._editors[real]

    def editors(self) -> list[Editor[EditedModel]]:
        """One for each that is open."""
        return list(self._editors.values())

    def unsaved(self) -> int:
        """Lines that are edited and not saved."""
        return sum(editor.unsaved() for editor in self._editors.values())

    # Files on the disk, and edits of a session that was not ended

    def look_back(self) -> None:
        """Offer edits that an earlier session did not save."""
        root = self.host.project.root
        for entry in self.host.project.of("model"):
            if journal_of(entry.path, root).exists() and os.path.realpath(entry.path) not in self._editors:
                try:
                    editor = self._editor(entry.path)
                except LidarcheckError as error:
                    self.say(error)
                    continue
                if editor.file is not None and editor.file.found:
                    editor.ask_back()

    def look_at_disk(self) -> None:
        """Ask, if somebody else has changed one."""
        for editor in self._editors.values():
            editor.look_at_disk()

    def closing(self) -> None:
        """Journals stay where there are edits."""
        for editor in self._editors.values():
            if editor.file is not None:
                self.host.session.drop(editor.file)
                editor.file.close()

    # What an editor asks of its screen

    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """One line."""
        self.host.say(text, bad=bad)

    def ask(self, question: Ask, then: Callable[[str | None], None] | None = None) -> None:
        """Ask the user."""
        self.host.ask(question, then)

    def edited(self) -> None:
        """The session tells the screens."""
        self.on_edit()

    def setting(self) -> Setting | None:
        """A model has none."""
        return None

    def setting_in_words(self) -> str:
        """A model has none."""
        return ""
