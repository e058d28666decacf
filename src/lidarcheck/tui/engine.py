"""The number after each edit: expected at once, simulated in a sample when the hand rests, then at other distances.

All that is known of a number is the session's, by the key of its inputs: undo finds it again, and nothing is called
current that belongs to other inputs.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.session.inputs import Inputs
from lidarcheck.session.node import Derived, Node
from lidarcheck.session.open_files import Step as Edit
from lidarcheck.session.session import CURRENT, FAILED, NONE, RENEWED_S, Session

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Number, Step
    from lidarcheck.calibration.number.request import Request

__all__ = ["EXPECTED", "NOT_YET", "REST_S", "Asked", "Engine", "Known"]

EXPECTED, NOT_YET = "expected", "not yet known"
"""The words for a number of the same inputs without noise, and for one that was not computed yet."""
REST_S = 0.12
"""After the last key of so long a sample is simulated."""
_ENTRY = "lidarcheck.calibration.number.entry:{}"
_VERSION = 1
_EXPECTS, _SEEN, _OTHERS, _ALL = range(4)
"""What is computed first."""
_KEY_S = 0.5
"""How long the key of the same edits is believed; files are looked at once a second."""


@dataclass(frozen=True)
class Asked:
    """A measurement's `name`, and what is asked of it: the `request`; None where there is no number, and why."""

    name: str
    request: Request | None = field(default=None, hash=False)
    none: str = ""

    @property
    def identity(self) -> tuple[str, str]:
        """Which number it is."""
        return self.name, "" if self.request is None else self.request.kind


@dataclass(frozen=True)
class Known:
    """What is known of a measurement's number: the state in words, the number, which may be of older inputs, and the
    steps from `before` and from the start to it; None where they are not known.
    """

    state: str = ""
    number: Number | None = None
    step: Step | None = None
    before: Number | None = None
    since_start: Step | None = None
    start: Number | None = None

    @property
    def is_of_now(self) -> bool:
        """Whether the number is of the inputs as they are, simulated or expected."""
        return self.state in (CURRENT, EXPECTED) or (self.number is not None and not self.number.exact)


class Engine:
    """Keeps the numbers of all measurements up to date with what is edited.

    `asked`: what there is, the one that is seen first. `later(seconds, do)` calls `do` in the interface's thread after
    a while and gives what has `stop()`; `soon(do, ...)` does at once, from any thread. `on_change`: a number or a
    state may be another; `on_number`: a number has come; `on_news`: what keeps numbers waiting, empty for
    nothing any more. Nothing is computed unless it is `on`.
    """

    def __init__(self, session: Session, later: Callable[..., Any], soon: Callable[..., object], *, on: bool) -> None:
        self.session, self.on = session, on
        self.asked: tuple[Asked, ...] = ()
        self.on_change: Callable[[], object] = lambda: None
        self.on_number: Callable[[Asked], object] = lambda _asked: None
        self.on_news: Callable[[str], object] = lambda _now: None
        self._news = ""
        self._later, self._soon = later, soon
        self._timer: Any = None
        self._tickets: dict[str, tuple[Any, str]] = {}
        self._failed: set[str] = set()
        self._seconds: dict[tuple[str, str], list[float]] = {}
        self._keys: dict[Hashable, tuple[float, str]] = {}
        self._contents: Hashable = None

    # What there is to know

    def known(self, asked: Asked) -> Known:
        """What is known of a number; cheap, to be asked at each drawing."""
        if asked.request is None:
            return Known(f"{NONE}{asked.none}")
        now = self.session.inputs()
        number, before, start = (self.of(asked, one) for one in (now, self.session.before(), self.session.start()))
        if number is None:
            state, shown = self._older(asked, now)
            return Known(state, shown, None, before, None, start)
        step, since = (None if one is number else _judged(one, number) for one in (before, start))
        return Known(CURRENT, number, step, before, since, start)

    def _older(self, asked: Asked, now: Inputs) -> tuple[str, Number | None]:
        """The state of a number that is not there for the inputs as they are, and what is shown meanwhile."""
        word, derived = self.session.status(self.node(asked, now))
        hoped, last = self.of(asked, now, "expected"), None if derived is None else derived.value
        if word.startswith((FAILED, NONE)):
            return word, last
        if word.startswith("computing"):
            return word, hoped or last
        if hoped is not None:
            return EXPECTED, hoped
        return (word if word not in ("", CURRENT) else NOT_YET if self.on else ""), last

    def of(self, asked: Asked, inputs: Inputs, how: str = "sample") -> Number | None:
        """A number that is known of such inputs; of a `sample`, of `whole` frames, or `expected` without noise."""
        found = None if asked.request is None else self.session.store.get(self._key(asked, inputs, how))
        return None if found is None else found.value

    def whole(self, asked: Asked) -> Number | None:
        """The number of whole frames of the inputs as they are."""
        return self.of(asked, self.session.inputs(), "whole")

    def after(self, asked: Asked, edit: Edit) -> Number | None:
        """The number as it was found after an edit."""
        found: Number | None = edit.numbers.get(_noted(asked))
        return found

    @property
    def edits(self) -> list[Edit]:
        """The edits that are not taken back, the newest first."""
        return [edit for edit in self.session.steps() if edit.number and not edit.undone]

    def node(self, asked: Asked, inputs: Inputs, how: str = "sample", *, compared: bool = False) -> Node:
        """What the worker computes a number by; `compared`: it is of older inputs, and shown as nothing else."""
        assert asked.request is not None
        request = replace(asked.request, start=self._started_with(asked.request, inputs))
        if how == "whole":
            from lidarcheck.calibration.number.request import WHOLE_SEEDS

            request = replace(request, seeds=WHOLE_SEEDS)
        about = (*asked.identity, "compared" if compared else "")
        name = f"number, {how}"
        return Node(
            name, _VERSION, about, request.files, entry=_ENTRY.format(how), arguments=(request,),
            command=request.command(whole=how == "whole"),
        )  # fmt: skip

    def _started_with(self, request: Request, inputs: Inputs) -> dict[str, bytes]:
        """What edited files that it reads held when the session began, by real path; those that hold something else."""
        start = _started_with(self.session, inputs)
        named = {os.path.realpath(path) for path in inputs.with_named(request.files)} if start else set()
        return {name: content for name, content in start.items() if name in named}

    def _key(self, asked: Asked, inputs: Inputs, how: str = "sample") -> str:
        of, moment = (asked, how, tuple(sorted(inputs.edited.items()))), time.monotonic()
        made, key = self._keys.get(of, (float("-inf"), ""))
        if moment - made > _KEY_S:
            key = self.node(asked, inputs, how).key(inputs, wait=False)
            self._keys[of] = moment, key
        return key

    # What happens

    def ask(self, asked: Sequence[Asked]) -> None:
        """These measurements are there now, the one that is seen first."""
        if self.asked == tuple(asked):
            return
        self.asked = tuple(asked)
        self._keys.clear()
        if self.on:
            files = [path for one in asked if one.request is not None for path in one.request.files]
            threading.Thread(target=self._prepare, args=(files,), name="numbers", daemon=True).start()

    def _prepare(self, files: Sequence[Path]) -> None:
        """In a thread: read the digests of large files, and load what judges, so that nobody waits for it later."""
        with contextlib.suppress(ImportError):
            importlib.import_module("scipy.special")
        for path in dict.fromkeys(files):
            self.session.disk.of(path)
        self._soon(self.look)

    def look(self) -> None:
        """Something may be another: have what is missing computed, once the hand rests."""
        if not self.on:
            return
        now = self.session.inputs()
        edited, self._contents = self._contents != now.edited, now.edited
        self._keys = {of: kept for of, kept in self._keys.items() if time.monotonic() - kept[0] <= _KEY_S}
        self._give_up(now)
        if edited:
            self._expect(now)
        if edited or self._timer is None:
            if self._timer is not None:
                self._timer.stop()
            self._timer = self._later(REST_S, self._rested)

    def _give_up(self, now: Inputs) -> None:
        """Nobody waits any more for numbers of inputs that are neither set nor compared with."""
        there = [one for one in self.asked if one.request is not None]
        ways = [(now, "sample"), (now, "expected"), (self.session.before(), "sample"), (self.session.start(), "sample")]
        wanted = {self._key(one, inputs, how) for one in there for inputs, how in ways}
        for key, (ticket, how) in list(self._tickets.items()):
            if how != "whole" and key not in wanted:
                del self._tickets[key]
                self.session.worker.cancel(ticket)
        if not self._tickets:
            self._hear("")

    def _expect(self, now: Inputs) -> None:
        """Without noise, for what is seen, unless it was simulated."""
        for asked in self.asked[:1]:
            if asked.request is not None and asked.request.kind == "misfit" and self.of(asked, now) is None:
                self._submit(asked, now, "expected", _EXPECTS)

    def _rested(self) -> None:
        self._timer = None
        for number, asked in enumerate(self.asked):
            if asked.request is not None and self._is_cheap(asked):
                self._sample(asked, _SEEN if number == 0 else _OTHERS)
        self.on_change()

    def _sample(self, asked: Asked, priority: int) -> None:
        """The number now, and those that it is compared with."""
        now = self.session.inputs()
        self._submit(asked, now, "sample", priority)
        for inputs in (self.session.before(), self.session.start()):
            self._submit(asked, inputs, "sample", priority, compared=True)

    def _is_cheap(self, asked: Asked) -> bool:
        """By the quickest so far; the first alone says nothing: it prepares what the later ones use again, and may wait
        for kernels to be compiled.
        """
        seconds = self._seconds.get(asked.identity, [])
        return len(seconds) < 2 or min(seconds) <= RENEWED_S

    def renew(self, asked: Asked) -> bool:
        """Compute a number again, however long it takes; whether there is anything to do."""
        if asked.request is None or not self.on or self.known(asked).state == CURRENT:
            return False
        self._failed.clear()
        self._sample(asked, _SEEN)
        self.on_change()
        return True

    def run_all(self) -> int:
        """Whole frames of all measurements; how many are computed now."""
        self._failed.clear()
        missing = [one for one in self.asked if self.on and one.request is not None and self.whole(one) is None]
        for asked in missing:
            self._submit(asked, self.session.inputs(), "whole", _ALL)
        self.on_change()
        return len(missing)

    def stop(self) -> bool:
        """Stop all that is computed; whether there was anything."""
        tickets, self._tickets = self._tickets, {}
        for ticket, _ in tickets.values():
            self.session.worker.cancel(ticket)
        self._hear("")
        self.on_change()
        return bool(tickets)

    @property
    def busy(self) -> bool:
        """Whether something is computed, or will be when the hand rests."""
        return bool(self._tickets) or self._timer is not None

    def set_baseline(self) -> bool:
        """What is set now is what numbers are compared with from now on; once more at the same: no longer. Whether it
        is.
        """
        session, pinned = self.session, self.session.baseline()
        session.show_baseline(False)
        if pinned is not None and pinned.edited == session.inputs().edited:
            session.unpin()
        else:
            session.pin()
        return session.baseline() is not None

    # In the worker

    def _submit(self, asked: Asked, inputs: Inputs, how: str, priority: int, *, compared: bool = False) -> None:
        """Have a number computed, unless it is known, has failed, or is under way."""
        key = self._key(asked, inputs, how)
        if key in self._tickets or key in self._failed or self.session.store.get(key) is not None:
            return
        node = self.node(asked, inputs, how, compared=compared)
        done = partial(self._soon, self._arrived, asked, key, how)
        ticket = self.session.want(
            node, lane=key, priority=priority, inputs=inputs, on_progress=self._told, on_done=done
        )
        if ticket is not None and ticket.live:
            self._tickets[key] = ticket, how

    def _told(self, _done: int, of: int, now: str) -> None:
        """In the worker's thread; what is not counted, as that kernels are compiled, is said while it is so."""
        self._hear(now if of <= 1 else "")
        self._soon(self.on_change)

    def _hear(self, news: str) -> None:
        if news != self._news:
            self._news = news
            self._soon(self.on_news, news)

    def _arrived(self, asked: Asked, key: str, how: str, derived: Derived | None) -> None:
        """In the interface's thread."""
        self._tickets.pop(key, None)
        self._hear("")
        if derived is None:
            self._failed.add(key)
        elif how == "sample" and derived.value is not None:
            self._seconds.setdefault(asked.identity, []).append(derived.seconds)
            step = self.known(asked).step if derived.edit == self.session.edit else None
            self.session.note(_noted(asked), derived.value, derived.edit, step=step)
        self.on_change()
        if how != "expected":
            self.on_number(asked)


def _noted(asked: Asked) -> str:
    return ", ".join(asked.identity)


def _judged(before: Number | None, after: Number) -> Step | None:
    """The step between two numbers that count in the same; None where they do not."""
    if before is None or not (before.exact and after.exact) or (before.kind, before.scale) != (after.kind, after.scale):
        return None
    from lidarcheck.calibration.number.number import judged

    return judged(before, after)


def _started_with(session: Session, inputs: Inputs) -> dict[str, bytes]:
    """What edited files held when the session began, by real path; those alone that hold something else in inputs."""
    start, found = session.start(), {}
    for name in sorted({*start.edited, *inputs.edited}):
        if start.digest(name) != inputs.digest(name):
            with contextlib.suppress(OSError):
                found[name] = start.edited[name] if name in start.edited else Path(name).read_bytes()
    return found
