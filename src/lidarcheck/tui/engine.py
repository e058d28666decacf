"""The number after each edit: expected at once, simulated in a sample when the hand rests, then at other distances.

All that is known of a number is kept by the key of its inputs: undo finds it again, and nothing is called current that
belongs to other inputs.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import threading
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lidarcheck.session.inputs import Inputs
from lidarcheck.session.node import Derived, Node
from lidarcheck.session.session import CURRENT, FAILED, FIRST_S, OLD, RENEWED_S, Session
from lidarcheck.session.steps import EditMade, Steps

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Number, Step
    from lidarcheck.calibration.number.request import Request

__all__ = ["EXPECTED", "NONE_BECAUSE", "REST_S", "Asked", "Engine", "Known", "Process"]

EXPECTED, NONE_BECAUSE = "expected", "none: "
"""The words for a number of the same inputs without noise, and for a measurement that has none, with why behind it."""
REST_S = 0.12
"""After the last key of so long a sample is simulated."""
_ENTRY = "lidarcheck.calibration.number.entry:{}"
_VERSION = 1
_EXPECTS, _SEEN, _OTHERS, _ALL = range(4)
"""What is computed first."""


class Process(Protocol):
    """What computes beside the interface: `session.worker.Worker`, or what a test answers by hand."""

    def submit(
        self,
        entry: str,
        arguments: tuple[Any, ...] = (),
        edited: Mapping[str, bytes] | None = None,
        on_progress: Callable[[int, int, str], object] | None = None,
        on_done: Callable[[Any], object] | None = None,
        *,
        lane: str = "",
        priority: int = 0,
    ) -> Any:
        """Have it computed; the newest of a lane counts."""

    def cancel(self, ticket: Any) -> None:
        """It is not waited for any more."""

    def close(self) -> None:
        """End it."""


@dataclass(frozen=True)
class Asked:
    """A measurement with what it is held against. `name`: the measurement's; `request`: None where there is no number,
    `none`, and why."""

    name: str
    request: Request | None = field(default=None, hash=False)
    none: str = ""


@dataclass(frozen=True)
class Known:
    """What is known of a measurement's number: the state in words, the number, which may be of older inputs, and the
    steps from `before` and from the start to it; None where they are not known."""

    state: str = ""
    number: Number | None = None
    step: Step | None = None
    before: Number | None = None
    since_start: Step | None = None
    start: Number | None = None


class Engine:
    """Keeps the numbers of all measurements up to date with what is edited.

    `asked`: what there is, the one that is seen first. `later(seconds, do)` calls `do` in the interface's thread after
    a while and gives what has `stop()`; `soon(do, ...)` does at once, from any thread. `on_change`: a number or a
    state is another; `on_number`: a number has come for the inputs as they are now.
    """

    def __init__(
        self, session: Session, worker: Process | None, later: Callable[..., Any], soon: Callable[..., object]
    ):
        self.session, self.steps = session, Steps(session)
        self.asked: tuple[Asked, ...] = ()
        self.on_change: Callable[[], object] = lambda: None
        self.on_number: Callable[[Asked], object] = lambda _asked: None
        self._worker, self._later, self._soon = worker, later, soon
        self._timer: Any = None
        self._running: dict[str, tuple[Any, str, str]] = {}
        self._failed: dict[str, str] = {}
        self._last: dict[tuple[str, str], str] = {}
        self._seconds: dict[tuple[str, str], list[float]] = {}
        self._keys: dict[Hashable, str] = {}
        self._keyed_at = -1
        self._lock = threading.RLock()

    # What there is to know

    @property
    def is_there(self) -> bool:
        """Whether anything can be computed."""
        return self._worker is not None

    def known(self, asked: Asked) -> Known:
        """What is known of a number; cheap, to be asked at each drawing."""
        if asked.request is None:
            return Known(f"{NONE_BECAUSE}{asked.none}")
        now = self.session.inputs()
        number = self._of(asked, now)
        before, start = self._of(asked, self.steps.before), self._of(asked, self.steps.start)
        if number is None:
            return replace(self._older(asked, now), before=before, start=start)
        self._last[_identity(asked)] = self._key(asked, now)
        step, since = (None if one is number else _judged(one, number) for one in (before, start))
        return Known(CURRENT, number, step, before, since, start)

    def _older(self, asked: Asked, now: Inputs) -> Known:
        """The state of a number that is not there for the inputs as they are."""
        key, hoped = self._key(asked, now), self._of(asked, now, "expected")
        last = self._value(self._last.get(_identity(asked), ""))
        running = self._running.get(key)
        if running is not None:
            return Known(f"computing{running[1]}", hoped or last)
        if key in self._failed:
            return Known(f"{FAILED}{self._failed[key]}", last)
        if hoped is not None:
            return Known(EXPECTED, hoped)
        return Known("" if last is None else self._why_old(asked), last)

    def _why_old(self, asked: Asked) -> str:
        """Of which edit the number is that is still shown."""
        last = self.session.store.get(self._last.get(_identity(asked), ""))
        return f"{OLD}, of edit {last.edit}" if last is not None and last.edit < self.session.edits else OLD

    def whole(self, asked: Asked) -> Number | None:
        """The number of whole frames, where it was computed from the inputs as they are."""
        return self._of(asked, self.session.inputs(), "whole")

    def after(self, asked: Asked, made: EditMade) -> Number | None:
        """The number as it was after an edit."""
        return self._of(asked, self.steps.inputs_of(made.contents))

    def _of(self, asked: Asked, inputs: Inputs, how: str = "sample") -> Number | None:
        return self._value(self._key(asked, inputs, how)) if asked.request is not None else None

    def _value(self, key: str) -> Number | None:
        found = self.session.store.get(key)
        return None if found is None else found.value

    def node(self, asked: Asked, inputs: Inputs, how: str = "sample") -> Node:
        """What a number is computed by: in the worker's process, so that the node itself computes nothing."""
        request = self._request(asked, inputs)
        return Node(f"number, {how}", _VERSION, (asked.name, request.kind), request.files, _elsewhere, request)

    def _key(self, asked: Asked, inputs: Inputs, how: str = "sample") -> str:
        """The key of a number; large files that have changed are waited for where it is computed, and not here."""
        if self._keyed_at != self.session.edits:
            self._keys.clear()
            self._keyed_at = self.session.edits
        of = (asked, how, tuple(sorted(inputs.edited.items())))
        if of not in self._keys:
            self._keys[of] = self.node(asked, inputs, how).key(inputs, wait=False)
        return self._keys[of]

    def _request(self, asked: Asked, inputs: Inputs) -> Request:
        assert asked.request is not None
        return replace(asked.request, start=self.steps.started_with(inputs))

    # What happens

    def ask(self, asked: Sequence[Asked]) -> None:
        """These measurements are there now, the one that is seen first."""
        if self.asked == tuple(asked):
            return
        self.asked = tuple(asked)
        if self._worker is not None:
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
        edited = self.steps.look()
        self._keys.clear()
        if self._worker is None:
            return
        states = (self.session.inputs(), self.steps.before, self.steps.start)
        ways = [(state, "sample") for state in states] + [(states[0], "expected")]
        there = [one for one in self.asked if one.request is not None]
        wanted = {self._key(one, state, how) for one in there for state, how in ways}
        with self._lock:
            stale = [ticket for key, (ticket, _, how) in self._running.items() if how != "whole" and key not in wanted]
            self._running = {k: v for k, v in self._running.items() if v[2] == "whole" or k in wanted}
        for ticket in stale:
            self._worker.cancel(ticket)
        if edited:
            self._expect()
        if edited or self._timer is None:
            if self._timer is not None:
                self._timer.stop()
            self._timer = self._later(REST_S, self._rested)

    def _expect(self) -> None:
        """Without noise, for what is seen, unless it was simulated."""
        now = self.session.inputs()
        for asked in self.asked[:1]:
            if asked.request is not None and asked.request.kind == "misfit" and self._of(asked, now) is None:
                self._submit(asked, now, "expected", _EXPECTS)

    def _rested(self) -> None:
        self._timer = None
        for number, asked in enumerate(self.asked):
            if asked.request is not None and self._is_cheap(asked):
                self._sample(asked, _SEEN if number == 0 else _OTHERS)
        self.on_change()

    def _sample(self, asked: Asked, priority: int) -> None:
        """The number now, and those that it is compared with."""
        for inputs in (self.session.inputs(), self.steps.before, self.steps.start):
            self._submit(asked, inputs, "sample", priority)

    def _is_cheap(self, asked: Asked) -> bool:
        """By the quickest so far; the first reads and prepares what the later ones use again."""
        seconds = self._seconds.get(_identity(asked), [0.0])
        return min(seconds) <= (FIRST_S if len(seconds) < 2 else RENEWED_S)

    def renew(self, asked: Asked) -> bool:
        """Compute a number again, however long it takes; whether there is anything to do."""
        if asked.request is None or self._worker is None or self.known(asked).state == CURRENT:
            return False
        self._failed.pop(self._key(asked, self.session.inputs()), None)
        self._sample(asked, _SEEN)
        self.on_change()
        return True

    def run_all(self) -> int:
        """Whole frames of all measurements; how many are computed now."""
        inputs, count = self.session.inputs(), 0
        for asked in self.asked:
            if asked.request is not None and self.whole(asked) is None:
                self._submit(asked, inputs, "whole", _ALL)
                count += 1
        self.on_change()
        return count

    def stop(self) -> bool:
        """Stop all that is computed; whether there was anything."""
        with self._lock:
            tickets, self._running = [ticket for ticket, _, _ in self._running.values()], {}
        for ticket in tickets:
            if self._worker is not None:
                self._worker.cancel(ticket)
        self.on_change()
        return bool(tickets)

    @property
    def busy(self) -> bool:
        """Whether something is computed, or will be when the hand rests."""
        return bool(self._running) or self._timer is not None

    def set_baseline(self) -> bool:
        """What is set now is what numbers are compared with from now on, or no longer; whether it is."""
        found = self.steps.set_baseline()
        self.look()
        return found

    # In the worker

    def _submit(self, asked: Asked, inputs: Inputs, how: str, priority: int) -> None:
        """Have a number computed, unless it is known, failed or under way."""
        if self._worker is None:
            return
        node = self.node(asked, inputs, how)
        part = node.needs(inputs)
        key = node.key_of(part)
        with self._lock:
            if self.session.store.get(key) is not None or key in self._running or key in self._failed:
                return
            self._running[key] = (None, "", how)
        request = self._request(asked, inputs)
        if how == "whole":
            from lidarcheck.calibration.number.request import WHOLE_SEEDS

            request = replace(request, seeds=WHOLE_SEEDS)
        real = (os.path.realpath(name) for name, _ in part.files)
        edited = {name: inputs.edited[name] for name in real if name in inputs.edited}
        ticket = self._worker.submit(
            _ENTRY.format(how),
            (request,),
            edited,
            partial(self._progress, key),
            partial(self._done, asked, node, key, dict(part.files), self.session.edits),
            lane=key,
            priority=priority,
        )
        with self._lock:
            if key in self._running:
                self._running[key] = (ticket, self._running[key][1], how)

    def _progress(self, key: str, done: int, of: int, now: str) -> None:
        """In the worker's thread."""
        with self._lock:
            if key not in self._running:
                return
            ticket, _, how = self._running[key]
            self._running[key] = (ticket, f" {done}/{of} {now}".rstrip() if of > 1 else f": {now}" if now else "", how)
        self._soon(self.on_change)

    def _done(self, asked: Asked, node: Node, key: str, files: Mapping[str, str], edit: int, outcome: Any) -> None:
        """In the worker's thread: keep the number, under the key of what it was computed from."""
        with self._lock:
            self._running.pop(key, None)
            if outcome.failed:
                self._failed[key] = outcome.failed
            elif outcome.value is not None:
                self.session.store.put(Derived(outcome.value, key, dict(files), edit, outcome.seconds, time.time()))
        self._soon(self._arrived, asked, node, key, outcome)

    def _arrived(self, asked: Asked, node: Node, key: str, outcome: Any) -> None:
        """In the interface's thread."""
        is_now = asked in self.asked and key == self._key(asked, self.session.inputs())
        if node.name == "number, sample" and not outcome.failed:
            self._seconds.setdefault(_identity(asked), []).append(outcome.seconds)
        if is_now and not outcome.failed:
            self._last[_identity(asked)] = key
        self.on_change()
        if node.name != "number, expected":
            self.on_number(asked)


def _identity(asked: Asked) -> tuple[str, str]:
    return asked.name, "" if asked.request is None else asked.request.kind


def _judged(before: Number | None, after: Number) -> Step | None:
    """The step between two numbers that count in the same; None where they do not."""
    if before is None or not (before.exact and after.exact) or (before.kind, before.scale) != (after.kind, after.scale):
        return None
    from lidarcheck.calibration.number.number import judged

    return judged(before, after)


def _elsewhere(_told: Any) -> Any:
    raise AssertionError("a number is computed in the worker's process")
