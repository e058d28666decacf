"""Writing what a screen of pages shows: the files of a command's --out, or others, beside the interface."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.session import CURRENT
from lidarcheck.tui.actions import command_of
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import line

if TYPE_CHECKING:
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["Export", "Exports", "file_name"]


@dataclass(frozen=True)
class Export:
    """What is written: what was computed of a job, its pictures as of a `kind`, and other `files`.

    `state`: whether it belongs to what is set; `origin`: what it was computed from.
    """

    job: Job
    made: Computed
    kind: str
    files: Mapping[str, Writer]
    state: str
    origin: Mapping[str, Any]


class Exports:
    """Asks where to, and has a thread write there, one thing at a time. `writing`: what, empty for nothing."""

    def __init__(self, view: View) -> None:
        self.view = view
        self.writing = ""

    def ask_directory(self, export: Export) -> None:
        """Page, numbers, pictures and other files, to a directory that is asked for."""
        which = "" if export.state == CURRENT else f", which are {export.state},"
        title = f"Write report.html, result.json and pictures/{which} to which directory?"
        self._ask(title, f"{file_name(export.job.name)}_out", partial(self._directory, export))

    def ask_file(self, title: str, name: str, write: Callable[[Path], str], job: Job) -> None:
        """A file whose name is asked for; `write` gets its path, in a thread, and gives what is to be said."""
        self._ask(title, name, partial(self._file, write, job))

    def _ask(self, title: str, name: str, then: Callable[[str], None]) -> None:
        if self.writing:
            self.view.say(f"{self.writing} is being written")
            return
        self.view.host.ask(AskText(title, name), lambda given: then(given) if given else None)

    def _directory(self, export: Export, name: str) -> None:
        from lidarcheck.figures.files.result_folder import PAGE, RESULT, check_out_dir

        out, files = self.view.host.project.root / name, export.files
        try:
            check_out_dir(out, besides=export.job.files, files=files, option="the page")
        except LidarcheckError as error:
            self.view.say(error)
            return
        there = [file for file in (PAGE, RESULT, *files) if (out / file).exists()]
        self._sure(name, there, partial(self._write_page, export, out, name))

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
        self.view.host.ask(ask, lambda key: self.start(name, write) if key == "y" else None)

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

    def _write_page(self, export: Export, out: Path, name: str) -> str:
        from lidarcheck.figures.files.result_folder import PAGE, PICTURES, RESULT, stamped, write_page

        made, files, origin = export.made, export.files, export.origin
        page, command = stamped(made.page, origin), command_of(self.view.NAME)
        write_page(page, made.document, out, command=command, kind=export.kind, files=files, origin=origin)
        return f"{name}: {', '.join([PAGE, RESULT, *([f'{PICTURES}/'] if made.page.figures() else []), *files])}"


def file_name(words: str) -> str:
    """A name for a file, of words."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", Path(words).name).strip("_.") or "page"
