"""What a person has open, and what was computed from it: which of it belongs to what is set now, and which does not.

Nothing here is marked as old: a result is `current` if and only if its key is the key of the inputs as they are now.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.reading import reading
from lidarcheck.session.describe import described
from lidarcheck.session.inputs import Inputs
from lidarcheck.session.kept_history import KeptHistory
from lidarcheck.session.node import NONE, Cancelled, Derived, Node, Part, ProgressCallback, words_of
from lidarcheck.session.open_files import OpenFiles
from lidarcheck.session.store import Store
from lidarcheck.session.ticket import Outcome, Ticket
from lidarcheck.session.worker import Worker
from lidarcheck.workers.identity import source_of_results

__all__ = ["CURRENT", "FAILED", "FIRST_S", "NONE", "OLD", "RENEWED_S", "SAVED", "Session"]

CURRENT, OLD, SAVED = "current", "OLD", "saved model"
FAILED = "failed: "
"""The words for results of exactly these inputs; of others; of the files, where edits of these are not saved. What
could not be computed has failed, and why stands behind it, as behind `NONE` where there is nothing to compute."""
RENEWED_S, FIRST_S = 2.0, 10.0
"""What took no longer than this is computed again by itself when its inputs change; the second where it was the first
of its kind in this process, which loads libraries and compiled code besides.
"""
_LOOKS_S = 1.0
"""How often files are looked at: what another program changes is seen within two seconds."""


class Session(OpenFiles):
    """The open files, the results by their keys, and what is computed now; for any thread.

    `on_change`: is called, in any thread, when inputs or results may be others.
    """

    def __init__(
        self, store: Store | None = None, worker: Worker | None = None, kept: KeptHistory | None = None
    ) -> None:
        super().__init__()
        self._kept = kept
        self.store = store or Store()
        self.worker = worker or Worker()
        self._last: dict[Hashable, str] = {}
        self._failed: dict[str, str] = {}
        self._running: dict[str, str] = {}
        self._tickets: dict[str, Ticket] = {}
        self._kinds: set[str] = set()
        self._ended = threading.Event()

    # Numbers

    def note(self, measurement: str, number: Any, edit: int | None = None, *, step: Any = None) -> None:
        """Keep what was found of a measurement with an edit, that in force if none is named, for the next start too.
        `step`: whether it is better than what was before, where that is known.
        """
        super().note(measurement, number, edit)
        if self._kept is not None:
            self._kept.number(self.began, self.step(self.edit if edit is None else edit), measurement, number, step)

    def moved(self, edit: int, *, undone: bool) -> None:
        """An edit was taken back or made again: what was found with it says so."""
        if self._kept is not None and self.step(edit).numbers:
            self._kept.moved(self.began, edit, undone=undone)

    # Results

    def status(self, node: Node) -> tuple[str, Derived | None]:
        """(the state of what is known of a node, in a word or some; what was computed, which may be older).

        The state is empty where nothing was computed yet. Reads no large file: it may be asked at each drawing.
        """
        last = self.store.get(self._last.get(node.identity, ""))
        if last is None and not self._running and not self._failed:
            return "", None
        inputs = self.inputs()
        key = node.key(inputs, wait=False)
        kept = self.store.get(key)
        if kept is not None and self._unchanged(kept.files, inputs):
            return CURRENT, kept
        if key in self._running:
            return f"computing{self._running[key]}", last
        if key in self._failed:
            failed = self._failed[key]
            return failed if failed.startswith(NONE) else f"{FAILED}{failed}", last
        return ("", None) if last is None else (self._why_old(last, inputs), last)

    def current(self, node: Node) -> Derived | None:
        """What was computed from the inputs as they are now; None where that is not known."""
        word, derived = self.status(node)
        return derived if word == CURRENT else None

    def known(self, node: Node, inputs: Inputs | None = None) -> Derived | None:
        """What is kept of a node for such inputs, those of now if none are given; reads no large file."""
        inputs = inputs or self.inputs()
        kept = self.store.get(node.key(inputs, wait=False))
        return kept if kept is not None and self._unchanged(kept.files, inputs) else None

    def recalled(self, node: Node, inputs: Inputs) -> tuple[str, Part, Derived | None]:
        """(key, part of the inputs, what is kept for them in memory or on the disk)."""
        part = node.needs(inputs)
        key = node.key_of(part)
        kept = self.store.find(key, inputs.edit)
        if kept is None or not self._unchanged(kept.files, inputs):
            return key, part, None
        self._last[node.identity] = key
        return key, part, kept

    def compute(
        self, node: Node, on_progress: ProgressCallback = lambda _done, _of, _now: None, *, saved: bool = False
    ) -> Derived:
        """Compute a node from the inputs as they are now, in this thread, unless it is known. `saved`: from the files
        as the disk has them.

        `InputError` where a file was changed meanwhile: then nothing is known of either content.
        """
        inputs = self.saved() if saved else self.inputs()
        key, part, kept = self.recalled(node, inputs)
        if kept is not None:
            return kept
        self._running[key] = ""
        try:
            made = self._made(node, part, inputs, self._counted(key, on_progress))
        except Cancelled:
            raise
        except Exception as error:
            self._failed[key] = words_of(error)
            raise
        finally:
            self._running.pop(key, None)
            self.on_change()
        self._keep(node, made)
        self.on_change()
        self.store.save(made)
        return made

    def want(
        self,
        node: Node,
        *,
        lane: str = "",
        priority: int = 0,
        inputs: Inputs | None = None,
        on_progress: ProgressCallback = lambda _done, _of, _now: None,
        on_done: Callable[[Derived | None], object] = lambda _derived: None,
    ) -> Ticket | None:
        """Have the worker process compute a node that has an `entry`, from the inputs as they are now, or others.

        None where it is known: then nothing is called. `on_done` gets what was made, or None where it has failed, as
        `status` then says; asking again tries again. Lane and priority are as for `Worker.submit`. The digest of each
        file that has changed is computed at once.
        """
        inputs = inputs or self.inputs()
        key, part, kept = self.recalled(node, inputs)
        ticket = self._tickets.get(key)
        if kept is not None or (ticket is not None and ticket.live):
            return None if kept is not None else ticket
        self._running[key] = ""
        self._tickets[key] = self.worker.submit(
            node.entry,
            node.arguments,
            inputs.edited,
            self._counted(key, on_progress, words=True),
            lambda outcome: self._answered(node, part, inputs, outcome, on_done),
            on_gone=lambda: self._ended_run(key),
            lane=lane,
            priority=priority,
        )
        self.on_change()
        return self._tickets[key]

    def _answered(
        self, node: Node, part: Part, inputs: Inputs, outcome: Outcome, on_done: Callable[[Derived | None], object]
    ) -> None:
        """In the worker's thread: check and keep what it has computed."""
        key, made = node.key_of(part), None
        if outcome.failed:
            self._failed[key] = outcome.failed
        else:
            try:
                made = self._checked(node, part, inputs, outcome)
                self._keep(node, made)
            except LidarcheckError as error:
                self._failed[key] = words_of(error)
        self._ended_run(key)
        on_done(made)
        if made is not None:
            self.store.save(made)

    def _ended_run(self, key: str) -> None:
        self._running.pop(key, None)
        self._tickets.pop(key, None)
        self.on_change()

    def _keep(self, node: Node, made: Derived) -> None:
        self._failed.pop(made.key, None)
        self.store.put(made)
        self._last[node.identity] = made.key

    def _made(self, node: Node, part: Part, inputs: Inputs, on_progress: ProgressCallback) -> Derived:
        start = time.monotonic()
        with reading(inputs.edited) as read:
            value = node.made(on_progress)
        outcome = Outcome(value, "", time.monotonic() - start, read.files, frozenset(read.taken))
        return self._checked(node, part, inputs, outcome)

    def _checked(self, node: Node, part: Part, inputs: Inputs, outcome: Outcome) -> Derived:
        """What was computed, unless it was computed from something else than these inputs."""
        when, first = time.time(), node.name not in self._kinds
        named = {os.path.realpath(path) for path in inputs.with_named(node.files)}
        for name in sorted(named & inputs.edited.keys() - outcome.taken):
            raise InputError("has edits that are not saved, and is read from the disk", file=name, fix="save it first")
        changed = sorted(set(part.files) ^ set(node.needs(inputs).files))
        if changed:
            raise InputError("was changed while this was computed", file=changed[0][0], fix="compute it again")
        files = {name: inputs.digest(name) for name in sorted(named | outcome.files.keys())}
        self._kinds.add(node.name)
        return Derived(outcome.value, node.key_of(part), files, inputs.edit, outcome.seconds, when, first)

    def _counted(self, key: str, on_progress: ProgressCallback, *, words: bool = False) -> ProgressCallback:
        """Keeps how far it is for `status`; `words`: what is said is what is counted, as seeds."""

        def progress(done: int, of: int, now: str) -> None:
            self._running[key] = f" {done}/{of} {now if words else ''}".rstrip() if of > 1 else ""
            on_progress(done, of, now)

        return progress

    def is_cheap(self, derived: Derived) -> bool:
        """Whether it is computed again by itself when its inputs change."""
        return derived.seconds <= (FIRST_S if derived.first else RENEWED_S)

    def describe(self, node: Node) -> list[str]:
        """What a node's result was computed from, and what makes the same; see `described`."""
        return described(self, node)

    # What belongs to what

    def state_of(self, files: Mapping[str, str], code: str = "", *, wait: bool = False) -> str:
        """The state of something that a command computed from files, by path with their digests then: `CURRENT`,
        `SAVED` where files among them have edits that are not saved, else `OLD` and why. `code`: the hash of the
        source that computed it, where that is known. `wait` for large files to be read, which the first time takes.
        """
        changed = _changed(files, self.saved(), wait=wait)
        if changed:
            return f"{OLD}, {_listed(changed)} changed"
        if code and code != source_of_results():
            return f"{OLD}, of another lidarcheck"
        return SAVED if self.edited_of(files) else CURRENT

    def edited_of(self, files: Iterable[str | os.PathLike[str]]) -> list[str]:
        """Which of these files have edits that are not saved."""
        edited = {name for name, file in list(self._open.items()) if file.dirty}
        return [os.fspath(name) for name in files if os.path.realpath(name) in edited]

    def _unchanged(self, files: Mapping[str, str], inputs: Inputs) -> bool:
        return not _changed(files, inputs)

    def _why_old(self, last: Derived, inputs: Inputs) -> str:
        """Of what edit it is; where there was none since, which file has changed."""
        changed = _changed(last.files, inputs)
        edited = {name for name in changed if name in self._open}
        if edited and last.edit != self.edit:
            return f"{OLD}, of edit {last.edit}"
        return f"{OLD}, {_listed(changed)} changed" if changed else OLD

    # The disk

    def look(self) -> bool:
        """Look at all files that something was computed from; whether one of them is another now."""
        changed = bool(self.disk.changed())
        if changed:
            self.on_change()
        return changed

    def watch(self) -> None:
        """Look at the files once a second, in a thread, until `close`."""
        threading.Thread(target=self._watch, name="files", daemon=True).start()

    def _watch(self) -> None:
        while not self._ended.wait(_LOOKS_S):
            self.look()

    def close(self) -> None:
        """End the watch and the worker process."""
        self._ended.set()
        self.worker.close()


def _changed(files: Mapping[str, str], inputs: Inputs, *, wait: bool = False) -> list[str]:
    """Which files are not what they were."""
    return [name for name, digest in files.items() if inputs.digest(name, wait=wait) != digest]


def _listed(names: list[str]) -> str:
    first = Path(names[0]).name
    return first if len(names) == 1 else f"{first} and {counted(len(names) - 1, 'more file')}"
