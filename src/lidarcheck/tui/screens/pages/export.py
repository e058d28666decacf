"""Writing what a screen of pages shows: the files of a command's --out, or others, beside the interface."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.actions import command_of
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import line

if TYPE_CHECKING:
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["Exports", "file_name"]


class Exports:
    """Asks where to, and has a thread write there, one thing at a time. `writing`: what, empty for nothing."""

    def __init__(self, view: View) -> None:
        self.view = view
        self.writing = ""

    def ask_directory(self, job: Job, made: Computed, kind: str, files: Mapping[str, Writer]) -> None:
        """Page, numbers, pictures of a kind and other `files`, to a directory that is asked for."""
        title = "Write report.html, result.json and pictures/ to which directory?"
        self._ask(title, f"{file_name(job.name)}_out", partial(self._directory, job, made, kind, files))

    def ask_file(self, title: str, name: str, write: Callable[[Path], str], job: Job) -> None:
        """A file whose name is asked for; `write` gets its path, in a thread, and gives what is to be said."""
        self._ask(title, name, partial(self._file, write, job))

    def _ask(self, title: str, name: str, then: Callable[[str], None]) -> None:
        if self.writing:
            self.view.say(f"{self.writing} is being written")
            return
        self.view.app.push_screen(AskText(title, name), lambda given: then(given) if given else None)

    def _directory(self, job: Job, made: Computed, kind: str, files: Mapping[str, Writer], name: str) -> None:
        from lidarcheck.figures.files.result_folder import PAGE, RESULT, check_out_dir

        out = self.view.host.project.root / name
        write = partial(self._write_page, made, out, name, kind, files)
        try:
            check_out_dir(out, besides=job.files, files=files, option="the page")
        except LidarcheckError as error:
            self.view.say(error)
            return
        self._sure(name, [file for file in (PAGE, RESULT, *files) if (out / file).exists()], write)

    def _file(self, write: Callable[[Path], str], job: Job, name: str) -> None:
        from lidarcheck.figures.files.outputs import check_writable

        path = self.view.host.project.root / name
        try:
            check_writable(path, option="this", besides=job.files)
        except LidarcheckError as error:
            self.view.say(error)
            return
        self._sure(name, [name] if path.exists() else [], partial(write, path))

    def _sure(self, name: str, there: list[str], write: Callable[[], str]) -> None:
        """What is there is replaced only when that is wanted."""
        if not there:
            self.start(name, write)
            return
        words = [line(f"{file} is there already") for file in there]
        ask = Ask(f"{name}: replace what is there?", words, {"y": "replace it"})
        self.view.app.push_screen(ask, lambda key: self.start(name, write) if key == "y" else None)

    def start(self, name: str, write: Callable[[], str]) -> None:
        """Have something written by a thread, which the end of the interface waits for."""
        if self.writing:
            self.view.say(f"{self.writing} is being written")
            return
        self.writing = name
        self.view.say(f"{name}: writing ...")
        host = self.view.host

        def run() -> None:
            said: str | LidarcheckError
            try:
                said, bad = write(), False
            except LidarcheckError as error:
                said, bad = error, True
            except Exception as error:  # noqa: BLE001 - a fault in writing must not take the interface with it
                said, bad = f"error: {name}: internal error, {type(error).__name__}: {error}", True
            host.soon(self._written, said, bad)

        threading.Thread(target=run, name=f"write {name}").start()

    def _written(self, said: str | LidarcheckError, bad: bool) -> None:
        self.writing = ""
        self.view.say(said, bad=bad)

    def _write_page(self, made: Computed, out: Path, name: str, kind: str, files: Mapping[str, Writer]) -> str:
        from lidarcheck.figures.files.result_folder import PAGE, PICTURES, RESULT, write_page

        write_page(made.page, made.document, out, command=command_of(self.view.NAME), kind=kind, files=files)
        return f"{name}: {', '.join([PAGE, RESULT, *([f'{PICTURES}/'] if made.page.figures() else []), *files])}"


def file_name(words: str) -> str:
    """A name for a file, of words."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", Path(words).name).strip("_.") or "page"
