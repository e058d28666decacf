"""The files that are open, as one: their edits in one order, what they were at the start, and all of them at once."""

from __future__ import annotations

import os
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.session.digests import GONE, Digests
from lidarcheck.session.edited_file import EditedFile
from lidarcheck.session.history import Edit, Place, unpacked
from lidarcheck.session.inputs import Inputs
from lidarcheck.session.own_files import content_hash

__all__ = ["OpenFiles", "Step"]

_REST_S = 2.0
"""Edits of the same rows that follow each other within so long are one step for whoever asks what it was before."""
_MOST_BURSTS = 1000


@dataclass(frozen=True)
class Step:
    """An edit in the order of all: its number, the file, what was done to what, and when (seconds since the epoch, 0
    where that is not known).

    `burst`: the number of the edit that began the step that it belongs to; `undone`: it is taken back; `numbers`: what
    was found with it, by measurement. The step 0 is the files as they were read.
    """

    number: int
    path: Path | None
    what: str
    about: str = ""
    when: float = 0.0
    burst: int = 0
    undone: bool = False
    numbers: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Shown:
    """The content of a file, and whether there was a file of it or an edit: defaults may stand for none."""

    content: bytes
    there: bool


@dataclass(frozen=True)
class _Burst:
    """Edits that are one step: of what, when the last of them was made, and what all files were before the first."""

    path: str
    about: str
    number: int
    last_s: float
    edit: int
    before: Mapping[str, _Shown]


S = TypeVar("S", bound=EditedFile[Any])


class OpenFiles:
    """`on_change`: is called, in any thread, when a file's content may be another. `edits`: how often one was: edits,
    undo, redo, saving and reading again included. `began`: when, in seconds since the epoch. `shows_baseline`: the
    baseline stands in the place of what is set now in all that is shown, until a file is edited.
    """

    def __init__(self) -> None:
        self.disk = Digests()
        self.on_change: Callable[[], object] = lambda: None
        self.edits = 0
        self._open: dict[str, EditedFile[Any]] = {}
        self._count = 0
        self.began = time.time()
        self._first: dict[str, _Shown] = {}
        self._pinned: tuple[Mapping[str, _Shown], int] | None = None
        self.shows_baseline = False
        self._now: dict[str, _Shown] = {}
        self._bursts: OrderedDict[int, _Burst] = OrderedDict()
        self._burst_of: dict[int, int] = {}
        self._going = self._in_force = 0
        self._is_edit = False
        self._words: dict[int, tuple[Path, str, str, float]] = {}
        self._numbers: dict[int, dict[str, Any]] = {}

    # Files

    def hold(self, file: EditedFile[Any]) -> None:
        """A file was opened: from now on its edits are inputs, and part of the one history."""
        real = os.path.realpath(file.path)
        self._open[real] = file
        file.on_change = lambda: self._changed(real, file)
        file.on_edit = lambda edit, about: self._edited(real, file, edit, about)
        file.next_number = self._next_number
        self._now[real] = self._shown(real, file)
        self._first.setdefault(real, self._now[real])

    def drop(self, file: EditedFile[Any]) -> None:
        """A file was closed: what is on the disk counts again."""
        real = os.path.realpath(file.path)
        if self._open.get(real) is file:
            del self._open[real]
            self._now.pop(real, None)
            file.on_change, file.on_edit = lambda: None, lambda _edit, _about: None
            self.on_change()

    def open_files(self) -> list[EditedFile[Any]]:
        """The files that are open, edited or not."""
        return list(self._open.values())

    def _next_number(self) -> int:
        self._count = max([self._count, *(file.history.latest for file in self.open_files())]) + 1
        return self._count

    def _shown(self, real: str, file: EditedFile[Any]) -> _Shown:
        return _Shown(file.content, file.dirty or self.disk.of(real) != GONE)

    # Contents

    def inputs(self) -> Inputs:
        """All inputs as they are shown now."""
        if self.shows_baseline and self._pinned is not None:
            return self._inputs_of(*self._pinned)
        edited = {name: file.content for name, file in list(self._open.items()) if file.dirty}
        return Inputs(edited, self.disk, self.edit)

    def saved(self) -> Inputs:
        """All inputs as the disk has them."""
        return Inputs({}, self.disk, self.edit)

    def start(self) -> Inputs:
        """All inputs, with each file that was ever opened as it was then."""
        return self._inputs_of(self._first, 0)

    def before(self) -> Inputs:
        """What the number now is held against: the baseline; without one, all as it was before the last step that was
        not taken back; before any, the start.
        """
        if self._pinned is not None:
            return self._inputs_of(*self._pinned)
        burst = self._bursts.get(self._burst_of.get(self.edit, 0))
        return self.start() if burst is None else self._inputs_of(burst.before, burst.edit)

    def baseline(self) -> Inputs | None:
        """All as it was when it was pinned; None where it is not."""
        return None if self._pinned is None else self._inputs_of(*self._pinned)

    def pin(self) -> None:
        """What is set now is the baseline."""
        self._pinned, self.shows_baseline = (dict(self._now), self.edit), False
        self.on_change()

    def unpin(self) -> None:
        """There is no baseline any more."""
        self._pinned, self.shows_baseline = None, False
        self.on_change()

    def show_baseline(self, is_shown: bool) -> None:
        """Have the baseline shown in the place of what is set now, or that again."""
        self.shows_baseline = is_shown and self._pinned is not None
        self.on_change()

    def content_shown(self, file: EditedFile[Any]) -> bytes:
        """The bytes of an open file that are shown: with all edits, or as they were at the baseline."""
        shown = None if self._pinned is None else self._pinned[0].get(os.path.realpath(file.path))
        return file.content if shown is None or not self.shows_baseline else shown.content

    def _inputs_of(self, contents: Mapping[str, _Shown], edit: int) -> Inputs:
        """Inputs with these contents, in the place of the disk's only where that has others."""
        edited = {}
        for real, shown in contents.items():
            disk = self.disk.of(real)
            if disk != content_hash(shown.content) and (shown.there or disk != GONE):
                edited[real] = shown.content
        return Inputs(edited, self.disk, edit)

    # Edits

    @property
    def edit(self) -> int:
        """The number of the last edit that is not taken back; 0 for none."""
        tops = [place for file in self.open_files() if (place := file.history.top("undo")) is not None]
        return max(tops, key=lambda place: place.since).number if tops else 0

    def apply(self, file: S, make: Callable[[S], bool]) -> Step | None:
        """Edit a file that is open; the edit, None where nothing changes. Raises what `make` does."""
        return self.step(self.edit) if make(file) else None

    def undo(self) -> Step | None:
        """Take back the last edit of all open files, and say which; None where there is none."""
        return self._move("undo", 0)

    def redo(self) -> Step | None:
        """Make the edit that was taken back last again; none, where another edit was made since."""
        return self._move("redo", max((file.history.made for file in self.open_files()), default=0))

    def _move(self, verb: str, after: int) -> Step | None:
        tops = [(place, file) for file in self.open_files() if (place := file.history.top(verb)) is not None]
        if not tops:
            return None
        place, file = max(tops, key=lambda top: top[0].since)
        if place.since <= after:
            return None
        file.undo() if verb == "undo" else file.redo()
        self._name(place, file)
        self.moved(place.number, undone=verb == "undo")
        return self.step(place.number)

    def moved(self, edit: int, *, undone: bool) -> None:
        """An edit was taken back, or made again."""

    def _edited(self, real: str, file: EditedFile[Any], edit: Edit, about: str) -> None:
        """An edit was made: it goes on with the step before, or begins one."""
        now_s, last = time.monotonic(), self._bursts.get(self._going)
        if last is None or (last.path, last.about) != (real, about) or not about or now_s - last.last_s > _REST_S:
            last = _Burst(real, about, edit.number, now_s, self._in_force, dict(self._now))
        self._going, self._is_edit = last.number, True
        self._bursts[last.number] = replace(last, last_s=now_s)
        if len(self._bursts) > _MOST_BURSTS:
            self._bursts.popitem(last=False)
        self._burst_of[edit.number] = last.number
        self._words[edit.number] = file.path, edit.what, about, time.time()

    def _changed(self, real: str, file: EditedFile[Any]) -> None:
        """After an edit, or what ends the step that it would go on with."""
        if not self._is_edit:
            self._going = 0
        self._is_edit = self.shows_baseline = False
        self.edits += 1
        self._in_force, self._now[real] = self.edit, self._shown(real, file)
        self.on_change()

    # History

    def steps(self, most: int = 100) -> list[Step]:
        """The last edits of all open files, the newest first, those taken back included; at the end the files as they
        were read.
        """
        found: dict[int, bool] = {}
        for file in self.open_files():
            for undone, places in ((True, file.history.undone[-most:]), (False, file.history.done[-most:])):
                for place in places:
                    self._name(place, file)
                    found[place.number] = undone
        last = sorted(found, reverse=True)[:most]
        return [*(replace(self.step(number), undone=found[number]) for number in last), self.step(0)]

    def _name(self, place: Place, file: EditedFile[Any]) -> None:
        """An edit of an earlier session is known by its words alone."""
        if place.number not in self._words:
            self._words[place.number] = file.path, unpacked(place).what, "", 0.0

    def step(self, number: int) -> Step:
        """An edit by its number; the files as they were read for 0."""
        numbers = dict(self._numbers.get(number, {}))
        if number not in self._words:
            return Step(0, None, "as read", when=self.began, numbers=numbers)
        path, what, about, when = self._words[number]
        return Step(number, path, what, about, when, self._burst_of.get(number, number), numbers=numbers)

    def note(self, measurement: str, number: Any, edit: int | None = None) -> None:
        """Keep what was found of a measurement with an edit, that in force if none is named."""
        self._numbers.setdefault(self.edit if edit is None else edit, {})[measurement] = number

    # All at once

    def unsaved(self) -> int:
        """How many rows and values are edited and not saved."""
        return sum(max(len(file.diff()), 1) for file in self.open_files() if file.dirty)

    def save(self, *, overwrite: bool = False) -> list[tuple[Path, int]]:
        """Write all files that have edits; each with how much changed. Where one of them may not be written, none is.

        Where one of several cannot be written in the end, as on a full disk, those before it are, and the error says
        which; the edits of the others stay.
        """
        dirty = [file for file in self.open_files() if file.dirty]
        for file in dirty:
            file.check_savable(overwrite=overwrite)
        saved: list[tuple[Path, int]] = []
        for file in dirty:
            try:
                saved.append((file.path, file.save(overwrite=overwrite)))
            except LidarcheckError as error:
                if not saved:
                    raise
                names = ", ".join(path.name for path, _ in saved)
                fix = f"{names} {'is' if len(saved) == 1 else 'are'} saved; {error.fix}"
                raise InputError(error.what, file=error.file, fix=fix) from error
        return saved
