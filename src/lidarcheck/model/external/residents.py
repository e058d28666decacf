"""Processes of external models that stay up: lent to one piece of work at a time, ended when nobody needs them."""

from __future__ import annotations

import atexit
import contextlib
import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from lidarcheck.model.external.process import Groups
from lidarcheck.model.external.resident import Resident
from lidarcheck.model.spec import External
from lidarcheck.trust.program_text import hash_of
from lidarcheck.workers.cores import usable_cores

__all__ = ["end_all", "lent"]

_log = logging.getLogger(__name__)


class _Key(NamedTuple):
    """What a process was started from; `text`: what the model was made of then."""

    external: str
    text: str


_idle: list[tuple[_Key, Resident]] = []
"""Those that wait for work, the longest first."""
_lock = threading.Lock()


@contextlib.contextmanager
def lent(external: External, start: Callable[[External, Groups], Resident], groups: Groups) -> Iterator[Resident]:
    """One that runs the model as its files are now, for the block alone; started where none waits.

    Where an error leaves it with a question that it has not answered it is ended, and the next block gets a fresh one:
    a request says all that its answer may depend on.
    """
    key = _Key(repr(external), hash_of(external))
    resident = _taken(key)
    if resident is None:
        resident = start(external, groups)
    groups.add(resident.group)
    try:
        yield resident
    finally:
        groups.discard(resident.group)
        if resident.ready:
            _put_back(key, resident)
        else:
            resident.end()


def _taken(key: _Key) -> Resident | None:
    """The one that was used last; those of the same model from other text are ended."""
    found, stale = None, []
    with _lock:
        for entry in reversed(_idle[:]):
            own, resident = entry
            if own == key and found is None and resident.ready:
                found = resident
                _idle.remove(entry)
            elif (own.external == key.external and own.text != key.text) or not resident.ready:
                stale.append(resident)
                _idle.remove(entry)
    _end(stale)
    return found


def _put_back(key: _Key, resident: Resident) -> None:
    with _lock:
        _idle.append((key, resident))
        surplus = [one for _, one in _idle[: max(0, len(_idle) - usable_cores())]]
        del _idle[: len(surplus)]
    _end(surplus)


def _end(residents: Sequence[Resident]) -> None:
    for resident in residents:
        resident.end(gently=True)


@atexit.register
def end_all() -> None:
    """End all that wait; the next run starts anew."""
    with _lock:
        residents = [one for _, one in _idle]
        _idle.clear()
    _end(residents)
