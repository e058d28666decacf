"""One file being edited: undo and redo, the journal, saving, and what happens to the file meanwhile."""

from __future__ import annotations

import base64
import contextlib
import glob
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.formats.table import counted
from lidarcheck.session.history import Edit, History, edit_between, replayed
from lidarcheck.session.journal import Journal, Record, read_journal
from lidarcheck.session.lock import FileLock
from lidarcheck.session.own_files import content_hash, file_key, own_directory, own_file

__all__ = ["ChangedOnDisk", "EditedFile", "journal_of"]

_ABANDONED_S = 60.0


class ChangedOnDisk(InputError):
    """The file is no longer what the edits began from; the user must say what shall happen."""


class Content(Protocol):
    """What a file holds, with its bytes."""

    @property
    def content(self) -> bytes | None:
        """The bytes; every edited file has some."""


T = TypeVar("T", bound=Content)


class EditedFile(Generic[T]):
    """A file, edited. `current` is what is shown, `saved` what the edits differ from.

    Every edit is in the journal before it counts. Where another process edits the file, or nothing can be kept beside
    it, the session is `read_only`, which then says why. `found`: edits of an earlier session that was not ended;
    `bring_back` or `forget` them. `notice`: what else was found at the start, for the log. `behind`: what is shown is
    older than the disk's content, and cannot be saved. `on_change`: is called after whatever changes what is shown or
    saved; `on_edit` before it after an edit, with what it is about. `next_number`: gives the number of an edit or a
    step; that of a session where the file belongs to one.
    """

    NOUN = "row"

    def __init__(self, path: Path, root: Path) -> None:
        self.path = path
        self.saved = self.current = self._load()
        self.history = History()
        self.read_only = ""
        self.notice = ""
        self.found: list[Record] = []
        self.behind = False
        self._nothing_there = False
        self.on_change: Callable[[], object] = lambda: None
        self.on_edit: Callable[[Edit, str], object] = lambda _edit, _about: None
        self.next_number: Callable[[], int] = lambda: self.history.latest + 1
        self._root = root
        self._journal: Journal | None = None
        self._lock: FileLock | None = None
        self._seen = self._hash_of_saved()
        self._claim()

    # What a kind of file says of itself

    def _load(self) -> T:
        """The file as it is on the disk now."""
        raise NotImplementedError

    def _parse(self, content: bytes) -> T:
        """What such bytes hold."""
        raise NotImplementedError

    def _differences(self, before: T, after: T) -> list[Any]:
        """What differs, a row each."""
        raise NotImplementedError

    def _alike(self, _one: T, _other: T) -> bool:
        """Whether the differences of two contents can be told row by row."""
        return True

    # The session

    def _claim(self) -> None:
        """Take the lock and look for a journal; else say in `read_only` why there is no editing."""
        try:
            self._lock = self._lock or FileLock(own_file(self._root, f"{file_key(self.path)}.lock"))
            self._journal = Journal(own_file(self._root, journal_of(self.path, self._root).name))
            if not self._lock.take():
                self.read_only = f"{self.path.name} is being edited by {self._lock.holder()}; it can be seen only"
                return
            self.read_only = ""
            self._look_back(self._journal)
            _sweep(self.path)
        except InputError as error:
            self.read_only = error.lines()[0].removeprefix("error: ")
        except OSError as error:
            self.read_only = f"{self.path.name} can be seen only: its lock cannot be taken, {error.strerror or error}"

    def claim_again(self) -> bool:
        """Try to become the editor; whether this session is."""
        if self.read_only:
            self._claim()
            if not self.read_only:
                self.reload()
        return not self.read_only

    @property
    def content(self) -> bytes:
        """The file's bytes with all edits."""
        return _bytes(self.current)

    @property
    def dirty(self) -> bool:
        """Whether there is something to save: what is shown is not what the disk had when it was looked at last."""
        return self._nothing_there or self.content != _bytes(self.saved)

    def parsed(self, content: bytes) -> T:
        """What other bytes of the file hold, as those that it had before."""
        return self._parse(content)

    def diff(self) -> list[Any]:
        """What saving would change."""
        return self._differences(self.saved, self.current)

    # Edits

    def _edit(self, after: T, what: str, about: str = "") -> bool:
        """Make an edit that leads to `after`; whether it changes anything. `about`: the rows, in words."""
        edit = edit_between(self.content, _bytes(after), what)
        if edit is None:
            return False
        edit = replace(edit, number=self.next_number())
        self._keep(edit.record())
        self.current = after
        self.history.add(edit)
        self.on_edit(edit, about)
        self.on_change()
        return True

    def undo(self) -> str:
        """Take the last edit back; what it was, empty if there is none."""
        return self._step("undo")

    def redo(self) -> str:
        """Make the edit that was taken back again; what it was, empty if there is none."""
        return self._step("redo")

    def _step(self, verb: str) -> str:
        self._check_editable()
        edit = self.history.last(verb)
        if edit is None:
            return ""
        after, number = self._parse(edit.applied(self.content, back=verb == "undo")), self.next_number()
        self._keep({verb: True, "n": number})
        self.current = after
        self.history.move(verb, number)
        self.on_change()
        return edit.what

    def _check_editable(self) -> None:
        if self.read_only:
            raise UsageError(self.read_only, fix="reload tries again")
        if self.found:
            raise UsageError("edits of an earlier session wait", fix="bring them back or leave them first")

    def _keep(self, record: Record) -> None:
        assert self._journal is not None
        if not self._journal.path.exists():
            self._journal.begin(self._head())
        self._journal.append(record)

    def _head(self) -> Record:
        base = base64.b64encode(self.content).decode()
        return {"file": str(self.path), "base": base, "saved": self._hash_of_saved()}

    # The disk

    def _hash_of_saved(self) -> str:
        """The hash of the file that the edits began from; empty where there was none."""
        return content_hash(_bytes(self.saved))

    def changed_on_disk(self) -> bool:
        """Whether the file is no longer what was read or saved last."""
        return self._disk_hash() != self._seen

    def on_disk(self) -> str:
        """What has become of the file where it is not what was read, in words that follow its name."""
        try:
            self.path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return "was removed"
        except OSError as error:
            return f"cannot be read any more ({error.strerror or error})"
        return "changed"

    def _disk_hash(self) -> str:
        try:
            return content_hash(self.path.read_bytes())
        except OSError:
            return ""

    def save(self, *, overwrite: bool = False) -> int:
        """Write the file, atomic; how much changed, as `diff`. `ChangedOnDisk` unless `overwrite` is given."""
        self.check_savable(overwrite=overwrite)
        number = len(self.diff())
        write_bytes(self.path, self.content)
        self._mark_saved()
        return number

    def check_savable(self, *, overwrite: bool = False) -> None:
        """Raise what `save` would, before it writes."""
        self._check_editable()
        if not overwrite and self.changed_on_disk():
            fix = "overwrite it, or reload it and lose the edits here"
            raise ChangedOnDisk(f"the file {self.on_disk()} since it was read", file=self.path, fix=fix)

    def _mark_saved(self) -> None:
        self.saved = self.current
        self._nothing_there = False
        self._seen = content_hash(self.content)
        assert self._journal is not None
        # The file is in its place: a journal that cannot be told so is recognised by the file's hash.
        with contextlib.suppress(InputError):
            if self._journal.path.exists():
                self._journal.append({"saved": self._seen})
        self.on_change()

    def reload(self) -> None:
        """Read the file again; edits that were not saved are gone, and what could be undone too."""
        self.saved = self.current = self._load()
        self.behind = self._nothing_there = False
        self._seen = self._hash_of_saved()
        self.history = History()
        if self._journal is not None and not self.read_only:
            self._journal.clear()
            self.found = []
        self.on_change()

    def accept_disk(self) -> None:
        """Keep what is shown: what it differs by from the disk's content is from now on what saving would change.

        Where that content is gone or at fault, saving writes all that is shown. A session that may only look stays
        `behind` instead.
        """
        seen = self._disk_hash()
        if self.read_only:
            self._seen, self.behind = seen, True
            return
        saved, nothing = self.saved, False
        try:
            saved = self._load()
        except LidarcheckError:
            nothing = True
        if nothing or _bytes(saved) != self.content:
            self._keep({"kept": seen})
        self.saved, self._seen, self._nothing_there = saved, seen, nothing
        self.on_change()

    # Recovery

    def _look_back(self, journal: Journal) -> None:
        """Find edits of an earlier session that the file lacks; a journal without any is removed."""
        try:
            records = read_journal(journal.path)
            if len(records) > 1 and content_hash(replayed(records, self.path)[0]) != self._seen:
                self._parse(replayed(records, self.path)[0])
                self.found = records
        except LidarcheckError as error:
            aside = journal.path.with_suffix(".damaged")
            with contextlib.suppress(OSError):
                journal.path.replace(aside)
            self.notice = f"{error.lines()[0]} as {aside.name}"
        if not self.found:
            journal.clear()

    def found_in_words(self) -> str:
        """What an earlier session left, for the question whether to bring it back."""
        after = self._parse(replayed(self.found, self.path)[0])
        edits = sum("edit" in record for record in self.found)
        number = len(self._differences(self.saved, after)) if self._alike(self.saved, after) else edits
        return f"{self.path.name}: an earlier session ended with {counted(number, self.NOUN)} not saved"

    def bring_back(self) -> None:
        """Make the edits of the earlier session again, undo included."""
        content, self.history, saved = replayed(self.found, self.path)
        self.current = self._parse(content)
        # A file that is none of the journal's states was changed by somebody else: saving must ask.
        if self._seen not in saved:
            self._seen = saved[-1]
        if not self._alike(self.saved, self.current):
            self.saved = self._parse(base64.b64decode(self.found[0]["base"]))
        self.found = []
        self.on_change()

    def forget(self) -> None:
        """Leave the edits of the earlier session; its journal is kept beside, in case of a mistake."""
        assert self._journal is not None
        self._journal.close()
        if self._journal.path.exists():
            self._journal.path.replace(self._journal.path.with_suffix(".left"))
        self.found = []

    def close(self) -> None:
        """End the session: with nothing left to save its journal goes; else it stays for the next start."""
        if self._journal is not None:
            if self._lock is not None and self._lock.held and not self.dirty and not self.found:
                self._journal.clear()
            self._journal.close()
        if self._lock is not None:
            self._lock.drop()


def journal_of(path: Path, root: Path) -> Path:
    """Where the journal of a file lies, whether there is one or not."""
    return own_directory(root) / f"{file_key(path)}.journal"


def _bytes(held: Content) -> bytes:
    assert held.content is not None
    return held.content


def _sweep(path: Path) -> None:
    """Remove what a killed process left of a save: parts of this file that nobody has written to for a minute."""
    with contextlib.suppress(OSError):
        for part in path.parent.glob(f".{glob.escape(path.name[:32])}.*.part"):
            if time.time() - part.stat().st_mtime > _ABANDONED_S:
                part.unlink()
