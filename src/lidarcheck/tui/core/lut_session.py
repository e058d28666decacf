"""One LUT file being edited: cells, undo and redo, the journal, saving, and what happens to the file meanwhile."""

from __future__ import annotations

import base64
import contextlib
import glob
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lidarcheck.calibration.lut_edit import Change, changes, set_rows, shifted, smoothed
from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats.lut import Axis, LutFile, load_lut, parse_lut, save_lut
from lidarcheck.formats.table import counted
from lidarcheck.tui.core.history import Edit, History, edit_between
from lidarcheck.tui.core.journal import Journal, Record, read_journal
from lidarcheck.tui.core.lock import FileLock
from lidarcheck.tui.core.places import key_of, private_directory, sha256

__all__ = ["ChangedOnDisk", "LutSession"]

_ABANDONED_S = 60.0


class ChangedOnDisk(InputError):
    """The file is no longer what the edits began from; the user must say what shall happen."""


class LutSession:
    """A LUT file, edited. `current` is what is shown, `saved` what the edits differ from.

    Every edit is in the journal before it counts. Where another process edits the file, or nothing can be kept beside
    it, the session is `read_only`, which then says why. `found`: edits of an earlier session that was not ended;
    `bring_back` or `forget` them. `notice`: what else was found at the start, for the log.
    """

    def __init__(self, path: Path, root: Path) -> None:
        self.path = path
        self.saved = self.current = load_lut(path)
        self.history = History()
        self.read_only = ""
        self.notice = ""
        self.found: list[Record] = []
        self._root = root
        self._journal: Journal | None = None
        self._lock: FileLock | None = None
        self._seen = sha256(self.saved.content)
        self._claim()

    def _claim(self) -> None:
        """Take the lock and look for a journal; else say in `read_only` why there is no editing."""
        try:
            directory = private_directory(self._root)
            name = key_of(self.path)
            self._lock = self._lock or FileLock(directory / f"{name}.lock")
            self._journal = Journal(directory / f"{name}.journal")
            if not self._lock.take():
                self.read_only = f"{self.path.name} is being edited by {self._lock.holder()}; it can be seen only"
                return
            self.read_only = ""
            self._look_back(self._journal)
            _sweep(self.path)
        except InputError as error:
            self.read_only = error.lines()[0]
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
    def dirty(self) -> bool:
        """Whether there is something to save."""
        return self.current.content != self.saved.content

    def diff(self) -> list[Change]:
        """The rows that saving would change."""
        return changes(self.saved, self.current)

    # Edits

    def set(self, axis: Axis, rows: Sequence[int], value: str) -> bool:
        """Rows get a scaled value, or where it has a point or an exponent a true Y; whether that changed anything."""
        true_y = "." in value or "e" in value.lower()
        return self._edit(axis, f"set {value}", lambda lut: set_rows(lut, axis, rows, value, true_y=true_y))

    def nudge(self, axis: Axis, rows: Sequence[int], steps: int) -> bool:
        """Rows move by steps of the scale and stop at its ends."""
        return self._edit(axis, f"nudge {steps:+d}", lambda lut: shifted(lut, axis, rows, steps, clip=True))

    def smooth(self, axis: Axis, rows: Sequence[int]) -> bool:
        """Rows move half of the way to the line through their neighbours."""
        return self._edit(axis, "smooth", lambda lut: smoothed(lut, axis, rows))

    def undo(self) -> str:
        """Take the last edit back; what it was, empty if there is none."""
        return self._step(self.history.done, "undo")

    def redo(self) -> str:
        """Make the edit that was taken back again; what it was, empty if there is none."""
        return self._step(self.history.undone, "redo")

    def _edit(self, axis: Axis, what: str, make: Callable[[LutFile], LutFile]) -> bool:
        self._check_editable()
        after = make(self.current)
        edit = edit_between(self.current, after, axis, what)
        if edit is None:
            return False
        self._keep(edit.record())
        self.current = after
        self.history.add(edit)
        return True

    def _step(self, stack: list[Edit], verb: str) -> str:
        self._check_editable()
        if not stack:
            return ""
        edit = stack[-1]
        after = edit.applied(self.current, back=verb == "undo")
        self._keep({verb: True})
        self.current = after
        (self.history.undo if verb == "undo" else self.history.redo)()
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
        base = base64.b64encode(self.current.content).decode()
        return {"file": str(self.path), "base": base, "saved": sha256(self.saved.content)}

    # The disk

    def changed_on_disk(self) -> bool:
        """Whether the file is no longer what was read or saved last."""
        return self._disk_hash() != self._seen

    def _disk_hash(self) -> str:
        try:
            return sha256(self.path.read_bytes())
        except OSError:
            return ""

    def save(self, *, overwrite: bool = False) -> int:
        """Write the file, atomic; the number of rows changed. `ChangedOnDisk` unless `overwrite` is given."""
        self._check_editable()
        if not overwrite and self.changed_on_disk():
            there = "changed" if self.path.exists() else "was removed"
            fix = "overwrite it, or reload it and lose the edits here"
            raise ChangedOnDisk(f"the file {there} since it was read", file=self.path, fix=fix)
        number = len(self.diff())
        save_lut(self.current, self.path)
        self._mark_saved()
        return number

    def _mark_saved(self) -> None:
        self.saved = self.current
        self._seen = sha256(self.current.content)
        assert self._journal is not None
        # The file is in its place: a journal that cannot be told so is recognised by the file's hash.
        with contextlib.suppress(InputError):
            if self._journal.path.exists():
                self._journal.append({"saved": self._seen})

    def reload(self) -> None:
        """Read the file again; edits that were not saved are gone, and what could be undone too."""
        self.saved = self.current = load_lut(self.path)
        self._seen = sha256(self.saved.content)
        self.history = History()
        if self._journal is not None and not self.read_only:
            self._journal.clear()
            self.found = []

    def accept_disk(self) -> None:
        """Keep the edits, and take what is on the disk now as known: saving will not ask about it again."""
        self._seen = self._disk_hash()

    # Recovery

    def _look_back(self, journal: Journal) -> None:
        """Find edits of an earlier session that the file lacks; a journal without any is removed."""
        try:
            records = read_journal(journal.path)
            if len(records) > 1 and sha256(_replay(records, self.path)[0].content) != self._seen:
                self.found = records
        except InputError as error:
            aside = journal.path.with_suffix(".damaged")
            with contextlib.suppress(OSError):
                journal.path.replace(aside)
            self.notice = f"{error.lines()[0]} as {aside.name}"
        if not self.found:
            journal.clear()

    def found_in_words(self) -> str:
        """What an earlier session left, for the question whether to bring it back."""
        lut, _, _ = _replay(self.found, self.path)
        number = len(changes(self.saved, lut)) if _alike(self.saved, lut) else sum("edit" in r for r in self.found)
        return f"{self.path.name}: an earlier session ended with {counted(number, 'row')} not saved"

    def bring_back(self) -> None:
        """Make the edits of the earlier session again, undo included."""
        self.current, self.history, saved = _replay(self.found, self.path)
        # A file that is none of the journal's states was changed by somebody else: saving must ask.
        if self._seen not in saved:
            self._seen = saved[-1]
        if not _alike(self.saved, self.current):
            self.saved = parse_lut(base64.b64decode(self.found[0]["base"]), self.path)
        self.found = []

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


def _sweep(path: Path) -> None:
    """Remove what a killed process left of a save: parts of this file that nobody has written to for a minute."""
    with contextlib.suppress(OSError):
        for part in path.parent.glob(f".{glob.escape(path.name[:32])}.*.part"):
            if time.time() - part.stat().st_mtime > _ABANDONED_S:
                part.unlink()


def _alike(one: LutFile, other: LutFile) -> bool:
    """Whether both have the same tables with as many rows."""
    return {axis: len(t) for axis, t in one.tables.items()} == {axis: len(t) for axis, t in other.tables.items()}


def _replay(records: list[dict[str, Any]], path: Path) -> tuple[LutFile, History, list[str]]:
    """(the file after all edits, their history, the hashes that the file had when it was saved)."""
    try:
        lut = parse_lut(base64.b64decode(records[0]["base"]), path)
        history, saved = History(), [str(records[0]["saved"])]
        for record in records[1:]:
            if "edit" in record:
                edit = Edit.of(record)
                lut = edit.applied(lut)
                history.add(edit)
            elif "undo" in record:
                lut = history.undo().applied(lut, back=True)
            elif "redo" in record:
                lut = history.redo().applied(lut)
            elif "saved" in record:
                saved.append(str(record["saved"]))
    except (LidarcheckError, KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"the journal is damaged: {error}", file=path, fix="it is kept") from error
    return lut, history, saved
