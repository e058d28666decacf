"""Results by their keys, in memory: those that nobody looked at for longest go first. What took long is on the disk."""

from __future__ import annotations

import dataclasses
import logging
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from lidarcheck.session.disk_store import DiskStore
from lidarcheck.session.node import Derived

__all__ = ["STORE_BYTES", "Store", "size_of"]

_log = logging.getLogger(__name__)
_Result = TypeVar("_Result")
STORE_BYTES = 256_000_000
"""Some dozen pages with their points; a bench computer has memory for other programs too."""


class Store:
    """Keeps `Derived` up to a number of bytes; for any thread. `disk`: keeps what took long too."""

    def __init__(self, most: int = STORE_BYTES, disk: DiskStore | None = None) -> None:
        self.most, self.disk = most, disk
        self.held = 0
        self._kept: OrderedDict[str, tuple[Derived, int]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: str) -> Derived | None:
        """What is in memory under a key."""
        with self._lock:
            found = self._kept.get(key)
            if found is None:
                return None
            self._kept.move_to_end(key)
            return found[0]

    def find(self, key: str, edit: int = 0) -> Derived | None:
        """The same, on the disk too; `edit`: the number of the session's last edit, for what is found there."""
        found = self.get(key)
        kept = self._on_disk(lambda disk: disk.get(key)) if found is None else None
        if kept is not None:
            found = dataclasses.replace(kept, edit=edit)
            self.put(found)
        return found

    def save(self, derived: Derived) -> None:
        """Have the disk keep a result for the next start, where that is worth it."""
        self._on_disk(lambda disk: disk.put(derived))

    def _on_disk(self, do: Callable[[DiskStore], _Result]) -> _Result | None:
        """What is only kept to spare work must not cost a result, whatever fault it has: that is in its `fault`."""
        if self.disk is None:
            return None
        before, found = self.disk.fault, None
        try:
            found = do(self.disk)
        except Exception as error:  # noqa: BLE001 - see above
            self.disk.fault = f"internal error, {type(error).__name__}: {error}"
        if self.disk.fault and self.disk.fault != before:
            _log.warning("results are not kept for the next start: %s", self.disk.fault)
        return found

    def put(self, derived: Derived) -> None:
        """Keep a result; alone, if it is larger than all that may be kept."""
        size = size_of(derived.value)
        with self._lock:
            self._drop(derived.key)
            self._kept[derived.key] = derived, size
            self.held += size
            while self.held > self.most and len(self._kept) > 1:
                self._drop(next(iter(self._kept)))

    def _drop(self, key: str) -> None:
        _, size = self._kept.pop(key, (None, 0))
        self.held -= size


def size_of(value: Any) -> int:
    """About how many bytes a value holds; what it has twice counts once."""
    seen: set[int] = set()
    waiting, total = [value], 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        total += one.nbytes if isinstance(one, np.ndarray) else sys.getsizeof(one)
        if isinstance(one, Mapping):
            waiting += [*one.keys(), *one.values()]
        elif isinstance(one, list | tuple | set | frozenset):
            waiting += one
        elif dataclasses.is_dataclass(one) and not isinstance(one, type):
            waiting += [getattr(one, part.name) for part in dataclasses.fields(one)]
    return total
