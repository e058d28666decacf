"""Undo, redo, save, and what saving would change: the same on every screen, over all files that are open."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.edited_file import ChangedOnDisk, EditedFile
from lidarcheck.tui.host import Host
from lidarcheck.tui.screens.blooming.editor import Editor, saved_words
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

__all__ = ["Edits"]

_Edited = tuple[Editor[Any], EditedFile[Any]]


class Edits:
    """`editors`: all that may have files open; `changed`: has the screen that is seen drawn anew."""

    def __init__(self, host: Host, editors: Callable[[], Sequence[Editor[Any]]], changed: Callable[[], object]) -> None:
        self._host, self._editors, self._changed = host, editors, changed

    def undo(self) -> None:
        """Take the last edit of all back, and name its file."""
        self._step("undo", "taken back")

    def redo(self) -> None:
        """Make it again."""
        self._step("redo", "made again")

    def _step(self, verb: str, words: str) -> None:
        session = self._host.session
        try:
            made = session.undo() if verb == "undo" else session.redo()
        except LidarcheckError as error:
            self._host.say(error)
            return
        if made is not None and made.path is not None:
            self._host.say(f"{words}: {made.what}, in {made.path.name}")
            self._changed()
        elif (waiting := self._with_earlier_edits()) is not None:
            waiting.ask_back()
        else:
            self._host.say("nothing to take back" if verb == "undo" else "nothing to make again")

    def _with_earlier_edits(self) -> Editor[Any] | None:
        """An editor whose file waits for an answer whether edits of an earlier session are brought back."""
        return next((one for one in self._editors() if one.file is not None and one.file.found), None)

    def _dirty(self) -> list[_Edited]:
        return [(editor, file) for editor in self._editors() for file in editor.all_files() if file.dirty]

    def difference(self) -> None:
        """What saving would change."""
        dirty = self._dirty()
        if dirty:
            self._host.ask(Ask(f"Not saved: {_what(dirty)}", _difference(dirty), {}))
        else:
            self._host.say("nothing is edited")

    def save(self) -> None:
        """Show what changes in which file, then save all of it."""
        dirty = self._dirty()
        if not dirty:
            self._host.say("nothing is edited")
            return
        for editor, file in dirty:
            if file.changed_on_disk():
                editor.ask_disk(file)
                return
        what = f"{_what(dirty)} to {dirty[0][1].path.name}" if len(dirty) == 1 else _what(dirty)
        ask = Ask(f"Save {what}?", _difference(dirty), {"Enter": "save"})
        self._host.ask(ask, lambda key: self._save() if key == "Enter" else None)

    def _save(self) -> None:
        dirty = self._dirty()
        files = {file.path: file for _, file in dirty}
        try:
            saved = self._host.session.save()
        except ChangedOnDisk as error:
            for editor, file in dirty:
                if os.fspath(file.path) == os.fspath(error.file or ""):
                    editor.ask_disk(file)
            return
        except LidarcheckError as error:
            self._host.say(error)
        else:
            self._host.say("; ".join(saved_words(files[path], number) for path, number in saved))
        self._changed()


def _rows(file: EditedFile[Any]) -> str:
    return counted(len(file.diff()), file.NOUN)


def _what(dirty: Sequence[_Edited]) -> str:
    """How much is edited: rows of one file, or how many files."""
    return _rows(dirty[0][1]) if len(dirty) == 1 else counted(len(dirty), "file")


def _difference(dirty: Sequence[_Edited]) -> list[Line]:
    """What differs in each file, under its name where there are several."""
    lines: list[Line] = []
    for editor, file in dirty:
        if len(dirty) > 1:
            lines.append(line(f"{file.path.name}: {_rows(file)}", "title"))
        lines += editor.diff_lines(file)
    return lines
